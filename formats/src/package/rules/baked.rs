//! Rules of the baked payload: what the frame path relies on without looking. Both tiers obey the same rules, and their
//! errors bear the same names.

use super::{
    super::{BakedView, OpenError, TierView, limits, render},
    BlockLinks, ascending_below, below, control, count, faces, finite_halves, names, offsets, positions, positive,
    same_count, tree, within,
};

/// Proves every promise that [`super::super::BakedBasis`] makes.
pub(in super::super) fn check(view: &BakedView<'_>) -> Result<(), OpenError> {
    let vertex_count = positions(view.exact().rest_positions(), 3)?;
    faces(view.faces(), vertex_count)?;
    permutation(view, vertex_count)?;
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
    tier(view, &view.exact())?;
    if let Some(fast) = view.fast() {
        let node_count = positions(fast.rest_positions(), 1)?;
        count("rest_positions", node_count, 1, vertex_count)?;
        tier(view, &fast)?;
    }
    render::check(&view.render_mesh(), view.faces(), vertex_count)
}

/// Both lists have V indices < V and the second undoes the first, so both are permutations.
fn permutation(view: &BakedView<'_>, vertex_count: usize) -> Result<(), OpenError> {
    let (solver_from_vertex, vertex_from_solver) = (view.solver_from_vertex(), view.vertex_from_solver());
    same_count("solver_from_vertex", solver_from_vertex.len(), vertex_count)?;
    same_count("vertex_from_solver", vertex_from_solver.len(), vertex_count)?;
    for (v, &solver) in solver_from_vertex.iter().enumerate() {
        below("solver_from_vertex", v, solver, vertex_count)?;
        if vertex_from_solver[solver as usize] as usize != v {
            return Err(OpenError::NotAPermutation {
                field: "solver_from_vertex",
                index: v,
            });
        }
    }
    Ok(())
}

/// A tier whose positions are proved.
fn tier(view: &BakedView<'_>, tier: &TierView<'_>) -> Result<(), OpenError> {
    rings(tier)?;
    factor(tier)?;
    supports(view, tier)?;
    entries(view, tier)
}

fn rings(tier: &TierView<'_>) -> Result<(), OpenError> {
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
            within("ring_weights", entry, weights[entry], 0.0, limits::EDGE_WEIGHT)?;
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
    let node_count = tier.node_count();
    let (rows, values) = (tier.factor_rows(), tier.factor_values());
    count("factor_rows", rows.len(), 0, limits::FACTOR_ENTRIES)?;
    same_count("factor_values", values.len(), rows.len())?;
    offsets("factor_offsets", tier.factor_offsets(), node_count, rows.len())?;
    for (column, range) in tier.factor_offsets().windows(2).enumerate() {
        let start = range[0] as usize;
        let entries = &rows[start..range[1] as usize];
        ascending_below("factor_rows", start, entries, node_count)?;
        if entries.first().is_some_and(|&row| row as usize <= column) {
            return Err(OpenError::NotAscending {
                field: "factor_rows",
                index: start,
            });
        }
    }
    for (entry, &value) in values.iter().enumerate() {
        within(
            "factor_values",
            entry,
            value,
            -limits::FACTOR_VALUE,
            limits::FACTOR_VALUE,
        )?;
    }
    same_count("inverse_pivots", tier.inverse_pivots().len(), node_count)?;
    for (column, &pivot) in tier.inverse_pivots().iter().enumerate() {
        positive("inverse_pivots", column, pivot, limits::INVERSE_PIVOT).map_err(|error| match error {
            OpenError::NotPositive { index, .. } => OpenError::PivotNotPositive { index },
            other => other,
        })?;
    }
    Ok(())
}

fn supports(view: &BakedView<'_>, tier: &TierView<'_>) -> Result<(), OpenError> {
    let support = tier.support();
    count("support", support.len(), 0, limits::ENTRIES)?;
    offsets(
        "support_offsets",
        tier.support_offsets(),
        view.block_count(),
        support.len(),
    )?;
    for b in 0..view.block_count() {
        let start = tier.support_offsets()[b] as usize;
        ascending_below("support", start, tier.support_of(b), tier.node_count())?;
    }
    Ok(())
}

fn entries(view: &BakedView<'_>, tier: &TierView<'_>) -> Result<(), OpenError> {
    let (slots, values) = (tier.entry_slots(), tier.entry_values());
    count("entry_slots", slots.len(), 0, limits::ENTRIES)?;
    same_count("entry_values", values.len(), slots.len())?;
    offsets(
        "entry_offsets",
        tier.entry_offsets(),
        view.component_count(),
        slots.len(),
    )?;
    for (k, component) in view.components().enumerate() {
        let support_count = tier.support_of(component.block as usize).len();
        let start = tier.entry_offsets()[k] as usize;
        ascending_below("entry_slots", start, tier.entries_of(k).0, support_count)?;
    }
    finite_halves("entry_values", values)
}
