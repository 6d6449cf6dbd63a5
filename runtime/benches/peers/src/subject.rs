//! What a benchmark plays: a package of any size, baked on the spot. Bumpy tori of a chosen vertex count, the built-in
//! creature, and any mesh at hand, all with a made-up network of 10 coarse and 50 fine components on geodesic-like patches,
//! as sparse as trained ones (7 entries a vertex in all).

use sinew_formats::package::{
    After, AlignedBytes, BlockRecord, CompactBasis, CompactView, ComponentRecord, FEATURE_COUNT, GraphConvRecord, NONE,
    Prior, Provenance, Quality, Surface, ValueScales, write_compact,
};

use sinew_bake::mesh::{cotangent::EdgeWeights, topology::Topology, widened};
use sinew_bake::{BakeOptions, Surface as BakedSurface, bake, bake_with};
use sinew_synthesize::{Settings, Subject as Sequence};

/// Coarse components.
const COARSE: usize = 10;
/// Fine components under each coarse one.
const FINE: usize = 5;
/// All components.
pub const COMPONENTS: usize = COARSE + COARSE * FINE;
/// Larger meshes are baked without bones.
const BONES_VERTICES_MAX: usize = 13_000;
/// Share of the vertices that a coarse component moves, and a fine one: 10 * 0.25 + 50 * 0.09 = 7 entries a vertex.
const SHARES: [f64; 2] = [0.25, 0.09];
/// Range of the biases.
const BIAS: f32 = 0.1;

/// A mesh and its packages.
#[derive(Debug, Clone)]
pub struct Subject {
    /// For the table.
    pub name: String,
    /// Shape: `[V]`.
    pub rest: Vec<[f32; 3]>,
    /// Shape: `[F]`.
    pub faces: Vec<[u32; 3]>,
    /// The compact package.
    pub compact: AlignedBytes,
    /// The baked one.
    pub baked: AlignedBytes,
}

impl Subject {
    /// A bumpy torus with about `vertex_count` vertices.
    pub fn torus(vertex_count: usize) -> Self {
        let (rest, faces) = torus(vertex_count);
        Self::of_mesh(format!("torus {}", rest.len()), rest, faces)
    }

    /// The built-in creature with about `vertex_count` vertices.
    pub fn creature(vertex_count: usize) -> Self {
        let settings = Settings {
            vertices: vertex_count,
            frames: 2,
            ..Sequence::Creature.default_settings()
        };
        let sequence = Sequence::Creature.synthesize(&settings).expect("settings in range");
        let rest = sequence.shapes[0].to_vec();
        Self::of_mesh(format!("creature {}", rest.len()), rest, sequence.faces)
    }

    /// Any mesh with made-up components.
    pub fn of_mesh(name: String, rest: Vec<[f32; 3]>, faces: Vec<[u32; 3]>) -> Self {
        let compact = compact(&rest, &faces, BIAS);
        Self::of_package(name, compact)
    }

    /// A compact package, for instance a trained one.
    pub fn of_package(name: String, compact: AlignedBytes) -> Self {
        let view = CompactView::open(&compact).expect("a sound package");
        // Bones are fitted to a thousand poses, which takes too long on the largest.
        let baked = if view.vertex_count() <= BONES_VERTICES_MAX {
            bake_with(&view, &BakeOptions::default())
        } else {
            bake(&view)
        };
        let baked = baked.expect("a mesh that can be baked");
        Self {
            name,
            rest: view.rest_positions().to_vec(),
            faces: view.faces().to_vec(),
            baked,
            compact: compact.clone(),
        }
    }

    /// A baked package of the mesh whose made-up network has no biases; without bones.
    pub fn without_bias(&self) -> AlignedBytes {
        let compact = compact(&self.rest, &self.faces, 0.0);
        let view = CompactView::open(&compact).expect("a sound package");
        bake(&view).expect("a mesh that can be baked")
    }

    /// The surface that the baker sees.
    pub fn surface(&self) -> BakedSurface {
        BakedSurface::of_package(&CompactView::open(&self.compact).expect("a sound package"))
    }

    /// Vertex whose displacement is held.
    pub fn anchor_vertex(&self) -> usize {
        CompactView::open(&self.compact)
            .expect("a sound package")
            .anchor_vertex() as usize
    }

    /// Weights of one of many poses, all components active. Shape: `[K]`; within the stops.
    pub fn pose(component_count: usize, active: usize, frame: usize) -> Vec<f32> {
        (0..component_count)
            .map(|k| {
                let phase = 0.37 * frame as f32 + 1.7 * k as f32;
                // Never zero: an inactive component would be skipped.
                if k < active {
                    0.2 + 0.6 * (0.5 + 0.5 * phase.sin())
                } else {
                    0.0
                }
            })
            .collect()
    }
}

/// A torus with a wave on it: irregular edges, no boundary.
fn torus(vertex_count: usize) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let around = ((vertex_count as f64 / 2.5).sqrt().round() as u32).max(4);
    let along = (vertex_count as f64 / f64::from(around)).round() as u32;
    let mut rest = Vec::with_capacity((around * along) as usize);
    let mut faces = Vec::new();
    for i in 0..along {
        for j in 0..around {
            let u = core::f32::consts::TAU * i as f32 / along as f32;
            let v = core::f32::consts::TAU * (j as f32 + 0.5 * (i % 2) as f32) / around as f32;
            let radius = 0.4 + 0.05 * (5.0 * u).sin() * (3.0 * v).cos();
            let ring = 1.0 + radius * v.cos();
            rest.push([ring * u.cos(), ring * u.sin(), radius * v.sin()]);
            let at = |i: u32, j: u32| (i % along) * around + j % around;
            // Rows lean by half a step, the last one onto the first as well where their number is even.
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
            if i % 2 == 0 {
                faces.extend([[a, c, b], [b, c, d]]);
            } else {
                faces.extend([[a, c, d], [a, d, b]]);
            }
        }
    }
    (rest, faces)
}

/// Repeatable numbers in [0, 1): splitmix64.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A made-up network over the mesh.
fn compact(rest: &[[f32; 3]], faces: &[[u32; 3]], bias: f32) -> AlignedBytes {
    let wide = widened(rest);
    let topology = Topology::new(faces, &wide);
    let mut noise = Noise(1);
    let vertex_count = rest.len();
    let mut blocks = Vec::new();
    for b in 0..=COARSE {
        let mut conv = || GraphConvRecord {
            point: core::array::from_fn(|i| {
                core::array::from_fn(|j| f32::from(i == j) + 0.05 * (noise.next() as f32 - 0.5))
            }),
            neighbour: core::array::from_fn(|_| core::array::from_fn(|_| 0.05 * (noise.next() as f32 - 0.5))),
            bias: core::array::from_fn(|_| bias * (noise.next() as f32 - 0.5)),
        };
        let (encoder, decoder) = (conv(), conv());
        blocks.push(BlockRecord {
            level: u32::from(b > 0),
            parent_component: if b > 0 { b as u32 - 1 } else { NONE },
            first_component: if b > 0 { (COARSE + (b - 1) * FINE) as u32 } else { 0 },
            component_count: if b > 0 { FINE } else { COARSE } as u32,
            encoder,
            decoder,
        });
    }
    let names: Vec<String> = (0..COARSE)
        .map(|k| format!("c{k}"))
        .chain((0..COARSE).flat_map(|k| (0..FINE).map(move |n| format!("c{k}.{n}"))))
        .collect();
    let words = vertex_count.div_ceil(32);
    let mut support_bits = vec![0_u32; COMPONENTS * words];
    let (mut values, mut components) = (Vec::new(), Vec::new());
    let mut coarse_centres = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let level = usize::from(k >= COARSE);
        let centre = if level == 0 {
            let centre = (noise.next() * vertex_count as f64) as usize;
            coarse_centres.push(centre);
            centre
        } else {
            // Near its parent's centre.
            let parent = coarse_centres[(k - COARSE) / FINE];
            let patch = nearest(&topology, parent, (SHARES[0] * vertex_count as f64) as usize);
            patch[(noise.next() * patch.len() as f64) as usize]
        };
        let patch = nearest(&topology, centre, (SHARES[level] * vertex_count as f64) as usize);
        let amplitude: [f64; FEATURE_COUNT] = core::array::from_fn(|_| 2.0 * noise.next() - 1.0);
        let mut own = Vec::new();
        let mut window = vec![0.0; vertex_count];
        for (n, &v) in patch.iter().enumerate() {
            window[v] = 1.0 - n as f64 / patch.len() as f64;
        }
        for v in (0..vertex_count).filter(|&v| window[v] > 0.0) {
            support_bits[k * words + v / 32] |= 1 << (v % 32);
            own.push(amplitude.map(|a| (0.5 * a * window[v]) as f32));
        }
        let value_scales = ValueScales::for_values(&own);
        values.extend(own.iter().map(|value| value_scales.round(value)));
        components.push(ComponentRecord {
            name,
            block: if level == 0 {
                0
            } else {
                ((k - COARSE) / FINE + 1) as u32
            },
            centre_vertex: centre as u32,
            scale: if level == 0 { 0.4 } else { 0.2 },
            strength: 0.1,
            locality: 1.0,
            minimum: -1.0,
            maximum: 1.0,
            value_scales,
        });
    }
    write_compact(&CompactBasis {
        rest_positions: rest,
        surface: Surface::plain(vertex_count, faces),
        bridges: &topology.bridges,
        anchor_vertex: anchor(&topology, &wide) as u32,
        rotation_scale: 0.8,
        stretch_scale: 0.2,
        blocks: &blocks,
        components: &components,
        support_bits: &support_bits,
        values: &values,
        after: After::NONE,
        prior: Prior::NONE,
        encoder: &[],
        provenance: Provenance {
            tool: "benchmark",
            sequence: "made up",
            config: "",
            seed: 1,
            shape_count: 1,
            train_shapes: &[0],
        },
        quality: Quality {
            validation_e_rms: -1.0,
            steps: 0,
            steps_run: 0,
        },
    })
    .expect("the made-up package keeps the rules")
}

/// The `count` vertices first reached from `centre` over edges.
fn nearest(topology: &Topology, centre: usize, count: usize) -> Vec<usize> {
    let mut reached = vec![false; topology.vertex_count];
    let mut queue = vec![centre];
    reached[centre] = true;
    let mut next = 0;
    while next < queue.len() && queue.len() < count.max(1) {
        for &j in topology.ring_of(queue[next]) {
            if !core::mem::replace(&mut reached[j as usize], true) {
                queue.push(j as usize);
            }
        }
        next += 1;
    }
    queue.truncate(count.max(1));
    queue
}

/// The stiffest vertex: held most firmly by its neighbours.
fn anchor(topology: &Topology, rest: &[[f64; 3]]) -> usize {
    let weights = EdgeWeights::new(topology, rest);
    let stiffness = |v: usize| weights.weights[topology.entries_of(v)].iter().sum::<f64>();
    (0..topology.vertex_count)
        .max_by(|&a, &b| stiffness(a).total_cmp(&stiffness(b)))
        .unwrap_or(0)
}
