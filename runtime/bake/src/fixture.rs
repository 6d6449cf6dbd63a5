//! A small package with everything in it, for tests: a bent grid with a separate piece, a root block and two child
//! blocks, sparse random components, convolutions that mix and lean.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sinew_formats::package::{
    After, AlignedBytes, BlockRecord, CompactBasis, ComponentRecord, FEATURE_COUNT, GraphConvRecord, NO_PIECE, NONE,
    Prior, Provenance, Quality, Surface, ValueScales, write_compact,
};

use crate::mesh::topology::Topology;

const ROWS: usize = 9;
const COLUMNS: usize = 12;

/// Components of the root block and of each of its two children.
pub const BLOCK_SIZES: [u32; 3] = [3, 2, 2];

/// A strip of ground bent over a hill, and a loose triangle beside it that hangs on bridges.
pub fn mesh() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut rest: Vec<[f32; 3]> = (0..ROWS * COLUMNS)
        .map(|v| {
            let (x, y) = ((v % COLUMNS) as f32, (v / COLUMNS) as f32);
            [x, y + 0.1 * (x * 1.7).sin(), (0.5 * x).sin() + 0.3 * (0.8 * y).cos()]
        })
        .collect();
    let mut faces = Vec::new();
    for a in (0..(ROWS - 1) * COLUMNS).filter(|v| v % COLUMNS != COLUMNS - 1) {
        let [a, b, c, d] = [a, a + 1, a + COLUMNS, a + COLUMNS + 1].map(|v| v as u32);
        faces.extend([[a, b, c], [b, d, c]]);
    }
    let first = rest.len() as u32;
    rest.extend([[3.0, 3.0, 3.0], [4.0, 3.0, 3.2], [3.5, 4.0, 3.0]]);
    faces.push([first, first + 1, first + 2]);
    (rest, faces)
}

/// The package; `identity` replaces its convolutions by ones that change nothing.
pub fn compact(seed: u64, identity: bool) -> AlignedBytes {
    let (rest, faces) = mesh();
    compact_on(&rest, &faces, seed, identity)
}

/// The same on another mesh of at least three vertices.
pub fn compact_on(rest: &[[f32; 3]], faces: &[[u32; 3]], seed: u64, identity: bool) -> AlignedBytes {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let wide: Vec<[f64; 3]> = rest.iter().map(|p| p.map(f64::from)).collect();
    let bridges = Topology::new(faces, &wide).bridges;
    let vertex_count = rest.len();
    let mut conv = |noise: f32| {
        let amount = if identity { 0.0 } else { noise };
        let mut matrix = |diagonal: f32| -> [[f32; FEATURE_COUNT]; FEATURE_COUNT] {
            core::array::from_fn(|i| {
                core::array::from_fn(|j| {
                    (if i == j { diagonal } else { 0.0 }) + amount * random.random_range(-1.0_f32..1.0)
                })
            })
        };
        let (point, neighbour) = (matrix(1.0), matrix(0.0));
        GraphConvRecord {
            point,
            neighbour,
            bias: core::array::from_fn(|_| amount * random.random_range(-1.0_f32..1.0)),
        }
    };
    let mut first_component = 0;
    let mut blocks = Vec::new();
    for (b, &component_count) in BLOCK_SIZES.iter().enumerate() {
        let (level, parent_component) = if b == 0 { (0, NONE) } else { (1, b as u32 - 1) };
        let (encoder, decoder) = (conv(0.1), conv(0.1));
        blocks.push(BlockRecord {
            level,
            parent_component,
            first_component,
            component_count,
            encoder,
            decoder,
        });
        first_component += component_count;
    }
    let component_count = first_component as usize;
    let names: Vec<String> = (0..component_count).map(|k| format!("c{k}")).collect();
    let words = vertex_count.div_ceil(32);
    let mut support_bits = vec![0_u32; component_count * words];
    let mut values = Vec::new();
    let mut components = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let centre = random.random_range(0..vertex_count);
        let radius = 4.5_f32;
        let amplitudes: [f32; FEATURE_COUNT] = core::array::from_fn(|_| random.random_range(-1.0..1.0));
        let mut own = Vec::new();
        for v in 0..vertex_count {
            let distance = (0..3)
                .map(|c| (rest[v][c] - rest[centre][c]).powi(2))
                .sum::<f32>()
                .sqrt();
            if distance < radius {
                support_bits[k * words + v / 32] |= 1 << (v % 32);
                let window = (1.0 - distance / radius) * (1.0 + 0.2 * random.random_range(-1.0_f32..1.0));
                own.push(amplitudes.map(|a| 0.3 * a * window));
            }
        }
        let value_scales = ValueScales::for_values(&own);
        values.extend(own.iter().map(|value| value_scales.round(value)));
        let block = BLOCK_SIZES.iter().scan(0, |end, size| {
            *end += size;
            Some(*end)
        });
        components.push(ComponentRecord {
            name,
            block: block.filter(|&end| end <= k as u32).count() as u32,
            centre_vertex: centre as u32,
            scale: 0.4,
            strength: 0.1,
            locality: 1.0,
            minimum: -1.0,
            maximum: 1.5,
            value_scales,
        });
    }
    // The loose triangle is a piece that lags behind; one mode bends the ground a little.
    let loose = |v: usize| v >= ROWS * COLUMNS;
    let piece_of: Vec<u16> = (0..vertex_count).map(|v| if loose(v) { 0 } else { NO_PIECE }).collect();
    let piece_offsets: Vec<[f32; 3]> = (0..component_count).map(|k| [0.02 * k as f32, -0.05, 0.01]).collect();
    let modes: Vec<[i16; 3]> = (0..vertex_count)
        .map(|v| [0, (v % 7) as i16 * 900, -(v as i16) * 100])
        .collect();
    let mix: Vec<f32> = (0..component_count).map(|k| 0.3 - 0.1 * k as f32).collect();
    // The first triangle has a texture of its own.
    let all: Vec<u32> = (0..vertex_count as u32).chain(faces[0]).collect();
    let uvs: Vec<[f32; 2]> = all
        .iter()
        .map(|&v| [rest[v as usize][0], rest[v as usize][1]])
        .collect();
    let mut render_faces = faces.to_vec();
    render_faces[0] = [0, 1, 2].map(|corner| vertex_count as u32 + corner);
    let bytes = write_compact(&CompactBasis {
        rest_positions: rest,
        surface: Surface::textured(vertex_count, &render_faces, &all, &uvs),
        bridges: &bridges,
        anchor_vertex: 5.min(vertex_count as u32 - 1),
        rotation_scale: 1.5,
        stretch_scale: 0.8,
        blocks: &blocks,
        components: &components,
        support_bits: &support_bits,
        values: &values,
        after: After {
            piece_of: &piece_of,
            piece_offsets: &piece_offsets,
            mix: &mix,
            modes: &modes,
            mode_scales: &[1e-6],
        },
        prior: Prior {
            mean: &vec![0.1; component_count],
            factors: &(0..component_count)
                .map(|k| 0.2 - 0.05 * k as f32)
                .collect::<Vec<f32>>(),
            variances: &vec![0.04; component_count],
            strength: 1e-4,
        },
        encoder: &[],
        provenance: Provenance {
            tool: "test",
            sequence: "grid",
            config: "",
            seed,
            shape_count: 2,
            train_shapes: &[0, 1],
        },
        quality: Quality {
            validation_e_rms: -1.0,
            steps: 0,
            steps_run: 0,
        },
    });
    bytes.expect("the fixture keeps the format's rules")
}
