//! Nodes: what is decoded. The components at a node are averages over its cell.

use sinew_formats::package::{FEATURE_COUNT, Patches, nearest};

use super::cells::Cells;
use super::{Source, Vector};
use crate::fold::FoldedComponent;
use crate::slots::{SlotOrder, nearby};

/// N nodes in their slots, as the frame decodes them.
#[derive(Debug, Clone)]
pub(super) struct Nodes {
    pub(super) patches: Patches,
    /// Middles of the cells. Shape: `[N]`, slots of the nodes.
    pub(super) centres: Vec<Vector>,
}

impl Nodes {
    /// Averages the components over the cells, in the whole numbers of the exact tier, whose scales they share.
    pub(super) fn average(source: &Source<'_>, cells: &Cells) -> Self {
        let mut cell_of = vec![0; source.exact.node_count()];
        for (cell, members) in cells.members.iter().enumerate() {
            members.iter().for_each(|&v| cell_of[v] = cell);
        }
        let area_of = |members: &Vec<usize>| members.iter().map(|&v| cells.areas[v]).sum::<f64>();
        let areas: Vec<f64> = cells.members.iter().map(area_of).collect();
        let averaged = |component: &FoldedComponent| {
            let mut sums = vec![[0.0_f64; FEATURE_COUNT]; areas.len()];
            for (&solver, values) in component.solver_indices.iter().zip(&component.values) {
                let slot = source.exact.order.slot_from_solver[solver as usize] as usize;
                let v = source.exact.node_from_slot[slot] as usize;
                let share = cells.areas[v] / areas[cell_of[v]];
                for (sum, &value) in sums[cell_of[v]].iter_mut().zip(values) {
                    *sum += share * f64::from(value);
                }
            }
            let whole: Vec<[i16; FEATURE_COUNT]> = sums.iter().map(|sum| sum.map(nearest)).collect();
            let kept = (0..areas.len()).filter(|&cell| whole[cell] != [0; FEATURE_COUNT]);
            let solver_indices: Vec<u32> = kept.map(|cell| cell as u32).collect();
            FoldedComponent {
                values: solver_indices.iter().map(|&cell| whole[cell as usize]).collect(),
                solver_indices,
                value_scales: component.value_scales,
            }
        };
        // Nothing is solved here: the cells' own numbers stand where the exact tier has its solver's.
        let components: Vec<FoldedComponent> = source.components.iter().map(averaged).collect();
        let places: Vec<[f32; 3]> = cells.centres.iter().map(super::narrowed).collect();
        let order = SlotOrder::new(&components, &nearby(&places), &vec![0; places.len()]);
        Self {
            patches: order.patches(&components, source.block_of_component),
            centres: order
                .solver_from_slot
                .iter()
                .map(|&cell| cells.centres[cell as usize])
                .collect(),
        }
    }
}
