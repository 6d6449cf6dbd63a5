//! Small baked packages for unit tests: a grid, a hand-made component tree and a dense factor.

use core::cmp::Ordering;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

use half::f16;
use sinew_formats::package::{
    AlignedBytes, BakedBasis, BakedBlock, BakedComponent, BakedFast, BakedTier, Fans, FastError, NONE, Patches,
    RenderMesh, write_baked,
};

use crate::basis::Basis;
use crate::simd::scalar::naive::Noise;
use crate::simd::scalar::poisson::{BLOCK, Factor, Rings};
use crate::workspace::{Workspace, WorkspaceLayout};

/// A bumpy grid of triangles in scrambled lanes and another order of elimination, every edge of another weight.
pub(crate) struct Grid {
    pub(crate) rest: Vec<[f32; 3]>,
    pub(crate) faces: Vec<[u32; 3]>,
    pub(crate) lane_from_vertex: Vec<u32>,
    pub(crate) solver_from_lane: Vec<u32>,
    /// A lane.
    pub(crate) anchor: usize,
    offsets: Vec<u32>,
    ring: Vec<u32>,
    weights: Vec<f32>,
}

impl Grid {
    pub(crate) fn new(width: u32, height: u32) -> Self {
        let count = width * height;
        let stride = (2..).find(|n| gcd(*n, count) == 1).unwrap();
        let lane_from_vertex: Vec<u32> = (0..count).map(|v| (v * stride + 1) % count).collect();
        let mut noise = Noise::new(100);
        let mut rest = vec![[0.0; 3]; count as usize];
        let mut faces = Vec::new();
        let mut rows = vec![std::collections::BTreeMap::new(); count as usize];
        for y in 0..height {
            for x in 0..width {
                let v = y * width + x;
                rest[lane_from_vertex[v as usize] as usize] = [x as f32, y as f32, 0.3 * noise.next()];
                if x + 1 < width && y + 1 < height {
                    faces.push([v, v + 1, v + width]);
                    faces.push([v + 1, v + width + 1, v + width]);
                }
            }
        }
        for face in &faces {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let (i, j) = (lane_from_vertex[face[a] as usize], lane_from_vertex[face[b] as usize]);
                let weight = 1.0 + 0.5 * noise.next();
                rows[i as usize].insert(j, weight);
                rows[j as usize].insert(i, weight);
            }
        }
        let mut offsets = vec![0];
        let (mut ring, mut weights) = (Vec::new(), Vec::new());
        for row in rows {
            ring.extend(row.keys());
            weights.extend(row.values());
            offsets.push(ring.len() as u32);
        }
        Self {
            rest,
            faces,
            lane_from_vertex,
            // Seven divides no count of a test.
            solver_from_lane: (0..count).map(|lane| (13 * lane + 3) % count).collect(),
            anchor: count as usize / 2,
            offsets,
            ring,
            weights,
        }
    }

    pub(crate) fn vertex_count(&self) -> usize {
        self.rest.len()
    }

    pub(crate) fn rings(&self) -> Rings<'_> {
        Rings {
            offsets: &self.offsets,
            neighbours: &self.ring,
            weights: &self.weights,
            solver_from_lane: &self.solver_from_lane,
        }
    }

    /// `(i, j, c_ij)`, each edge in both directions.
    pub(crate) fn edges_both_ways(&self) -> impl Iterator<Item = (usize, usize, f32)> + '_ {
        (0..self.vertex_count()).flat_map(move |i| {
            let row = self.offsets[i] as usize..self.offsets[i + 1] as usize;
            row.map(move |n| (i, self.ring[n] as usize, self.weights[n]))
        })
    }

    /// Rows in lanes to rows in solver order.
    pub(crate) fn in_solver_order<T: Copy>(&self, lanes: &[T]) -> Vec<T> {
        let mut rows = lanes.to_vec();
        for (&solver, row) in self.solver_from_lane.iter().zip(lanes) {
            rows[solver as usize] = *row;
        }
        rows
    }

    /// Dense Laplacian with the anchor's penalty, solver order.
    pub(crate) fn laplacian(&self) -> Vec<Vec<f64>> {
        let mut matrix = vec![vec![0.0; self.vertex_count()]; self.vertex_count()];
        for (i, j, weight) in self.edges_both_ways() {
            let [i, j] = [i, j].map(|lane| self.solver_from_lane[lane] as usize);
            matrix[i][j] -= f64::from(weight);
            matrix[i][i] += f64::from(weight);
        }
        let anchor = self.solver_from_lane[self.anchor] as usize;
        matrix[anchor][anchor] += 6.0;
        matrix
    }
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// A factor that owns its arrays.
pub(crate) struct DenseFactor {
    pub(crate) offsets: Vec<u32>,
    pub(crate) rows: Vec<u32>,
    pub(crate) tiles: Vec<[f32; 16]>,
    pub(crate) inverse_diagonals: Vec<[f32; 16]>,
}

impl DenseFactor {
    pub(crate) fn view(&self) -> Factor<'_> {
        Factor {
            offsets: &self.offsets,
            rows: &self.rows,
            tiles: &self.tiles,
            inverse_diagonals: &self.inverse_diagonals,
        }
    }
}

/// `F D F^T` of a dense symmetric matrix by scalars, gathered into tiles; zero tiles left out.
pub(crate) fn factorise(matrix: &[Vec<f64>]) -> DenseFactor {
    let count = matrix.len();
    let padded = count.next_multiple_of(BLOCK);
    let mut a = vec![vec![0.0; padded]; padded];
    for i in 0..padded {
        match matrix.get(i) {
            Some(row) => a[i][..count].copy_from_slice(row),
            None => a[i][i] = 1.0,
        }
    }
    for j in 0..padded {
        for i in j + 1..padded {
            let value = a[i][j] / a[j][j];
            for c in j + 1..=i {
                a[i][c] -= value * a[c][j];
            }
        }
        let pivot = a[j][j];
        a[j + 1..].iter_mut().for_each(|row| row[j] /= pivot);
    }
    let mut factor = DenseFactor {
        offsets: vec![0],
        rows: vec![],
        tiles: vec![],
        inverse_diagonals: vec![],
    };
    for first in (0..padded).step_by(BLOCK) {
        let unit = Matrix4::from_fn(|i, j| match i.cmp(&j) {
            Ordering::Less => 0.0,
            Ordering::Equal => 1.0,
            Ordering::Greater => a[first + i][first + j],
        });
        let inverse = unit.inverse();
        factor.inverse_diagonals.push(core::array::from_fn(|n| {
            let (i, j) = (n / BLOCK, n % BLOCK);
            if first + i.max(j) >= count {
                return 0.0;
            }
            let terms = (0..BLOCK).map(|k| inverse.0[k][i] * inverse.0[k][j] / a[first + k][first + k]);
            terms.sum::<f64>() as f32
        }));
        for row in (first + BLOCK..padded).step_by(BLOCK) {
            let tile: [f32; 16] = core::array::from_fn(|n| {
                let terms = (0..BLOCK).map(|k| a[row + n / BLOCK][first + k] * inverse.0[k][n % BLOCK]);
                terms.sum::<f64>() as f32
            });
            if tile != [0.0; 16] {
                factor.rows.push((row / BLOCK) as u32);
                factor.tiles.push(tile);
            }
        }
        factor.offsets.push(factor.rows.len() as u32);
    }
    factor
}

/// Unit lower triangular.
struct Matrix4([[f64; BLOCK]; BLOCK]);

impl Matrix4 {
    fn from_fn(entry: impl Fn(usize, usize) -> f64) -> Self {
        Self(core::array::from_fn(|i| core::array::from_fn(|j| entry(i, j))))
    }

    /// By forward substitution of the identity.
    fn inverse(&self) -> Self {
        let mut inverse = Self::from_fn(|i, j| f64::from(i == j));
        for i in 0..BLOCK {
            for k in 0..i {
                for j in 0..BLOCK {
                    inverse.0[i][j] -= self.0[i][k] * inverse.0[k][j];
                }
            }
        }
        inverse
    }
}

/// A baked package in memory, and what went into it.
pub(crate) struct Package {
    pub(crate) bytes: AlignedBytes,
    pub(crate) rest_in_source_order: Vec<[f32; 3]>,
}

impl Package {
    /// Components of every small package.
    pub(crate) const COMPONENTS: usize = 5;

    /// A 6 by 5 grid; a root block of two components, child blocks of one and of two under them.
    pub(crate) fn small(seed: u64) -> Self {
        Self::on(&Grid::new(6, 5), seed, [7; 16], |k| format!("c{k}"), false)
    }

    /// The same with a fast tier whose nodes are all vertices, each followed by its own: both tiers play the same.
    pub(crate) fn small_with_fast_tier(seed: u64) -> Self {
        Self::on(&Grid::new(6, 5), seed, [7; 16], |k| format!("c{k}"), true)
    }

    /// What a second training might give: another identity, the names in another order, `c0` gone.
    pub(crate) fn retrained(seed: u64) -> Self {
        let names = ["c3", "c4", "new", "c1", "c2"];
        Self::on(&Grid::new(6, 5), seed, [8; 16], |k| names[k].into(), false)
    }

    fn on(grid: &Grid, seed: u64, compact_id: [u8; 16], name: impl Fn(usize) -> String, with_fast_tier: bool) -> Self {
        let mut noise = Noise::new(seed);
        let count = grid.vertex_count() as u32;
        let mut vertex_from_lane = vec![0; count as usize];
        for (v, &s) in grid.lane_from_vertex.iter().enumerate() {
            vertex_from_lane[s as usize] = v as u32;
        }
        let supports: [Vec<u32>; 3] = [
            (0..count).collect(),
            (0..count).filter(|lane| lane % 3 != 1).collect(),
            (0..count).filter(|lane| lane % 2 == 0).collect(),
        ];
        let (mut blocks, mut components) = (Vec::new(), Vec::new());
        let lane_from_solver = grid.in_solver_order(&(0..count).collect::<Vec<u32>>());
        let mut entries = Vec::new();
        let names: Vec<String> = (0..Self::COMPONENTS).map(name).collect();
        for (b, (parent, component_count)) in [(NONE, 2), (0, 1), (1, 2)].into_iter().enumerate() {
            blocks.push(BakedBlock {
                level: u32::from(b > 0),
                parent_component: parent,
                first_component: components.len() as u32,
                component_count,
                bias: noise.features().map(|x| 0.3 * x),
            });
            for _ in 0..component_count {
                let k = components.len();
                for slot in 0..supports[b].len() as u32 {
                    if !(slot as usize + k).is_multiple_of(5) {
                        let values = noise.features().map(|x| f16::from_f32(0.125 * x).to_bits());
                        entries.push((k, b as u32, supports[b][slot as usize], values));
                    }
                }
                components.push(BakedComponent {
                    name: &names[k],
                    block: b as u32,
                    minimum: -1.0 - k as f32,
                    maximum: 1.5,
                    value_scale: 4.0,
                });
            }
        }
        let patches = Patches::gather(grid.vertex_count(), entries);
        let fans = Fans::gather(&grid.faces, &grid.lane_from_vertex);
        let factor = factorise(&grid.laplacian());
        let exact = BakedTier {
            rest_positions: &grid.rest,
            ring_offsets: &grid.offsets,
            ring: &grid.ring,
            ring_weights: &grid.weights,
            tile_offsets: &factor.offsets,
            tile_rows: &factor.rows,
            tiles: &factor.tiles,
            inverse_diagonals: &factor.inverse_diagonals,
            solver_from_lane: &grid.solver_from_lane,
            lane_from_solver: &lane_from_solver,
            patch_offsets: &patches.patch_offsets,
            patch_owners: &patches.patch_owners,
            patch_values: &patches.patch_values,
        };
        let fast = BakedFast {
            nodes: exact,
            centre: [2.5, 2.0, 0.0],
            skin_nodes: &(0..count as u16).map(|lane| [lane, 0, 1, 2]).collect::<Vec<_>>(),
            skin_weights: &vec![[u16::MAX, 0, 0, 0]; count as usize],
            error: FastError {
                mixed_rms: 1e-6,
                mixed_p99: 1e-6,
                mixed_max: 1e-6,
                single_rms: 1e-6,
                single_max: 1e-6,
                normal_rms: 1e-6,
                mixed_poses: 1,
            },
        };
        let bytes = write_baked(&BakedBasis {
            compact_id,
            faces: &grid.faces,
            lane_from_vertex: &grid.lane_from_vertex,
            vertex_from_lane: &vertex_from_lane,
            rotation_scale: 1.5,
            stretch_scale: 0.4,
            blocks: &blocks,
            components: &components,
            fan_offsets: &fans.fan_offsets,
            fans: &fans.fans,
            exact,
            fast: with_fast_tier.then_some(fast),
            render: RenderMesh::NONE,
        })
        .unwrap();
        let rest_in_source_order = grid.lane_from_vertex.iter().map(|&s| grid.rest[s as usize]).collect();
        Self {
            bytes,
            rest_in_source_order,
        }
    }
}

/// The fixture's bytes as the runtime sees them.
pub(crate) fn open(package: &Package) -> Basis<'_> {
    Basis::open(&package.bytes).unwrap()
}

/// Memory that is enough for a workspace.
pub(crate) fn memory_for(basis: &Basis<'_>) -> Vec<u8> {
    vec![0xff; WorkspaceLayout::for_basis(basis).unaligned_bytes()]
}

/// A workspace at rest.
pub(crate) fn workspace_in<'w>(basis: &Basis<'_>, memory: &'w mut [u8]) -> Workspace<'w> {
    Workspace::new(basis, memory).unwrap()
}
