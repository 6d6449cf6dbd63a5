//! Rules of the baked payload: what the frame path relies on without looking.

use super::{
    super::{BakedView, FAN_VERTICES, IndexSlice, OpenError, QUAD, SolveView, TILE_ENTRIES, limits},
    BlockLinks, after, ascending_below, bones, control, count, indices, names, offsets,
    patches::patches,
    positions, positive, prior, same_count, surface, tree, value_scales, within,
};

/// Proves every promise that [`super::super::BakedBasis`] makes.
pub(in super::super) fn check(view: &BakedView<'_>) -> Result<(), OpenError> {
    let vertex_count = positions(view.rest_positions(), 3)?;
    let component_count = view.component_count();
    permutation("slot_from_vertex", view.slot_from_vertex(), vertex_count)?;
    inverse(view, vertex_count)?;
    surface(&view.surface(), vertex_count)?;
    render_order(view.surface().render_points)?;
    fans(view, vertex_count)?;
    positive("rotation_scale", 0, view.rotation_scale(), limits::FEATURE_SCALE)?;
    positive("stretch_scale", 0, view.stretch_scale(), limits::FEATURE_SCALE)?;
    let links = |b| {
        let block = view.block(b);
        BlockLinks {
            level: block.level,
            parent_component: block.parent_component,
            first_component: block.first_component,
            component_count: block.component_count,
        }
    };
    tree(view.block_count(), links, component_count, |k| view.component(k).block)?;
    names(component_count, |k| view.component(k).name)?;
    for (b, block) in view.blocks().enumerate() {
        for value in block.bias {
            within("blocks.bias", b, value, -limits::NETWORK_VALUE, limits::NETWORK_VALUE)?;
        }
    }
    for (k, component) in view.components().enumerate() {
        control(k, component.minimum, component.maximum)?;
        value_scales(k, component.value_scales)?;
    }
    if view.exact().is_none() && view.bones().is_none() {
        return Err(OpenError::NoTier);
    }
    if let Some(exact) = view.exact() {
        patches(view, &exact.patches, vertex_count)?;
        solve(&exact.solve, vertex_count)?;
    }
    if let Some(bones) = view.bones() {
        bones::check(view, &bones)?;
    }
    after(&view.after(), component_count, vertex_count)?;
    prior(&view.prior(), component_count)
}

/// `count` indices below `count`. That no two are the same shows from an inverse, or from [`distinct`].
fn permutation(field: &'static str, list: IndexSlice<'_>, count: usize) -> Result<(), OpenError> {
    same_count(field, list.len(), count)?;
    indices(field, list, 1, count)
}

/// The second order undoes the first, so both are permutations.
fn inverse(view: &BakedView<'_>, vertex_count: usize) -> Result<(), OpenError> {
    let (slots, vertices) = (view.slot_from_vertex(), view.vertex_from_slot());
    permutation("vertex_from_slot", vertices, vertex_count)?;
    match slots
        .iter()
        .enumerate()
        .find(|&(v, slot)| vertices.at(slot as usize) as usize != v)
    {
        Some((index, _)) => Err(OpenError::NotAPermutation {
            field: "slot_from_vertex",
            index,
        }),
        None => Ok(()),
    }
}

/// Render vertices stand in the order of their slots, so that writing them walks through memory.
fn render_order(render_points: IndexSlice<'_>) -> Result<(), OpenError> {
    let pairs = render_points.iter().zip(render_points.iter().skip(1));
    match pairs.enumerate().find(|(_, (slot, next))| next < slot) {
        Some((r, _)) => Err(OpenError::NotAscending {
            field: "render_points",
            index: r + 1,
        }),
        None => Ok(()),
    }
}

fn solve(solve: &SolveView<'_>, node_count: usize) -> Result<(), OpenError> {
    rings(solve, node_count)?;
    factor(solve, node_count)?;
    distinct(solve, node_count)
}

fn rings(solve: &SolveView<'_>, node_count: usize) -> Result<(), OpenError> {
    let (ring, weights) = (solve.ring, solve.ring_weights);
    count("ring", ring.len(), 0, limits::RING_ENTRIES)?;
    same_count("ring_weights", weights.len(), ring.len())?;
    offsets("ring_offsets", solve.ring_offsets, node_count, ring.len())?;
    let row = |v: usize| solve.ring_offsets[v] as usize..solve.ring_offsets[v + 1] as usize;
    for v in 0..node_count {
        ascending_below("ring", row(v).start, row(v).map(|entry| ring.at(entry)), node_count)?;
    }
    indices("ring", ring, 1, node_count)?;
    for v in 0..node_count {
        for entry in row(v) {
            within("ring_weights", entry, weights[entry], 0.0, limits::EDGE_WEIGHT)?;
            let back = search(ring, row(ring.at(entry) as usize), v as u32);
            // An edge to itself would be its own way back.
            let symmetric = back.is_some_and(|back| back != entry && weights[back] == weights[entry]);
            if !symmetric {
                return Err(OpenError::NotSymmetric {
                    field: "ring",
                    index: entry,
                });
            }
        }
    }
    Ok(())
}

/// Where `value` stands in an ascending row.
fn search(slice: IndexSlice<'_>, row: core::ops::Range<usize>, value: u32) -> Option<usize> {
    let place = match slice {
        IndexSlice::Short(values) => values[row.clone()].binary_search(&u16::try_from(value).ok()?),
        IndexSlice::Wide(values) => values[row.clone()].binary_search(&value),
    };
    place.ok().map(|place| row.start + place)
}

fn factor(solve: &SolveView<'_>, node_count: usize) -> Result<(), OpenError> {
    let column_count = node_count.div_ceil(QUAD);
    let (rows, tiles, inverse_diagonals) = (solve.tile_rows, solve.tiles, solve.inverse_diagonals);
    count("tile_rows", rows.len(), 0, limits::TILES)?;
    same_count("tiles", tiles.len(), rows.len())?;
    offsets("tile_offsets", solve.tile_offsets, column_count, rows.len())?;
    for (column, range) in solve.tile_offsets.windows(2).enumerate() {
        let (start, end) = (range[0] as usize, range[1] as usize);
        ascending_below("tile_rows", start, (start..end).map(|t| rows.at(t)), column_count)?;
        if start < end && rows.at(start) as usize <= column {
            return Err(OpenError::NotAscending {
                field: "tile_rows",
                index: start,
            });
        }
    }
    // As wide as the nodes' own indices: one width for the whole tier.
    indices("tile_rows", rows, 1, node_count)?;
    matrices("tiles", tiles, limits::FACTOR_VALUE)?;
    same_count("inverse_diagonals", inverse_diagonals.len(), column_count)?;
    matrices("inverse_diagonals", inverse_diagonals, limits::INVERSE_PIVOT)?;
    for node in 0..node_count {
        if inverse_diagonals[node / QUAD][(QUAD + 1) * (node % QUAD)] <= 0.0 {
            return Err(OpenError::PivotNotPositive { index: node });
        }
    }
    Ok(())
}

/// Every entry is finite and at most `greatest` either way.
fn matrices(field: &'static str, values: &[[f32; TILE_ENTRIES]], greatest: f32) -> Result<(), OpenError> {
    for (index, tile) in values.iter().enumerate() {
        // One comparison an entry, false for what is not a number; the slow way only says which fault it was.
        if !tile.iter().fold(true, |sound, value| sound & (value.abs() <= greatest)) {
            for &value in tile {
                within(field, index, value, -greatest, greatest)?;
            }
        }
    }
    Ok(())
}

/// Places whose marks fit on the stack at a time.
const MARKED: usize = 16 * 1024;

/// Every slot has a solver place of its own. Without an inverse to ask and without a heap the places are marked, some
/// thousand at a time: one pass for a character, 256 for the largest mesh that the format holds.
fn distinct(solve: &SolveView<'_>, node_count: usize) -> Result<(), OpenError> {
    let field = "solver_from_slot";
    permutation(field, solve.solver_from_slot, node_count)?;
    for first in (0..node_count).step_by(MARKED) {
        let mut marks = [0_u32; MARKED / 32];
        for (index, place) in solve.solver_from_slot.iter().enumerate() {
            let place = (place as usize).wrapping_sub(first);
            if place < MARKED {
                let (word, bit) = (&mut marks[place / 32], 1 << (place % 32));
                if *word & bit != 0 {
                    return Err(OpenError::NotAPermutation { field, index });
                }
                *word |= bit;
            }
        }
    }
    Ok(())
}

fn fans(view: &BakedView<'_>, vertex_count: usize) -> Result<(), OpenError> {
    let (fans, step_count) = (view.fans(), view.fans().len() / FAN_VERTICES);
    count("fans", step_count, 0, limits::FANS)?;
    same_count("fans", fans.len(), FAN_VERTICES * step_count)?;
    offsets(
        "fan_offsets",
        view.fan_offsets(),
        vertex_count.div_ceil(FAN_VERTICES),
        step_count,
    )?;
    indices("fans", fans, FAN_VERTICES, vertex_count)
}
