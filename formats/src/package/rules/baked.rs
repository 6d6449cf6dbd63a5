//! Rules of the baked payload: what the frame path relies on without looking. Both tiers obey the same rules, and their
//! errors bear the same names.

use super::{
    super::{
        BakedView, FAN_VERTICES, FastView, GROUP_NODES, OpenError, SKIN_WEIGHT_SUM, TILE_ENTRIES, TILE_SIDE, TierView,
        limits, render,
    },
    BlockLinks, ascending_below, below, control, count, faces, finite_halves, names, offsets, positions, positive,
    same_count, tree, within,
};

/// Proves every promise that [`super::super::BakedBasis`] makes.
pub(in super::super) fn check(view: &BakedView<'_>) -> Result<(), OpenError> {
    let vertex_count = positions(view.exact().rest_positions(), 3)?;
    faces(view.faces().len(), view.faces().iter().copied(), vertex_count)?;
    permutation(
        ["lane_from_vertex", "vertex_from_lane"],
        [view.lane_from_vertex(), view.vertex_from_lane()],
        vertex_count,
    )?;
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
    tree(view.block_count(), links, view.component_count(), |k| {
        view.component(k).block
    })?;
    names(view.component_count(), |k| view.component(k).name)?;
    for (b, block) in view.blocks().enumerate() {
        for value in block.bias {
            within("blocks.bias", b, value, -limits::NETWORK_VALUE, limits::NETWORK_VALUE)?;
        }
    }
    for (k, component) in view.components().enumerate() {
        control(k, component.minimum, component.maximum)?;
        positive("components.value_scale", k, component.value_scale, limits::VALUE_SCALE)?;
    }
    tier(view, &view.exact(), 0.0)?;
    if let Some(fast) = view.fast() {
        fast_tier(view, &fast, vertex_count)?;
    }
    render::check(
        &view.render_mesh(),
        view.faces().len(),
        view.faces().iter().copied(),
        vertex_count,
    )
}

fn fast_tier(view: &BakedView<'_>, fast: &FastView<'_>, vertex_count: usize) -> Result<(), OpenError> {
    let nodes = fast.nodes();
    let node_count = positions(nodes.rest_positions(), 1)?;
    count("rest_positions", node_count, 1, vertex_count.min(limits::FAST_NODES))?;
    // A weight between two nodes is what is left of the mesh's, and may have either sign.
    tier(view, &nodes, -limits::EDGE_WEIGHT)?;
    for coordinate in fast.centre() {
        within("fast.centre", 0, coordinate, -limits::POSITION, limits::POSITION)?;
    }
    skin(fast, vertex_count, node_count)?;
    let error = fast.error();
    let figures = [
        ("fast.error.mixed_rms", error.mixed_rms),
        ("fast.error.mixed_p99", error.mixed_p99),
        ("fast.error.mixed_max", error.mixed_max),
        ("fast.error.single_rms", error.single_rms),
        ("fast.error.single_max", error.single_max),
        ("fast.error.normal_rms", error.normal_rms),
    ];
    for (field, figure) in figures {
        within(field, 0, figure, 0.0, limits::QUALITY)?;
    }
    Ok(())
}

fn skin(fast: &FastView<'_>, vertex_count: usize, node_count: usize) -> Result<(), OpenError> {
    let (nodes, weights) = (fast.skin_nodes(), fast.skin_weights());
    same_count("skin_nodes", nodes.len(), vertex_count)?;
    same_count("skin_weights", weights.len(), vertex_count)?;
    for (lane, (row, weights)) in nodes.iter().zip(weights).enumerate() {
        for &node in row {
            below("skin_nodes", lane, u32::from(node), node_count)?;
        }
        let sum = weights.iter().map(|&weight| u32::from(weight)).sum();
        if sum != SKIN_WEIGHT_SUM {
            return Err(OpenError::SkinWeightSum { lane, sum });
        }
    }
    Ok(())
}

/// Both lists have `count` indices < `count` and the second undoes the first, so both are permutations.
fn permutation(fields: [&'static str; 2], lists: [&[u32]; 2], count: usize) -> Result<(), OpenError> {
    same_count(fields[0], lists[0].len(), count)?;
    same_count(fields[1], lists[1].len(), count)?;
    for (index, &image) in lists[0].iter().enumerate() {
        below(fields[0], index, image, count)?;
        if lists[1][image as usize] as usize != index {
            return Err(OpenError::NotAPermutation {
                field: fields[0],
                index,
            });
        }
    }
    Ok(())
}

/// A tier whose positions are proved.
fn tier(view: &BakedView<'_>, tier: &TierView<'_>, least_weight: f32) -> Result<(), OpenError> {
    rings(tier, least_weight)?;
    factor(tier)?;
    lanes(tier)?;
    patches(view, tier)
}

fn rings(tier: &TierView<'_>, least_weight: f32) -> Result<(), OpenError> {
    let node_count = tier.node_count();
    let (ring, weights) = (tier.ring(), tier.ring_weights());
    count("ring", ring.len(), 0, limits::RING_ENTRIES)?;
    same_count("ring_weights", weights.len(), ring.len())?;
    offsets("ring_offsets", tier.ring_offsets(), node_count, ring.len())?;
    let row = |v: usize| tier.ring_offsets()[v] as usize..tier.ring_offsets()[v + 1] as usize;
    for v in 0..node_count {
        ascending_below("ring", row(v).start, &ring[row(v)], node_count)?;
    }
    for v in 0..node_count {
        for entry in row(v) {
            within("ring_weights", entry, weights[entry], least_weight, limits::EDGE_WEIGHT)?;
            let other = row(ring[entry] as usize);
            let back = ring[other.clone()]
                .binary_search(&(v as u32))
                .map(|place| other.start + place);
            // An edge to itself would be its own way back.
            let symmetric = back.is_ok_and(|back| back != entry && weights[back] == weights[entry]);
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

fn factor(tier: &TierView<'_>) -> Result<(), OpenError> {
    let column_count = tier.tile_column_count();
    let (rows, tiles, inverse_diagonals) = (tier.tile_rows(), tier.tiles(), tier.inverse_diagonals());
    count("tile_rows", rows.len(), 0, limits::TILES)?;
    same_count("tiles", tiles.len(), rows.len())?;
    offsets("tile_offsets", tier.tile_offsets(), column_count, rows.len())?;
    for (column, range) in tier.tile_offsets().windows(2).enumerate() {
        let start = range[0] as usize;
        let entries = &rows[start..range[1] as usize];
        ascending_below("tile_rows", start, entries, column_count)?;
        if entries.first().is_some_and(|&row| row as usize <= column) {
            return Err(OpenError::NotAscending {
                field: "tile_rows",
                index: start,
            });
        }
    }
    matrices("tiles", tiles, limits::FACTOR_VALUE)?;
    same_count("inverse_diagonals", inverse_diagonals.len(), column_count)?;
    matrices("inverse_diagonals", inverse_diagonals, limits::INVERSE_PIVOT)?;
    for node in 0..tier.node_count() {
        let (column, side) = (node / TILE_SIDE, node % TILE_SIDE);
        if inverse_diagonals[column][(TILE_SIDE + 1) * side] <= 0.0 {
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

fn lanes(tier: &TierView<'_>) -> Result<(), OpenError> {
    permutation(
        ["solver_from_lane", "lane_from_solver"],
        [tier.solver_from_lane(), tier.lane_from_solver()],
        tier.node_count(),
    )
}

fn patches(view: &BakedView<'_>, tier: &TierView<'_>) -> Result<(), OpenError> {
    let (owners, values) = (tier.patch_owners(), tier.patch_values());
    count("patch_owners", owners.len(), 0, limits::PATCHES)?;
    same_count("patch_values", values.len(), owners.len())?;
    let group_count = tier.node_count().div_ceil(GROUP_NODES);
    offsets("patch_offsets", tier.patch_offsets(), group_count, owners.len())?;
    for row in tier.patch_offsets().windows(2) {
        let mut previous = None;
        for index in row[0] as usize..row[1] as usize {
            let [component, block] = owners[index];
            below("patch_owners", index, u32::from(component), view.component_count())?;
            if previous.is_some_and(|previous| component <= previous) {
                return Err(OpenError::NotAscending {
                    field: "patch_owners",
                    index,
                });
            }
            // Components stand in block order, so the blocks ascend too.
            if view.component(component as usize).block != u32::from(block) {
                return Err(OpenError::NotContiguous {
                    field: "patch_owners",
                    index,
                });
            }
            previous = Some(component);
        }
    }
    for (patch, rows) in values.iter().enumerate() {
        finite_halves("patch_values", rows).map_err(|_| OpenError::NotFinite {
            field: "patch_values",
            index: patch,
        })?;
    }
    Ok(())
}

fn fans(view: &BakedView<'_>, vertex_count: usize) -> Result<(), OpenError> {
    let fans = view.fans();
    count("fans", fans.len(), 0, limits::FANS)?;
    offsets(
        "fan_offsets",
        view.fan_offsets(),
        vertex_count.div_ceil(FAN_VERTICES),
        fans.len(),
    )?;
    for (index, lanes) in fans.iter().enumerate() {
        for &lane in lanes {
            below("fans", index, lane, vertex_count)?;
        }
    }
    Ok(())
}
