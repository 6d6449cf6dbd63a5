//! The rules a payload obeys beyond being a sound archive. Opening checks them once; writing opens what it wrote, so
//! both sides assert the same. No rule allocates, and none costs more than the size of what it reads, but for the
//! unique names (K squared short comparisons) and the symmetric rings (a search a ring entry).

pub(super) mod baked;
pub(super) mod compact;
#[cfg(all(test, feature = "alloc"))]
mod tests;

use super::{NONE, OpenError, limits};

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

/// Every half is finite: its exponent is not all ones.
fn finite_halves<const N: usize>(field: &'static str, values: &[[u16; N]]) -> Result<(), OpenError> {
    const EXPONENT: u16 = 0x7c00;
    match values
        .iter()
        .position(|halves| halves.iter().any(|half| half & EXPONENT == EXPONENT))
    {
        Some(index) => Err(OpenError::NotFinite { field, index }),
        None => Ok(()),
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

/// Each value is < `limit` and greater than the one before; `start` is where `values` lies in the field.
fn ascending_below(field: &'static str, start: usize, values: &[u32], limit: usize) -> Result<(), OpenError> {
    let mut previous = None;
    for (i, &value) in values.iter().enumerate() {
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

/// At least one triangle, and corners that are vertices.
fn faces(face_count: usize, triangles: impl Iterator<Item = [u32; 3]>, vertex_count: usize) -> Result<(), OpenError> {
    count("faces", face_count, 1, limits::FACES)?;
    for (f, corners) in triangles.enumerate() {
        for vertex in corners {
            below("faces", f, vertex, vertex_count)?;
        }
    }
    Ok(())
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
