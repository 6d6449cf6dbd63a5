//! Small baked packages for unit tests: a grid, a hand-made component tree and a dense factor.

use core::cmp::Ordering;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

use sinew_formats::package::{
    After, AlignedBytes, BakedBasis, BakedBlock, BakedComponent, BakedExact, BakedSolve, Fans, Indices, NO_PIECE, NONE,
    Patches, Prior, QUAD, Surface, ValueScales, write_baked,
};

use crate::basis::Basis;
use crate::bones::fixture::OwnBones;
use crate::simd::generic::solve::{Factor, Rings};
use crate::simd::tests::naive::Noise;
use crate::workspace::{Workspace, WorkspaceLayout};

/// A bumpy grid of triangles in scrambled slots and another order of elimination, every edge of another weight.
pub(crate) struct Grid {
    pub(crate) rest: Vec<[f32; 3]>,
    pub(crate) faces: Vec<[u32; 3]>,
    pub(crate) slot_from_vertex: Vec<u32>,
    pub(crate) solver_from_slot: Vec<u32>,
    /// A slot.
    pub(crate) anchor: usize,
    offsets: Vec<u32>,
    ring: Vec<u32>,
    weights: Vec<f32>,
}

impl Grid {
    pub(crate) fn new(width: u32, height: u32) -> Self {
        let count = width * height;
        let stride = (2..).find(|n| gcd(*n, count) == 1).unwrap();
        let slot_from_vertex: Vec<u32> = (0..count).map(|v| (v * stride + 1) % count).collect();
        let mut noise = Noise::new(100);
        let mut rest = vec![[0.0; 3]; count as usize];
        let mut faces = Vec::new();
        let mut rows = vec![std::collections::BTreeMap::new(); count as usize];
        for y in 0..height {
            for x in 0..width {
                let v = y * width + x;
                rest[slot_from_vertex[v as usize] as usize] = [x as f32, y as f32, 0.3 * noise.next()];
                if x + 1 < width && y + 1 < height {
                    faces.push([v, v + 1, v + width]);
                    faces.push([v + 1, v + width + 1, v + width]);
                }
            }
        }
        for face in &faces {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let (i, j) = (slot_from_vertex[face[a] as usize], slot_from_vertex[face[b] as usize]);
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
            slot_from_vertex,
            // Seven divides no count of a test.
            solver_from_slot: (0..count).map(|slot| (13 * slot + 3) % count).collect(),
            anchor: count as usize / 2,
            offsets,
            ring,
            weights,
        }
    }

    pub(crate) fn vertex_count(&self) -> usize {
        self.rest.len()
    }

    pub(crate) fn rings(&self) -> Rings<'_, u32> {
        Rings {
            offsets: &self.offsets,
            neighbours: &self.ring,
            weights: &self.weights,
            solver_from_slot: &self.solver_from_slot,
        }
    }

    /// `(i, j, c_ij)`, each edge in both directions.
    pub(crate) fn edges_both_ways(&self) -> impl Iterator<Item = (usize, usize, f32)> + '_ {
        (0..self.vertex_count()).flat_map(move |i| {
            let row = self.offsets[i] as usize..self.offsets[i + 1] as usize;
            row.map(move |n| (i, self.ring[n] as usize, self.weights[n]))
        })
    }

    /// Rows in slots to rows in solver order.
    pub(crate) fn in_solver_order<T: Copy>(&self, slots: &[T]) -> Vec<T> {
        let mut rows = slots.to_vec();
        for (&solver, row) in self.solver_from_slot.iter().zip(slots) {
            rows[solver as usize] = *row;
        }
        rows
    }

    /// Dense Laplacian with the anchor's penalty, solver order.
    pub(crate) fn laplacian(&self) -> Vec<Vec<f64>> {
        let mut matrix = vec![vec![0.0; self.vertex_count()]; self.vertex_count()];
        for (i, j, weight) in self.edges_both_ways() {
            let [i, j] = [i, j].map(|slot| self.solver_from_slot[slot] as usize);
            matrix[i][j] -= f64::from(weight);
            matrix[i][i] += f64::from(weight);
        }
        let anchor = self.solver_from_slot[self.anchor] as usize;
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
    pub(crate) fn view(&self) -> Factor<'_, u32> {
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
    let padded = count.next_multiple_of(QUAD);
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
    for first in (0..padded).step_by(QUAD) {
        let unit = Matrix4::from_fn(|i, j| match i.cmp(&j) {
            Ordering::Less => 0.0,
            Ordering::Equal => 1.0,
            Ordering::Greater => a[first + i][first + j],
        });
        let inverse = unit.inverse();
        factor.inverse_diagonals.push(core::array::from_fn(|n| {
            let (i, j) = (n / QUAD, n % QUAD);
            if first + i.max(j) >= count {
                return 0.0;
            }
            let terms = (0..QUAD).map(|k| inverse.0[k][i] * inverse.0[k][j] / a[first + k][first + k]);
            terms.sum::<f64>() as f32
        }));
        for row in (first + QUAD..padded).step_by(QUAD) {
            let tile: [f32; 16] = core::array::from_fn(|n| {
                let terms = (0..QUAD).map(|k| a[row + n % QUAD][first + k] * inverse.0[k][n / QUAD]);
                terms.sum::<f64>() as f32
            });
            if tile != [0.0; 16] {
                factor.rows.push((row / QUAD) as u32);
                factor.tiles.push(tile);
            }
        }
        factor.offsets.push(factor.rows.len() as u32);
    }
    factor
}

/// Unit lower triangular.
struct Matrix4([[f64; QUAD]; QUAD]);

impl Matrix4 {
    fn from_fn(entry: impl Fn(usize, usize) -> f64) -> Self {
        Self(core::array::from_fn(|i| core::array::from_fn(|j| entry(i, j))))
    }

    /// By forward substitution of the identity.
    fn inverse(&self) -> Self {
        let mut inverse = Self::from_fn(|i, j| f64::from(i == j));
        for i in 0..QUAD {
            for k in 0..i {
                for j in 0..QUAD {
                    inverse.0[i][j] -= self.0[i][k] * inverse.0[k][j];
                }
            }
        }
        inverse
    }
}

/// What a small package may have besides.
#[derive(Clone, Copy, Default)]
struct Extras {
    influences: Option<u32>,
    added: bool,
    prior: bool,
}

impl Extras {
    const ADDED: Self = Self {
        influences: None,
        added: true,
        prior: false,
    };
}

/// A baked package in memory, and what went into it.
pub(crate) struct Package {
    pub(crate) bytes: AlignedBytes,
    pub(crate) rest_in_source_order: Vec<[f32; 3]>,
}

impl Package {
    /// Components of every small package.
    pub(crate) const COMPONENTS: usize = 5;

    /// A 6 by 5 grid; a root block of two components, child blocks of one and of two under them; pieces and modes added.
    pub(crate) fn small(seed: u64) -> Self {
        Self::on(&Grid::new(6, 5), seed, [7; 16], |k| format!("c{k}"), Extras::ADDED)
    }

    /// The same with nothing added after the solve.
    pub(crate) fn small_with_nothing_added(seed: u64) -> Self {
        Self::on(&Grid::new(6, 5), seed, [7; 16], |k| format!("c{k}"), Extras::default())
    }

    /// Components 2 and 3, of different blocks, go together; the others hardly move.
    pub(crate) const PRIOR: Prior<'static> = Prior {
        mean: &[0.0; 5],
        factors: &[0.0, 0.0, 0.5, -0.5, 0.0],
        variances: &[1e-4; 5],
        strength: 1e-6,
    };

    /// The same with a prior of the weights.
    pub(crate) fn small_with_prior(seed: u64) -> Self {
        let extras = Extras {
            prior: true,
            ..Extras::default()
        };
        Self::on(&Grid::new(6, 5), seed, [7; 16], |k| format!("c{k}"), extras)
    }

    /// The same with bones, of so many influences each vertex.
    pub(crate) fn small_with_bones(seed: u64) -> Self {
        Self::with_bones(seed, 4)
    }

    pub(crate) fn with_bones(seed: u64, influences: u32) -> Self {
        let extras = Extras {
            influences: Some(influences),
            ..Extras::ADDED
        };
        Self::on(&Grid::new(6, 5), seed, [7; 16], |k| format!("c{k}"), extras)
    }

    fn on(grid: &Grid, seed: u64, compact_id: [u8; 16], name: impl Fn(usize) -> String, extras: Extras) -> Self {
        let mut noise = Noise::new(seed);
        let count = grid.vertex_count() as u32;
        let mut vertex_from_slot = vec![0; count as usize];
        for (v, &s) in grid.slot_from_vertex.iter().enumerate() {
            vertex_from_slot[s as usize] = v as u32;
        }
        let supports: [Vec<u32>; 3] = [
            (0..count).collect(),
            (0..count).filter(|slot| slot % 3 != 1).collect(),
            (0..count).filter(|slot| slot % 2 == 0).collect(),
        ];
        let (mut blocks, mut components) = (Vec::new(), Vec::new());
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
                for place in 0..supports[b].len() {
                    if !(place + k).is_multiple_of(5) {
                        let values = noise.features().map(|x| (32_767.0 * x) as i16);
                        entries.push((k, b as u32, supports[b][place], values));
                    }
                }
                components.push(BakedComponent {
                    name: &names[k],
                    block: b as u32,
                    minimum: -1.0 - k as f32,
                    maximum: 1.5,
                    value_scales: ValueScales {
                        rotation: 0.5 / 32_768.0,
                        stretch: 0.4 / 32_768.0,
                    },
                });
            }
        }
        let patches = Patches::gather(grid.vertex_count(), entries);
        let fans = Fans::gather(&grid.faces, &grid.slot_from_vertex);
        let factor = factorise(&grid.laplacian());
        let in_place = |values| Indices::of(grid.vertex_count(), values);
        let solve = BakedSolve {
            ring_offsets: &grid.offsets,
            ring: in_place(&grid.ring),
            ring_weights: &grid.weights,
            tile_offsets: &factor.offsets,
            tile_rows: in_place(&factor.rows),
            tiles: &factor.tiles,
            inverse_diagonals: &factor.inverse_diagonals,
            solver_from_slot: in_place(&grid.solver_from_slot),
        };
        let bones = extras
            .influences
            .map(|influences| OwnBones::random(&grid.rest, Self::COMPONENTS, &patches, influences));
        // Every seventh slot belongs to a piece; two modes over all.
        let piece_of: Vec<u16> = (0..count as u16)
            .map(|slot| if slot % 7 == 0 { slot % 2 } else { NO_PIECE })
            .collect();
        let piece_offsets: Vec<[f32; 3]> = (0..2 * Self::COMPONENTS)
            .map(|_| noise.point().map(|x| 0.2 * x))
            .collect();
        let modes: Vec<[i16; 3]> = (0..2 * count)
            .map(|_| noise.point().map(|x| (32_767.0 * x) as i16))
            .collect();
        let mix: Vec<f32> = (0..2 * Self::COMPONENTS).map(|_| noise.next()).collect();
        let corners: Vec<[u32; 3]> = grid
            .faces
            .iter()
            .map(|face| face.map(|v| grid.slot_from_vertex[v as usize]))
            .collect();
        let bytes = write_baked(&BakedBasis {
            compact_id,
            rotation_scale: 1.5,
            stretch_scale: 0.4,
            blocks: &blocks,
            components: &components,
            rest_positions: &grid.rest,
            slot_from_vertex: in_place(&grid.slot_from_vertex),
            vertex_from_slot: in_place(&vertex_from_slot),
            surface: Surface::plain(grid.vertex_count(), &corners),
            fan_offsets: &fans.fan_offsets,
            fans: in_place(fans.fans.as_flattened()),
            exact: Some(BakedExact {
                patches: patches.record(),
                solve,
            }),
            bones: bones.as_ref().map(OwnBones::record),
            after: if extras.added {
                After {
                    piece_of: &piece_of,
                    piece_offsets: &piece_offsets,
                    mix: &mix,
                    modes: &modes,
                    mode_scales: &[3e-6, 1e-6],
                }
            } else {
                After::NONE
            },
            prior: if extras.prior { Self::PRIOR } else { Prior::NONE },
        })
        .unwrap();
        let rest_in_source_order = grid.slot_from_vertex.iter().map(|&s| grid.rest[s as usize]).collect();
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
