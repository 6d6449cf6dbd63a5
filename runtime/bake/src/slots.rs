//! The order in which a frame decodes: nodes in groups of sixteen that the same components move, and each component's
//! values in patches, one a group that it touches.
//!
//! A patch is whole, with zeros where the component does not reach, so the frame needs no index inside it; the order keeps
//! the zeros few. It splits the nodes by one component after another, most even splits first, in the reflected order of a
//! Gray code, and then lets each group pick its members from a window of that order.

use std::collections::VecDeque;

use sinew_formats::package::{GROUP_NODES, Patches};

use crate::fold::FoldedComponent;

/// Nodes that a group chooses its members from.
const WINDOW: usize = 96;

/// The order of decoding: N nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct SlotOrder {
    /// Solver place of each slot; a group is sixteen slots, the last one may be short. Shape: `[N]`.
    pub solver_from_slot: Vec<u32>,
    /// Its inverse.
    pub slot_from_solver: Vec<u32>,
}

impl SlotOrder {
    /// Orders. Shapes: `nearby` `[N]`, solver places so that neighbours stand near each other; `degrees` `[N]`, solver
    /// order: nodes of a group stand by falling degree, so that fans side by side are of like length.
    pub fn new(components: &[FoldedComponent], nearby: &[u32], degrees: &[usize]) -> Self {
        let members = Members::new(components, nearby.len());
        let mut solver_from_slot = members.pack(members.split(nearby.to_vec(), false));
        for group in solver_from_slot.chunks_mut(GROUP_NODES) {
            group.sort_by_key(|&solver| core::cmp::Reverse(degrees[solver as usize]));
        }
        let mut slot_from_solver = vec![0; solver_from_slot.len()];
        for (slot, &solver) in solver_from_slot.iter().enumerate() {
            slot_from_solver[solver as usize] = slot as u32;
        }
        Self {
            solver_from_slot,
            slot_from_solver,
        }
    }

    /// The components' patches in this order. `block_of_component` `[K]`.
    pub fn patches(&self, components: &[FoldedComponent], block_of_component: &[u32]) -> Patches {
        let entries = components.iter().enumerate().flat_map(|(k, component)| {
            let pairs = component.solver_indices.iter().zip(&component.values);
            pairs.map(move |(&solver, &values)| {
                let slot = self.slot_from_solver[solver as usize];
                (k, block_of_component[k], slot, values)
            })
        });
        Patches::gather(self.solver_from_slot.len(), entries)
    }
}

/// Solver places along a space-filling curve (Morton's) through the bounding box. Shape: `[N]`.
pub fn nearby(rest_positions: &[[f32; 3]]) -> Vec<u32> {
    /// Digits of each coordinate; three of them fill 63 bits.
    const DIGITS: u32 = 21;
    let [least, greatest] = [f32::min, f32::max].map(|bound| {
        let first = rest_positions.first().copied().unwrap_or_default();
        rest_positions
            .iter()
            .fold(first, |sum, p| core::array::from_fn(|c| bound(sum[c], p[c])))
    });
    let extent = (0..3)
        .map(|c| f64::from(greatest[c]) - f64::from(least[c]))
        .fold(0.0, f64::max);
    let cell = |x: f32, least: f32| {
        let share = (f64::from(x) - f64::from(least)) / extent.max(f64::MIN_POSITIVE);
        (share * f64::from((1_u32 << DIGITS) - 1)) as u64
    };
    let code = |p: &[f32; 3]| {
        (0..DIGITS).fold(0_u64, |code, digit| {
            (0..3).fold(code, |code, c| {
                code | (cell(p[c], least[c]) >> digit & 1) << (3 * digit + c as u32)
            })
        })
    };
    let codes: Vec<u64> = rest_positions.iter().map(code).collect();
    let mut order: Vec<u32> = (0..rest_positions.len() as u32).collect();
    order.sort_by_key(|&solver| codes[solver as usize]);
    order
}

/// Which components move each node, as sorted lists and as bits.
struct Members {
    lists: Vec<Vec<u16>>,
    bits: Vec<u64>,
    words: usize,
}

impl Members {
    fn new(components: &[FoldedComponent], node_count: usize) -> Self {
        let words = components.len().div_ceil(64);
        let mut members = Self {
            lists: vec![Vec::new(); node_count],
            bits: vec![0; node_count * words],
            words,
        };
        for (k, component) in components.iter().enumerate() {
            for &solver in &component.solver_indices {
                members.lists[solver as usize].push(k as u16);
                members.bits[solver as usize * words + k / 64] |= 1 << (k % 64);
            }
        }
        members
    }

    fn bits_of(&self, solver: u32) -> &[u64] {
        &self.bits[solver as usize * self.words..][..self.words]
    }

    /// Reorders so that each component becomes few runs; nodes of the same components keep their order.
    fn split(&self, nodes: Vec<u32>, reflected: bool) -> Vec<u32> {
        let mut counts = vec![0_usize; 64 * self.words];
        for &solver in &nodes {
            for &k in &self.lists[solver as usize] {
                counts[k as usize] += 1;
            }
        }
        let evenness = |count: usize| count.min(nodes.len() - count);
        let most_even = (0..counts.len()).max_by_key(|&k| (evenness(counts[k]), usize::MAX - k));
        let Some(k) = most_even.filter(|&k| evenness(counts[k]) > 0) else {
            return nodes;
        };
        let (inside, outside): (Vec<u32>, Vec<u32>) = nodes
            .into_iter()
            .partition(|&solver| self.bits_of(solver)[k / 64] >> (k % 64) & 1 == 1);
        let (first, second) = if reflected {
            (inside, outside)
        } else {
            (outside, inside)
        };
        let mut order = self.split(first, false);
        order.extend(self.split(second, true));
        order
    }

    /// Group by group takes the node that adds the fewest components and lacks the fewest.
    fn pack(&self, order: Vec<u32>) -> Vec<u32> {
        let mut remaining = VecDeque::from(order);
        let mut packed = Vec::with_capacity(remaining.len());
        let mut union = vec![0_u64; self.words];
        while !remaining.is_empty() {
            if packed.len() % GROUP_NODES == 0 {
                union.fill(0);
            }
            let first_of_group = packed.len() % GROUP_NODES == 0;
            let costs = remaining
                .iter()
                .take(if first_of_group { 1 } else { WINDOW })
                .map(|&solver| {
                    let pairs = self.bits_of(solver).iter().zip(&union);
                    pairs.fold((0, 0), |(added, lacking), (own, all)| {
                        (added + (own & !all).count_ones(), lacking + (all & !own).count_ones())
                    })
                });
            let best = costs.enumerate().min_by_key(|&(_, cost)| cost).map_or(0, |(n, _)| n);
            let solver = remaining.remove(best).expect("the window is not empty");
            for (all, own) in union.iter_mut().zip(self.bits_of(solver)) {
                *all |= own;
            }
            packed.push(solver);
        }
        packed
    }
}
