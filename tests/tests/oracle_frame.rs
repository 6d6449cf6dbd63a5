//! The runtime's frame against a naive twin: the unfolded network of the compact package, in f64, with dense matrices.
//!
//! The twin shares no code with what it checks: it convolves the blended components (the baker folded the convolution),
//! sums the exponential's power series, weighs edges by angles, and solves for positions with the anchor pinned (the
//! runtime solves for displacements through a sparse factor).

use core::error::Error;
use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sinew_bake::bake;
use sinew_formats::package::{
    After, BlockRecord, CompactBasis, CompactView, ComponentRecord, FEATURE_COUNT, GraphConvRecord, NO_PIECE, NONE,
    Prior, Provenance, Quality, Surface, ValueScales, write_compact,
};
use sinew_runtime::{Basis, Controls, Frame, Workspace, WorkspaceLayout};

/// Of the bounding box's diagonal, where folding is exact in whole numbers: f32 on the frame path is all that is left.
const FRAME_TOLERANCE: f64 = 5e-7;
/// Share of the pose's own largest movement, where the decoder mixes features and neighbours: folding rounds every value
/// once more, by at most half a 32767th of the component's greatest.
const FOLDED_TOLERANCE: f64 = 1.0 / 32_768.0;

/// Weights of a pose are drawn within these: small, ordinary, at the limit of the training shapes, and beyond.
const AMPLITUDES: [f32; 4] = [0.1, 0.5, 1.0, 2.0];

/// A compact package's arrays.
struct Compact {
    rest: Vec<[f32; 3]>,
    faces: Vec<[u32; 3]>,
    bridges: Vec<[u32; 2]>,
    anchor: u32,
    blocks: Vec<BlockRecord>,
    parents: Vec<u32>,
    supports: Vec<Vec<bool>>,
    /// Exactly what whole numbers stand for.
    values: Vec<Vec<[f64; FEATURE_COUNT]>>,
    whole: Vec<[i16; FEATURE_COUNT]>,
    scales: Vec<ValueScales>,
    piece_of: Vec<u16>,
    piece_offsets: Vec<[f32; 3]>,
    modes: Vec<[i16; 3]>,
    mix: Vec<f32>,
}

const NAMES: [&str; 7] = ["c0", "c1", "c2", "c0.f0", "c0.f1", "c1.f0", "c2.f0"];
const MODE_SCALES: [f32; 2] = [2e-6, 1e-6];
const ROTATION_SCALE: f32 = 2.0;
const STRETCH_SCALE: f32 = 0.5;

/// Adds a bumpy patch of nearly equilateral triangles.
fn add_patch(compact: &mut Compact, width: u32, height: u32, at: f32, rng: &mut ChaCha8Rng) {
    let first = compact.rest.len() as u32;
    for y in 0..height {
        for x in 0..width {
            let along = x as f32 + 0.5 * (y % 2) as f32;
            compact
                .rest
                .push([at + along, 0.866 * y as f32, rng.random_range(-0.1..0.1)]);
            if x + 1 < width && y + 1 < height {
                let v = first + y * width + x;
                let (right, up, corner) = (v + 1, v + width, v + width + 1);
                if y % 2 == 0 {
                    compact.faces.extend([[v, right, up], [right, corner, up]]);
                } else {
                    compact.faces.extend([[v, right, corner], [v, corner, up]]);
                }
            }
        }
    }
}

/// Two patches tied by a bridge; three coarse components, four fine ones in three blocks; everything else is noise.
/// With `mixing` 0 the decoders' matrices are the identity, with 1 they mix features and neighbours.
fn compact(seed: u64, mixing: f32) -> Compact {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut compact = Compact {
        rest: vec![],
        faces: vec![],
        bridges: vec![],
        anchor: 17,
        blocks: vec![],
        parents: vec![NONE, 0, 1, 2],
        supports: vec![],
        values: vec![],
        whole: vec![],
        scales: vec![],
        piece_of: vec![],
        piece_offsets: vec![],
        modes: vec![],
        mix: vec![],
    };
    add_patch(&mut compact, 11, 8, 0.0, &mut rng);
    let first_patch = compact.rest.len() as u32;
    add_patch(&mut compact, 5, 5, 12.5, &mut rng);
    compact.bridges.push([10, first_patch]);
    let matrix = |rng: &mut ChaCha8Rng, diagonal: f32| {
        core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                if i == j {
                    diagonal
                } else {
                    mixing * rng.random_range(-0.2..0.2)
                }
            })
        })
    };
    let mut first_component = 0;
    for (&parent_component, component_count) in compact.parents.iter().zip([3, 2, 1, 1]) {
        let mut conv = || GraphConvRecord {
            point: matrix(&mut rng, 1.0),
            neighbour: matrix(&mut rng, 0.4 * mixing),
            bias: core::array::from_fn(|_| rng.random_range(-0.2..0.2)),
        };
        let level = u32::from(parent_component != NONE);
        let (encoder, decoder) = (conv(), conv());
        compact.blocks.push(BlockRecord {
            level,
            parent_component,
            first_component,
            component_count,
            encoder,
            decoder,
        });
        first_component += component_count;
    }
    for _ in NAMES {
        // Smooth bumps, as learned components are: neighbours move alike.
        let (x, y, radius) = (
            rng.random_range(0.0..14.0),
            rng.random_range(0.0..6.0),
            rng.random_range(2.0..5.0_f32),
        );
        let peak: [f32; FEATURE_COUNT] = core::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let bump = |p: &[f32; 3]| 1.0 - ((p[0] - x).powi(2) + (p[1] - y).powi(2)) / (radius * radius);
        let support: Vec<bool> = compact.rest.iter().map(|p| bump(p) > 0.0).collect();
        let inside = compact.rest.iter().filter(|p| bump(p) > 0.0);
        let values: Vec<_> = inside.map(|p| peak.map(|a| 0.25 * a * bump(p))).collect();
        let scales = ValueScales::for_values(&values);
        let whole: Vec<_> = values.iter().map(|value| scales.round(value)).collect();
        let units = scales.by_feature().map(f64::from);
        let exact = |whole: &[i16; FEATURE_COUNT]| core::array::from_fn(|c| f64::from(whole[c]) * units[c]);
        compact.values.push(whole.iter().map(exact).collect());
        compact.whole.extend(whole);
        compact.scales.push(scales);
        compact.supports.push(support);
    }
    let count = compact.rest.len();
    compact.piece_of = (0..count)
        .map(|v| if v % 5 == 0 { (v % 2) as u16 } else { NO_PIECE })
        .collect();
    compact.piece_offsets = (0..2 * NAMES.len())
        .map(|_| core::array::from_fn(|_| rng.random_range(-0.2..0.2)))
        .collect();
    compact.mix = (0..2 * NAMES.len()).map(|_| rng.random_range(-1.0..1.0)).collect();
    compact.modes = (0..2 * count)
        .map(|_| core::array::from_fn(|_| rng.random_range(-32_767..=32_767)))
        .collect();
    compact
}

impl Compact {
    fn write(&self) -> Result<sinew_formats::package::AlignedBytes, Box<dyn Error>> {
        let mut block_of = vec![];
        for (b, block) in self.blocks.iter().enumerate() {
            block_of.extend((0..block.component_count).map(|_| b as u32));
        }
        let components: Vec<_> = NAMES
            .iter()
            .zip(block_of)
            .zip(&self.scales)
            .map(|((name, block), &value_scales)| ComponentRecord {
                name,
                block,
                centre_vertex: 0,
                scale: 0.4,
                strength: 0.1,
                locality: 1.0,
                minimum: -3.0,
                maximum: 3.0,
                value_scales,
            })
            .collect();
        let words = self.supports.iter().flat_map(|support| {
            support
                .chunks(32)
                .map(|bits| bits.iter().enumerate().map(|(n, &bit)| u32::from(bit) << n).sum())
        });
        let bytes = write_compact(&CompactBasis {
            rest_positions: &self.rest,
            surface: Surface::plain(self.rest.len(), &self.faces),
            bridges: &self.bridges,
            anchor_vertex: self.anchor,
            rotation_scale: ROTATION_SCALE,
            stretch_scale: STRETCH_SCALE,
            blocks: &self.blocks,
            components: &components,
            support_bits: &words.collect::<Vec<u32>>(),
            values: &self.whole,
            after: After {
                piece_of: &self.piece_of,
                piece_offsets: &self.piece_offsets,
                mix: &self.mix,
                modes: &self.modes,
                mode_scales: &MODE_SCALES,
            },
            prior: Prior::NONE,
            encoder: &[],
            provenance: Provenance {
                tool: "oracle",
                sequence: "patches",
                config: "",
                seed: 0,
                shape_count: 1,
                train_shapes: &[0],
            },
            quality: Quality {
                validation_e_rms: -1.0,
                steps: 0,
                steps_run: 0,
            },
        })?;
        Ok(bytes)
    }

    /// One-rings: faces and bridges.
    fn rings(&self) -> Vec<Vec<usize>> {
        let mut rings = vec![std::collections::BTreeSet::new(); self.rest.len()];
        let sides = self.faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        for [a, b] in sides.chain(self.bridges.iter().copied()) {
            rings[a as usize].insert(b as usize);
            rings[b as usize].insert(a as usize);
        }
        rings.into_iter().map(|ring| ring.into_iter().collect()).collect()
    }

    /// Features at `weights`: every block's decoder on its blended components. Shape: `[V]`.
    fn features(&self, weights: &[f32]) -> Vec<[f64; FEATURE_COUNT]> {
        let rings = self.rings();
        let mut features = vec![[0.0; FEATURE_COUNT]; self.rest.len()];
        for block in &self.blocks {
            let mut blended = vec![[0.0; FEATURE_COUNT]; self.rest.len()];
            for k in (block.first_component..)
                .take(block.component_count as usize)
                .map(|k| k as usize)
            {
                let mut values = self.values[k].iter();
                for v in (0..self.rest.len()).filter(|&v| self.supports[k][v]) {
                    let value = values.next().expect("one row a bit");
                    for c in 0..FEATURE_COUNT {
                        blended[v][c] += f64::from(weights[k]) * value[c];
                    }
                }
            }
            let conv = &block.decoder;
            for v in 0..self.rest.len() {
                for i in 0..FEATURE_COUNT {
                    let mut y = f64::from(conv.bias[i]);
                    for j in 0..FEATURE_COUNT {
                        let mean = rings[v].iter().map(|&n| blended[n][j]).sum::<f64>() / rings[v].len() as f64;
                        y += f64::from(conv.point[i][j]) * blended[v][j] + f64::from(conv.neighbour[i][j]) * mean;
                    }
                    features[v][i] += y.tanh() - f64::from(conv.bias[i]).tanh();
                }
            }
        }
        features
    }

    /// Of the bounding box.
    fn diagonal(&self) -> f64 {
        let corner = |pick: fn(f32, f32) -> f32| {
            let extreme = |a: [f32; 3], b: [f32; 3]| core::array::from_fn(|c| pick(a[c], b[c]));
            Vector3::from(
                self.rest
                    .iter()
                    .copied()
                    .reduce(extreme)
                    .expect("vertices")
                    .map(f64::from),
            )
        };
        (corner(f32::max) - corner(f32::min)).norm()
    }

    fn rest(&self, v: usize) -> Vector3<f64> {
        Vector3::from(self.rest[v].map(f64::from))
    }

    /// Half the sum of the cotangents opposite to each edge; a bridge weighs their mean.
    fn weights(&self) -> BTreeMap<(usize, usize), f64> {
        let mut weights = BTreeMap::new();
        for face in &self.faces {
            for n in 0..3 {
                let [a, b, apex] = [1, 2, 0].map(|side| face[(n + side) % 3] as usize);
                let angle = (self.rest(a) - self.rest(apex)).angle(&(self.rest(b) - self.rest(apex)));
                for edge in [(a, b), (b, a)] {
                    *weights.entry(edge).or_insert(0.0) += 0.5 / angle.tan();
                }
            }
        }
        let mean = weights.values().sum::<f64>() / weights.len() as f64;
        // The baker clamps beyond these; an oracle that never meets the clamp need not know it.
        assert!(weights.values().all(|&w| w > 0.02 * mean && w < 9.0 * mean));
        for &[a, b] in &self.bridges {
            weights.extend([((a as usize, b as usize), mean), ((b as usize, a as usize), mean)]);
        }
        weights
    }

    /// Positions at `weights`. Shape: `[V]`.
    fn positions(&self, weights: &[f32]) -> Vec<Vector3<f64>> {
        let gradients: Vec<_> = self.features(weights).iter().map(deformation_gradient).collect();
        let count = self.rest.len();
        let mut matrix = DMatrix::zeros(count, count);
        let mut right = DMatrix::zeros(count, 3);
        for ((i, j), weight) in self.weights() {
            matrix[(i, i)] += weight;
            matrix[(i, j)] -= weight;
            let b = 0.5 * weight * (gradients[i] + gradients[j]) * (self.rest(i) - self.rest(j));
            for c in 0..3 {
                right[(i, c)] += b[c];
            }
        }
        let anchor = self.anchor as usize;
        matrix.row_mut(anchor).fill(0.0);
        matrix[(anchor, anchor)] = 1.0;
        right.row_mut(anchor).copy_from(&self.rest(anchor).transpose());
        let solution = matrix.lu().solve(&right).expect("a connected mesh");
        (0..count)
            .map(|v| solution.row(v).transpose().fixed_rows::<3>(0).into_owned() + self.added(v, weights))
            .collect()
    }

    /// What the weights add to vertex `v` after the solve.
    fn added(&self, v: usize, weights: &[f32]) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (k, &weight) in weights.iter().enumerate() {
            if self.piece_of[v] != NO_PIECE {
                let offset = self.piece_offsets[2 * k + usize::from(self.piece_of[v])];
                sum += f64::from(weight) * Vector3::from(offset.map(f64::from));
            }
            for (m, scale) in MODE_SCALES.iter().enumerate() {
                let share = f64::from(self.mix[m * weights.len() + k]) * f64::from(*scale);
                sum += f64::from(weight) * share * Vector3::from(self.modes[2 * v + m].map(f64::from));
            }
        }
        sum
    }
}

/// `exp([r]x) S`.
fn deformation_gradient(x: &[f64; FEATURE_COUNT]) -> Matrix3<f64> {
    let r = f64::from(ROTATION_SCALE) * Vector3::new(x[0], x[1], x[2]);
    let s: Vec<f64> = x[3..].iter().map(|a| f64::from(STRETCH_SCALE) * a).collect();
    let cross = r.cross_matrix();
    let (mut rotation, mut term) = (Matrix3::<f64>::identity(), Matrix3::<f64>::identity());
    for n in 1..60 {
        term = term * cross / f64::from(n);
        rotation += term;
    }
    rotation * (Matrix3::<f64>::identity() + Matrix3::new(s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5]))
}

/// Normals by the definition: the sum of the cross products around a vertex.
fn normals(faces: &[[u32; 3]], positions: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::<f64>::zeros(); positions.len()];
    for face in faces {
        let [p, q, r] = face.map(|v| positions[v as usize]);
        for &v in face {
            normals[v as usize] += (q - p).cross(&(r - p));
        }
    }
    normals.iter().map(Vector3::normalize).collect()
}

/// Greatest distance between f32 points and f64 ones.
fn farthest(found: &[[f32; 3]], expected: &[Vector3<f64>]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found
        .iter()
        .zip(expected)
        .map(|(a, b)| (Vector3::from(a.map(f64::from)) - b).norm())
        .fold(0.0, f64::max)
}

/// Plays every pose by the runtime and by the oracle. Returns error and largest movement of each,
/// shares of the diagonal.
fn errors(compact: &Compact, seed: u64) -> Result<[(f64, f64); AMPLITUDES.len()], Box<dyn Error>> {
    let baked = bake(&CompactView::open(&compact.write()?)?)?;
    let basis = Basis::open(&baked)?;
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::new(&basis, &mut memory)?;
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights)?;
    let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
    let diagonal = compact.diagonal();
    let mut errors = [(0.0, 0.0); AMPLITUDES.len()];
    for (amplitude, found_error) in AMPLITUDES.into_iter().zip(&mut errors) {
        for k in 0..basis.component_count() {
            controls.set(k, rng.random_range(-amplitude..amplitude))?;
        }
        let mut positions = vec![[0.0; 3]; basis.vertex_count()];
        let mut found = positions.clone();
        let job = Frame {
            basis: &basis,
            controls: &controls,
            positions: &mut positions,
            normals: Some(&mut found),
        };
        job.run(&mut workspace)?;
        let expected = compact.positions(controls.weights());
        let error = farthest(&positions, &expected) / diagonal;
        let moved = farthest(&compact.rest, &expected) / diagonal;
        let normal_error = farthest(&found, &normals(&compact.faces, &expected));
        println!("seed {seed}, moved {moved:.3}: error {error:.2e}, normals {normal_error:.2e}");
        assert!(moved > 0.001, "the pose moves something");
        // Normals see differences of neighbours, which here are about a tenth of the diagonal apart.
        assert!(normal_error < 100.0 * error.max(FRAME_TOLERANCE), "{normal_error}");
        *found_error = (error, moved);
    }
    Ok(errors)
}

#[test]
fn frame_equals_the_oracle_to_f32_where_folding_is_exact() -> Result<(), Box<dyn Error>> {
    for seed in 0..3 {
        for (error, _) in errors(&compact(seed, 0.0), seed)? {
            assert!(error < FRAME_TOLERANCE, "{error}");
        }
    }
    Ok(())
}

#[test]
fn frame_equals_the_oracle_of_the_unfolded_network() -> Result<(), Box<dyn Error>> {
    for seed in 0..3 {
        for (error, moved) in errors(&compact(seed, 1.0), seed)? {
            assert!(error < FOLDED_TOLERANCE * moved, "{error} where {moved} is moved");
        }
    }
    Ok(())
}
