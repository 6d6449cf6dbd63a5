//! Solve: deformation gradients to displacements, and those to positions in slots.

use sinew_formats::package::{GROUP_NODES, Index};

use crate::basis::{Tier, with_index};
use crate::simd::Kernels;
use crate::simd::generic::lanes::Gradient;
use crate::simd::generic::solve::{Factor, Quad, Rings, Xyz0, place};

/// Solves `L d = b(D)`. Shape: `gradients` `[N]`, slots; `displacement` `[T]`, solver order, zero after the last node.
pub(crate) fn solve(kernels: Kernels, tier: &Tier<'_>, gradients: &[Gradient], displacement: &mut [Quad]) {
    right_hand_side(kernels, tier, gradients, displacement);
    substitute(kernels, tier, displacement);
}

/// The whole right-hand side, in the place of the solution.
pub(crate) fn right_hand_side(kernels: Kernels, tier: &Tier<'_>, gradients: &[Gradient], b: &mut [Quad]) {
    if let Some(last) = b.last_mut() {
        *last = Quad::default();
    }
    with_index!(tier.rest.len(), I => {
        let rings = Rings::<I>::of(&tier.solve);
        kernels.right_hand_side(&rings, tier.rest, gradients, 0..tier.rest.len(), b);
    });
}

/// Brings the right-hand side of the pose before to these gradients, where they or those of a neighbour are others: each row is
/// computed as ever, so that it has the bits of the whole. Shape: `touched` `[G]`, groups whose gradients are others; afterwards
/// those whose rows are.
pub(crate) fn update_right_hand_side(
    kernels: Kernels,
    tier: &Tier<'_>,
    gradients: &[Gradient],
    touched: &mut [u8],
    b: &mut [Quad],
) {
    /// A group that has to be computed only because of a neighbour.
    const BESIDE: u8 = 2;
    let count = tier.rest.len();
    with_index!(count, I => {
        let rings = Rings::<I>::of(&tier.solve);
        // Where most is touched, computing all is cheaper than asking.
        if 2 * touched.iter().filter(|touched| **touched != 0).count() > touched.len() {
            touched.fill(1);
            kernels.right_hand_side(&rings, tier.rest, gradients, 0..count, b);
            return;
        }
        for g in 0..touched.len() {
            if touched[g] == 0 || touched[g] == BESIDE {
                continue;
            }
            let (first, end) = (g * GROUP_NODES, count.min((g + 1) * GROUP_NODES));
            let ring = rings.offsets[first] as usize..rings.offsets[end] as usize;
            for &j in &rings.neighbours[ring] {
                let beside = &mut touched[j.at() / GROUP_NODES];
                *beside = if *beside == 0 { BESIDE } else { *beside };
            }
        }
        let mut first = 0;
        for run in touched.chunk_by(|a, b| (*a == 0) == (*b == 0)) {
            let end = first + run.len() * GROUP_NODES;
            if run[0] != 0 {
                kernels.right_hand_side(&rings, tier.rest, gradients, first..end.min(count), b);
            }
            first = end;
        }
    });
}

/// Solves in place.
pub(crate) fn substitute(kernels: Kernels, tier: &Tier<'_>, x: &mut [Quad]) {
    with_index!(tier.rest.len(), I => kernels.substitute(&Factor::<I>::of(&tier.solve), x));
}

/// Rest shape plus displacement. Shape: `displacement` `[T]`, solver order; `posed` `[N]`, slots.
pub(crate) fn displace(tier: &Tier<'_>, displacement: &[Quad], posed: &mut [Xyz0]) {
    with_index!(tier.rest.len(), I => {
        let places = I::of(tier.solve.solver_from_slot);
        for ((r, &solver), posed) in tier.rest.iter().zip(places).zip(posed) {
            let [x, y, z] = place(displacement, solver);
            *posed = [r[0] + x, r[1] + y, r[2] + z, 0.0];
        }
    });
}
