//! The skin: the scalar kernel against its definition in f64, the others against the scalar one.

use std::vec;
use std::vec::Vec;

use sinew_formats::package::SKIN_WEIGHT_SUM;

use crate::fast::skin;
use crate::simd::Kernels;
use crate::simd::lanes::Gradient;
use crate::simd::scalar::naive::{Noise, largest_difference};
use crate::simd::scalar::poisson::Lane;
use crate::simd::scalar::skin::{Map, Skin, Skinned, maps};
use crate::simd::scalar::surface::Bounds;

/// Roundings of a dozen products near one.
const TOLERANCE: f64 = 4e-6;
/// Rounding of a position a thousand away: one unit in the last place.
const FAR_TOLERANCE: f64 = 1.3e-4;

const NODES: usize = 7;

struct Case {
    rest: Vec<[f32; 3]>,
    centre: [f32; 3],
    nodes: Vec<[u16; 4]>,
    weights: Vec<[u16; 4]>,
    node_rest: Vec<[f32; 3]>,
    gradients: Vec<Gradient>,
    displacement: Vec<Lane>,
    vertex_from_lane: Vec<u32>,
}

impl Case {
    fn new(vertex_count: usize, far: f32) -> Self {
        let mut noise = Noise::new(11);
        let centre = [far, -far, 0.5 * far];
        let near = |noise: &mut Noise| core::array::from_fn(|c| centre[c] + noise.next());
        let with_zero = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        let unit = |noise: &mut Noise| 0.5 + 0.5 * noise.next();
        Self {
            rest: (0..vertex_count).map(|_| near(&mut noise)).collect(),
            node_rest: (0..NODES).map(|_| near(&mut noise)).collect(),
            nodes: (0..vertex_count)
                .map(|_| core::array::from_fn(|_| (unit(&mut noise) * NODES as f32) as u16 % NODES as u16))
                .collect(),
            weights: (0..vertex_count)
                .map(|v| {
                    let mut left = SKIN_WEIGHT_SUM as f32;
                    let first = [0; 3].map(|_| {
                        let own = if v % 3 == 0 {
                            0.0
                        } else {
                            (left * unit(&mut noise)).floor()
                        };
                        left -= own;
                        own as u16
                    });
                    [first[0], first[1], first[2], left as u16]
                })
                .collect(),
            gradients: (0..NODES)
                .map(|_| core::array::from_fn(|_| with_zero(noise.point())))
                .collect(),
            // As after a solve: padded to whole blocks.
            displacement: (0..NODES + 1).map(|_| with_zero(noise.point())).collect(),
            // Turned over.
            vertex_from_lane: (0..vertex_count as u32).rev().collect(),
            centre,
        }
    }

    fn skin(&self) -> Skin<'_> {
        Skin {
            rest: &self.rest,
            centre: self.centre,
            nodes: &self.nodes,
            weights: &self.weights,
            vertex_from_lane: &self.vertex_from_lane,
        }
    }

    fn maps(&self) -> Vec<Map> {
        let mut found = vec![[[9.0; 4]; 4]; NODES];
        maps(
            &self.node_rest,
            &self.centre,
            &self.gradients,
            &self.displacement,
            &self.solver_from_lane(),
            &mut found,
        );
        found
    }

    fn solver_from_lane(&self) -> [u32; NODES] {
        core::array::from_fn(|lane| (3 * lane as u32 + 2) % NODES as u32)
    }

    /// Box and posed lanes, once the positions were found to be the same in source order.
    fn play(&self, kernels: Kernels, maps: &[Map]) -> (Option<Bounds>, Vec<[f32; 3]>) {
        let mut posed = vec![[9.0; 4]; self.rest.len()];
        let mut positions = vec![[9.0; 3]; self.rest.len()];
        let skinned = Skinned {
            posed: &mut posed,
            positions: &mut positions,
        };
        let bounds = skin(kernels, &self.skin(), maps, skinned);
        let posed: Vec<[f32; 3]> = posed
            .into_iter()
            .map(|[x, y, z, filled]| {
                assert!(filled == 0.0 || bounds.is_none());
                [x, y, z]
            })
            .collect();
        let turned: Vec<[f32; 3]> = posed.iter().rev().copied().collect();
        assert!(turned == positions || bounds.is_none());
        (bounds, posed)
    }

    /// `r + sum w (d + D (r - r_n))`.
    fn expected(&self) -> Vec<[f64; 3]> {
        let rows = self.nodes.iter().zip(&self.weights).zip(&self.rest);
        let order = self.solver_from_lane();
        rows.map(|((nodes, weights), r)| {
            core::array::from_fn(|c| {
                let moved = nodes.iter().zip(weights).map(|(&n, &weight)| {
                    let n = usize::from(n);
                    let arm = |a: usize| f64::from(r[a]) - f64::from(self.node_rest[n][a]);
                    let turned: f64 = (0..3).map(|a| f64::from(self.gradients[n][a][c]) * arm(a)).sum();
                    f64::from(weight) / f64::from(SKIN_WEIGHT_SUM)
                        * (f64::from(self.displacement[order[n] as usize][c]) + turned)
                });
                f64::from(r[c]) + moved.sum::<f64>()
            })
        })
        .collect()
    }
}

fn kernels_here() -> impl Iterator<Item = Kernels> {
    [Kernels::Scalar, Kernels::Avx2, Kernels::Avx512]
        .into_iter()
        .filter(|kernels| kernels.run_here())
}

#[test]
fn all_kernels_follow_the_definition() {
    for (vertex_count, far, tolerance) in [
        (0, 0.0, TOLERANCE),
        (1, 0.0, TOLERANCE),
        (50, 0.0, TOLERANCE),
        (50, 1e3, FAR_TOLERANCE),
    ] {
        let case = Case::new(vertex_count, far);
        for kernels in kernels_here() {
            let (bounds, positions) = case.play(kernels, &case.maps());
            let mut expected = Bounds::EMPTY;
            positions.iter().for_each(|p| expected.include(p));
            assert_eq!(bounds, Some(expected));
            let difference = largest_difference(&positions, &case.expected());
            assert!(difference < tolerance, "{kernels:?}, {far}: {difference}");
        }
    }
}

#[test]
fn maps_of_nothing_leave_rest_to_the_bit() {
    let case = Case::new(20, 1e3);
    for kernels in kernels_here() {
        assert_eq!(case.play(kernels, &[[[0.0; 4]; 4]; NODES]).1, case.rest);
    }
}

#[test]
fn what_is_not_finite_is_seen() {
    let case = Case::new(20, 0.0);
    for kernels in kernels_here() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for column in 0..4 {
                let mut maps = case.maps();
                maps[usize::from(case.nodes[4][1])][column][2] = bad;
                assert_eq!(case.play(kernels, &maps).0, None, "{kernels:?} {bad} {column}");
            }
        }
    }
}
