//! Rules of the baked payload: what the frame path relies on without looking.

use super::{
    super::{BakedView, OpenError, limits},
    BlockLinks, ascending_below, below, control, count, finite_halves, mesh, names, offsets, positive, same_count,
    tree, within,
};

/// Proves every promise that [`super::super::BakedBasis`] makes.
pub(in super::super) fn check(view: &BakedView<'_>) -> Result<(), OpenError> {
    let vertex_count = mesh(view.rest_positions(), view.faces())?;
    permutation(view, vertex_count)?;
    rings(view, vertex_count)?;
    factor(view, vertex_count)?;
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
    block_supports(view, vertex_count)?;
    components(view)
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

fn rings(view: &BakedView<'_>, vertex_count: usize) -> Result<(), OpenError> {
    let (ring, weights) = (view.ring(), view.ring_weights());
    count("ring", ring.len(), 0, limits::RING_ENTRIES)?;
    same_count("ring_weights", weights.len(), ring.len())?;
    offsets("ring_offsets", view.ring_offsets(), vertex_count, ring.len())?;
    let row = |v: usize| view.ring_offsets()[v] as usize..view.ring_offsets()[v + 1] as usize;
    for v in 0..vertex_count {
        ascending_below("ring", row(v).start, &ring[row(v)], vertex_count)?;
    }
    for v in 0..vertex_count {
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

fn factor(view: &BakedView<'_>, vertex_count: usize) -> Result<(), OpenError> {
    let (rows, values) = (view.factor_rows(), view.factor_values());
    count("factor_rows", rows.len(), 0, limits::FACTOR_ENTRIES)?;
    same_count("factor_values", values.len(), rows.len())?;
    offsets("factor_offsets", view.factor_offsets(), vertex_count, rows.len())?;
    for (column, range) in view.factor_offsets().windows(2).enumerate() {
        let start = range[0] as usize;
        let entries = &rows[start..range[1] as usize];
        ascending_below("factor_rows", start, entries, vertex_count)?;
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
    same_count("inverse_pivots", view.inverse_pivots().len(), vertex_count)?;
    for (column, &pivot) in view.inverse_pivots().iter().enumerate() {
        positive("inverse_pivots", column, pivot, limits::INVERSE_PIVOT).map_err(|error| match error {
            OpenError::NotPositive { index, .. } => OpenError::PivotNotPositive { index },
            other => other,
        })?;
    }
    Ok(())
}

fn block_supports(view: &BakedView<'_>, vertex_count: usize) -> Result<(), OpenError> {
    let support = view.support();
    count("support", support.len(), 0, limits::ENTRIES)?;
    let mut next = 0;
    for (b, block) in view.blocks().enumerate() {
        for value in block.bias {
            within("blocks.bias", b, value, -limits::NETWORK_VALUE, limits::NETWORK_VALUE)?;
        }
        if block.first_support as usize != next {
            return Err(OpenError::NotContiguous {
                field: "blocks.first_support",
                index: b,
            });
        }
        let Some(own) = support[next..].get(..block.support_count as usize) else {
            return Err(too_short("support", next, block.support_count, support.len()));
        };
        ascending_below("support", next, own, vertex_count)?;
        next += own.len();
    }
    same_count("support", support.len(), next)
}

fn components(view: &BakedView<'_>) -> Result<(), OpenError> {
    let (slots, values) = (view.entry_slots(), view.entry_values());
    count("entry_slots", slots.len(), 0, limits::ENTRIES)?;
    same_count("entry_values", values.len(), slots.len())?;
    let mut next = 0;
    for (k, component) in view.components().enumerate() {
        control(k, component.minimum, component.maximum)?;
        positive("components.value_scale", k, component.value_scale, limits::VALUE_SCALE)?;
        if component.first_entry as usize != next {
            return Err(OpenError::NotContiguous {
                field: "components.first_entry",
                index: k,
            });
        }
        let Some(own) = slots[next..].get(..component.entry_count as usize) else {
            return Err(too_short("entry_slots", next, component.entry_count, slots.len()));
        };
        let support_count = view.block(component.block as usize).support_count as usize;
        ascending_below("entry_slots", next, own, support_count)?;
        next += own.len();
    }
    same_count("entry_slots", slots.len(), next)?;
    finite_halves("entry_values", values)
}

fn too_short(field: &'static str, start: usize, more: u32, actual: usize) -> OpenError {
    OpenError::CountMismatch {
        field,
        expected: start as u64 + u64::from(more),
        actual: actual as u64,
    }
}
