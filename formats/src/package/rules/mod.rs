//! The rules a payload obeys beyond being a sound archive. Opening checks them once; writing opens what it wrote, so
//! both sides assert the same. No rule allocates, and none costs more than the size of what it reads, but for the
//! unique names (K squared short comparisons) and the symmetric rings (a search a ring entry).

pub(super) mod baked;
mod bones;
pub(super) mod compact;
mod patches;
#[cfg(all(test, feature = "alloc"))]
mod tests;

use super::{After, IndexSlice, NO_PIECE, NONE, OpenError, Prior, SHORT_COUNT, SurfaceView, limits};

/// At least `least` and at most `limit` elements.
pub(super) fn count(field: &'static str, actual: usize, least: usize, limit: usize) -> Result<(), OpenError> {
    if actual < least {
        return Err(OpenError::TooFew { field, least, actual });
    }
    if actual > limit {
        return Err(OpenError::TooMany { field, limit, actual });
    }
    Ok(())
}

/// A count that follows from others.
pub(super) fn same_count(field: &'static str, actual: usize, expected: usize) -> Result<(), OpenError> {
    if actual == expected {
        Ok(())
    } else {
        Err(OpenError::CountMismatch {
            field,
            expected: expected as u64,
            actual: actual as u64,
        })
    }
}

/// Finite and from `least` to `greatest`.
pub(super) fn within(
    field: &'static str,
    index: usize,
    value: f32,
    least: f32,
    greatest: f32,
) -> Result<(), OpenError> {
    if !value.is_finite() {
        return Err(OpenError::NotFinite { field, index });
    }
    if value < least || value > greatest {
        return Err(OpenError::OutOfRange {
            field,
            index,
            value,
            least,
            greatest,
        });
    }
    Ok(())
}

/// Finite, above zero and at most `greatest`.
fn positive(field: &'static str, index: usize, value: f32, greatest: f32) -> Result<(), OpenError> {
    within(field, index, value, f32::MIN, greatest)?;
    if value > 0.0 {
        Ok(())
    } else {
        Err(OpenError::NotPositive { field, index })
    }
}

/// `value < limit`.
pub(super) fn below(field: &'static str, index: usize, value: u32, limit: usize) -> Result<(), OpenError> {
    if (value as usize) < limit {
        Ok(())
    } else {
        Err(OpenError::IndexOutOfRange {
            field,
            index,
            value,
            limit: limit as u32,
        })
    }
}

/// Each value is < `limit` and greater than the one before; `start` is where `values` begin in the field.
fn ascending_below(
    field: &'static str,
    start: usize,
    values: impl Iterator<Item = u32>,
    limit: usize,
) -> Result<(), OpenError> {
    let mut previous = None;
    for (i, value) in values.enumerate() {
        if previous.is_some_and(|previous| value <= previous) {
            return Err(OpenError::NotAscending {
                field,
                index: start + i,
            });
        }
        below(field, start + i, value, limit)?;
        previous = Some(value);
    }
    Ok(())
}

/// Compressed rows: `row_count + 1` offsets from 0 to `entry_count`, never falling.
fn offsets(field: &'static str, offsets: &[u32], row_count: usize, entry_count: usize) -> Result<(), OpenError> {
    same_count(field, offsets.len(), row_count + 1)?;
    same_count(field, offsets[row_count] as usize, entry_count)?;
    if offsets[0] != 0 {
        return Err(OpenError::NotContiguous { field, index: 0 });
    }
    match offsets.windows(2).position(|pair| pair[1] < pair[0]) {
        Some(row) => Err(OpenError::NotAscending { field, index: row + 1 }),
        None => Ok(()),
    }
}

/// At least `least` rest positions, finite and near enough; gives their count.
fn positions(rest_positions: &[[f32; 3]], least: usize) -> Result<usize, OpenError> {
    count("rest_positions", rest_positions.len(), least, limits::VERTICES)?;
    for (v, position) in rest_positions.iter().enumerate() {
        for &coordinate in position {
            within("rest_positions", v, coordinate, -limits::POSITION, limits::POSITION)?;
        }
    }
    Ok(rest_positions.len())
}

/// Indices of `limit` things, `stride` of them an element of the field, as wide as their count asks for.
fn indices(field: &'static str, slice: IndexSlice<'_>, stride: usize, limit: usize) -> Result<(), OpenError> {
    let greatest = match slice {
        IndexSlice::Short(values) => values.iter().max().map(|&value| u32::from(value)),
        IndexSlice::Wide(values) => values.iter().max().copied(),
    };
    let Some(greatest) = greatest else {
        return Ok(());
    };
    if greatest as usize >= limit {
        // The slow way only says which it was.
        for (i, value) in slice.iter().enumerate() {
            below(field, i / stride, value, limit)?;
        }
    }
    if (limit <= SHORT_COUNT) != matches!(slice, IndexSlice::Short(_)) {
        return Err(OpenError::IndexWidth { field });
    }
    Ok(())
}

/// At least one triangle, corners that are render vertices where there are any, and render vertices that are points.
fn surface(surface: &SurfaceView<'_>, point_count: usize) -> Result<(), OpenError> {
    let render_count = surface.render_points.len();
    count("render_points", render_count, 0, limits::RENDER_VERTICES)?;
    same_count("uvs", surface.uvs.len(), render_count)?;
    indices("render_points", surface.render_points, 1, point_count)?;
    for (r, uv) in surface.uvs.iter().enumerate() {
        for &coordinate in uv {
            within("uvs", r, coordinate, -limits::TEXTURE, limits::TEXTURE)?;
        }
    }
    count("corners", surface.face_count(), 1, limits::FACES)?;
    same_count("corners", surface.corners.len(), 3 * surface.face_count())?;
    let named = if surface.has_texture() {
        render_count
    } else {
        point_count
    };
    indices("corners", surface.corners, 3, named)
}

/// What is added after the solve: pieces and modes whose counts agree, and numbers that are finite.
fn after(after: &After<'_>, component_count: usize, point_count: usize) -> Result<(), OpenError> {
    let pieces = after.piece_count(component_count);
    count("after.piece_offsets", pieces, 0, limits::PIECES)?;
    same_count(
        "after.piece_offsets",
        after.piece_offsets.len(),
        pieces * component_count,
    )?;
    let points = if pieces == 0 { 0 } else { point_count };
    same_count("after.piece_of", after.piece_of.len(), points)?;
    for (point, &piece) in after.piece_of.iter().enumerate() {
        if piece != NO_PIECE {
            below("after.piece_of", point, u32::from(piece), pieces)?;
        }
    }
    for (index, offset) in after.piece_offsets.iter().enumerate() {
        for &x in offset {
            within("after.piece_offsets", index, x, -limits::POSITION, limits::POSITION)?;
        }
    }
    let modes = after.mode_count();
    count("after.mode_scales", modes, 0, limits::MODES)?;
    for (m, &scale) in after.mode_scales.iter().enumerate() {
        positive("after.mode_scales", m, scale, limits::POSITION)?;
    }
    same_count("after.mix", after.mix.len(), modes * component_count)?;
    for (index, &share) in after.mix.iter().enumerate() {
        within("after.mix", index, share, -limits::NETWORK_VALUE, limits::NETWORK_VALUE)?;
    }
    same_count("after.modes", after.modes.len(), modes * point_count)
}

/// Nothing is known, or a mean and a positive variance of every weight, and factors of all.
fn prior(prior: &Prior<'_>, component_count: usize) -> Result<(), OpenError> {
    let known = if prior.mean.is_empty() { 0 } else { component_count };
    same_count("prior.mean", prior.mean.len(), known)?;
    same_count("prior.variances", prior.variances.len(), known)?;
    let factors = prior.factors.len() / component_count;
    count(
        "prior.factors",
        factors,
        0,
        if known == 0 { 0 } else { limits::PRIOR_FACTORS },
    )?;
    same_count("prior.factors", prior.factors.len(), factors * component_count)?;
    let greatest = limits::CONTROL;
    for (k, &mean) in prior.mean.iter().enumerate() {
        within("prior.mean", k, mean, -greatest, greatest)?;
    }
    for (index, &factor) in prior.factors.iter().enumerate() {
        within("prior.factors", index, factor, -greatest, greatest)?;
    }
    for (k, &variance) in prior.variances.iter().enumerate() {
        positive("prior.variances", k, variance, greatest * greatest)?;
    }
    let strongest = if known == 0 { 0.0 } else { limits::QUALITY };
    within("prior.strength", 0, prior.strength, 0.0, strongest)
}

/// What the tree needs to know of a block.
struct BlockLinks {
    level: u32,
    parent_component: u32,
    first_component: u32,
    component_count: u32,
}

/// One root, first; every other block hangs on a component of the previous level that comes before its own; no two on
/// the same one, in the order of those components; components contiguous in block order and agreeing about it.
fn tree(
    block_count: usize,
    block: impl Fn(usize) -> BlockLinks,
    component_count: usize,
    block_of_component: impl Fn(usize) -> u32,
) -> Result<(), OpenError> {
    count("blocks", block_count, 1, limits::BLOCKS)?;
    count("components", component_count, 1, limits::COMPONENTS)?;
    let mut next_component = 0;
    let mut previous_parent = NONE;
    for b in 0..block_count {
        let BlockLinks {
            level,
            parent_component,
            first_component,
            component_count: own,
        } = block(b);
        if first_component as usize != next_component {
            return Err(OpenError::NotContiguous {
                field: "blocks.first_component",
                index: b,
            });
        }
        if own as usize > component_count - next_component {
            return Err(OpenError::CountMismatch {
                field: "components",
                expected: next_component as u64 + u64::from(own),
                actual: component_count as u64,
            });
        }
        if b == 0 {
            if level != 0 || parent_component != NONE {
                return Err(OpenError::ParentAfterChild { block: 0 });
            }
        } else {
            // Earlier components were proved to name their block, so the parent's block is one before this.
            let hangs = (parent_component as usize) < next_component
                && level.checked_sub(1) == Some(block(block_of_component(parent_component as usize) as usize).level);
            if !hangs {
                return Err(OpenError::ParentAfterChild { block: b });
            }
            if b > 1 && parent_component <= previous_parent {
                return Err(OpenError::NotAscending {
                    field: "blocks.parent_component",
                    index: b,
                });
            }
            previous_parent = parent_component;
        }
        for k in next_component..next_component + own as usize {
            if block_of_component(k) as usize != b {
                return Err(OpenError::NotContiguous {
                    field: "components.block",
                    index: k,
                });
            }
        }
        next_component += own as usize;
    }
    same_count("components", component_count, next_component)
}

/// Text of at most `limit` bytes; `index` counts the elements of the field.
fn title(field: &'static str, index: usize, text: &str, limit: usize) -> Result<(), OpenError> {
    if text.is_empty() || text.len() > limit || text.chars().any(char::is_control) {
        return Err(OpenError::NameInvalid { field, index });
    }
    Ok(())
}

/// Valid names, and no two the same.
fn names<'a>(component_count: usize, name: impl Fn(usize) -> &'a str) -> Result<(), OpenError> {
    for second in 0..component_count {
        title("components.name", second, name(second), limits::NAME_BYTES)?;
        if let Some(first) = (0..second).find(|&first| name(first) == name(second)) {
            return Err(OpenError::NameDuplicate { first, second });
        }
    }
    Ok(())
}

/// Both scales of a component are positive.
fn value_scales(component: usize, scales: super::ValueScales) -> Result<(), OpenError> {
    for scale in [scales.rotation, scales.stretch] {
        positive("components.value_scales", component, scale, limits::VALUE_SCALE)?;
    }
    Ok(())
}

/// The stops of a control are in range, and zero lies between them.
fn control(component: usize, minimum: f32, maximum: f32) -> Result<(), OpenError> {
    within(
        "components.minimum",
        component,
        minimum,
        -limits::CONTROL,
        limits::CONTROL,
    )?;
    within(
        "components.maximum",
        component,
        maximum,
        -limits::CONTROL,
        limits::CONTROL,
    )?;
    if minimum <= 0.0 && 0.0 <= maximum {
        Ok(())
    } else {
        Err(OpenError::RangeWithoutZero { component })
    }
}
