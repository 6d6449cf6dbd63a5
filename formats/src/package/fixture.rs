//! Hand-made packages small enough to break byte by byte: a bumpy 3 x 3 grid with a root block of two components and a
//! block on each. Feature `fixture`; nothing on the path of data uses it.
//!
//! The mesh, its Laplacian and its factor belong together, and the baked package is folded from the compact one, so
//! that a frame runs on it: the smallest worked example of what a baker does, dense and plain.

use alloc::vec::Vec;

use half::f16;

mod fast;
mod render;

pub use fast::TinyFast;
pub use render::TinyRender;

use super::{
    BakedBasis, BakedBlock, BakedComponent, BakedTier, BlockRecord, CompactBasis, ComponentRecord, FAN_VERTICES,
    FEATURE_COUNT, Fans, GraphConvRecord, Header, NONE, PackageKind, Patch, Patches, Provenance, Quality, TILE_ENTRIES,
    TILE_SIDE, write_compact,
};

/// V of the grid.
pub const VERTEX_COUNT: usize = 9;
/// K: two coarse components, one fine component on each.
pub const COMPONENT_COUNT: usize = 4;
/// Order of decoding: the elimination order backwards, which takes the middle of the grid last.
pub const VERTEX_FROM_LANE: [u32; VERTEX_COUNT] = [4, 7, 5, 3, 1, 8, 6, 2, 0];
/// The vertex that the solve holds.
pub const ANCHOR_VERTEX: u32 = 0;

/// Owns what a [`CompactBasis`] borrows; a test changes a field and writes.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "fields are those of CompactBasis")]
pub struct TinyCompact {
    pub rest_positions: Vec<[f32; 3]>,
    pub faces: Vec<[u32; 3]>,
    pub bridges: Vec<[u32; 2]>,
    pub anchor_vertex: u32,
    pub rotation_scale: f32,
    pub stretch_scale: f32,
    pub blocks: Vec<BlockRecord>,
    pub components: Vec<ComponentRecord<'static>>,
    pub support_bits: Vec<u32>,
    pub values: Vec<[u16; FEATURE_COUNT]>,
    pub provenance: Provenance<'static>,
    pub quality: Quality,
    pub render: TinyRender,
}

/// Owns what a [`BakedBasis`] borrows; a test changes a field and writes.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "fields are those of BakedBasis")]
pub struct TinyBaked {
    pub compact_id: [u8; 16],
    pub faces: Vec<[u32; 3]>,
    pub lane_from_vertex: Vec<u32>,
    pub vertex_from_lane: Vec<u32>,
    pub rotation_scale: f32,
    pub stretch_scale: f32,
    pub blocks: Vec<BakedBlock>,
    pub components: Vec<BakedComponent<'static>>,
    pub fan_offsets: Vec<u32>,
    pub fans: Vec<[u32; FAN_VERTICES]>,
    pub exact: TinyTier,
    pub fast: Option<TinyFast>,
    pub render: TinyRender,
}

/// Owns what a [`BakedTier`] borrows.
#[derive(Debug, Clone, Default)]
#[expect(missing_docs, reason = "fields are those of BakedTier")]
pub struct TinyTier {
    pub rest_positions: Vec<[f32; 3]>,
    pub ring_offsets: Vec<u32>,
    pub ring: Vec<u32>,
    pub ring_weights: Vec<f32>,
    pub tile_offsets: Vec<u32>,
    pub tile_rows: Vec<u32>,
    pub tiles: Vec<[f32; TILE_ENTRIES]>,
    pub inverse_diagonals: Vec<[f32; TILE_ENTRIES]>,
    pub solver_from_lane: Vec<u32>,
    pub lane_from_solver: Vec<u32>,
    pub patch_offsets: Vec<u32>,
    pub patch_owners: Vec<[u16; 2]>,
    pub patch_values: Vec<Patch>,
}

impl TinyCompact {
    /// Borrowed, ready to be written.
    pub fn basis(&self) -> CompactBasis<'_> {
        CompactBasis {
            rest_positions: &self.rest_positions,
            faces: &self.faces,
            bridges: &self.bridges,
            anchor_vertex: self.anchor_vertex,
            rotation_scale: self.rotation_scale,
            stretch_scale: self.stretch_scale,
            blocks: &self.blocks,
            components: &self.components,
            support_bits: &self.support_bits,
            values: &self.values,
            provenance: self.provenance,
            quality: self.quality,
            render: self.render.mesh(),
        }
    }
}

impl TinyBaked {
    /// Borrowed, ready to be written.
    pub fn basis(&self) -> BakedBasis<'_> {
        BakedBasis {
            compact_id: self.compact_id,
            faces: &self.faces,
            lane_from_vertex: &self.lane_from_vertex,
            vertex_from_lane: &self.vertex_from_lane,
            rotation_scale: self.rotation_scale,
            stretch_scale: self.stretch_scale,
            blocks: &self.blocks,
            components: &self.components,
            fan_offsets: &self.fan_offsets,
            fans: &self.fans,
            exact: self.exact.tier(),
            fast: self.fast.as_ref().map(TinyFast::fast),
            render: self.render.mesh(),
        }
    }
}

impl TinyTier {
    fn tier(&self) -> BakedTier<'_> {
        BakedTier {
            rest_positions: &self.rest_positions,
            ring_offsets: &self.ring_offsets,
            ring: &self.ring,
            ring_weights: &self.ring_weights,
            tile_offsets: &self.tile_offsets,
            tile_rows: &self.tile_rows,
            tiles: &self.tiles,
            inverse_diagonals: &self.inverse_diagonals,
            solver_from_lane: &self.solver_from_lane,
            lane_from_solver: &self.lane_from_solver,
            patch_offsets: &self.patch_offsets,
            patch_owners: &self.patch_owners,
            patch_values: &self.patch_values,
        }
    }
}

/// The compact package.
pub fn tiny_compact() -> TinyCompact {
    let block = |level, parent_component, first_component, component_count| BlockRecord {
        level,
        parent_component,
        first_component,
        component_count,
        encoder: convolution(0.5, 0.25, 0.0),
        decoder: convolution(0.75, 0.25, 0.0625),
    };
    let component = |name, block, centre_vertex, scale| ComponentRecord {
        name,
        block,
        centre_vertex,
        scale,
        strength: 0.125,
        locality: 0.875,
        minimum: -1.5,
        maximum: 2.0,
        value_scale: 0.5,
    };
    // Rows 0 and 1 of the grid; rows 1 and 2; a corner each.
    let supports: [&[usize]; COMPONENT_COUNT] = [&[0, 1, 2, 3, 4, 5], &[3, 4, 5, 6, 7, 8], &[1, 2], &[6, 7]];
    let values = supports.iter().enumerate().flat_map(|(k, support)| {
        support.iter().map(move |&v| {
            core::array::from_fn(|i| {
                let step = ((3 * k + 5 * v + 7 * i) % 17) as f32;
                f16::from_f32((step - 8.0) / 16.0).to_bits()
            })
        })
    });
    TinyCompact {
        rest_positions: rest_positions(),
        faces: faces(),
        bridges: alloc::vec![[0, 8]],
        anchor_vertex: ANCHOR_VERTEX,
        rotation_scale: 0.75,
        stretch_scale: 0.25,
        blocks: alloc::vec![block(0, NONE, 0, 2), block(1, 0, 2, 1), block(1, 1, 3, 1)],
        components: alloc::vec![
            component("c00", 0, 1, 0.5),
            component("c01", 0, 7, 0.5),
            component("c00.f0", 1, 2, 0.25),
            component("c01.f0", 2, 6, 0.25),
        ],
        support_bits: supports
            .iter()
            .map(|support| support.iter().map(|v| 1 << v).sum())
            .collect(),
        values: values.collect(),
        provenance: Provenance {
            tool: "hand-made",
            sequence: "grid",
            config: "seed = 7\n",
            seed: 7,
            shape_count: 4,
            train_shapes: &[0, 2],
        },
        quality: Quality {
            validation_e_rms: 1.25,
            steps: 30,
            steps_run: 40,
        },
        render: TinyRender::with_seam(&rest_positions(), &faces()),
    }
}

/// The baked package of [`tiny_compact`].
pub fn tiny_baked() -> TinyBaked {
    let compact = tiny_compact();
    let weights = edge_weights();
    let lane_from_vertex: Vec<u32> = (0..VERTEX_COUNT as u32)
        .map(|vertex| VERTEX_FROM_LANE.iter().position(|&v| v == vertex).unwrap_or_default() as u32)
        .collect();
    let mut exact = TinyTier {
        rest_positions: VERTEX_FROM_LANE.map(|v| compact.rest_positions[v as usize]).to_vec(),
        ring_offsets: alloc::vec![0],
        solver_from_lane: (0..VERTEX_COUNT as u32).rev().collect(),
        lane_from_solver: (0..VERTEX_COUNT as u32).rev().collect(),
        ..TinyTier::default()
    };
    for row in 0..VERTEX_COUNT {
        for column in 0..VERTEX_COUNT {
            if let Some(weight) = weights[VERTEX_FROM_LANE[row] as usize][VERTEX_FROM_LANE[column] as usize] {
                exact.ring.push(column as u32);
                exact.ring_weights.push(weight);
            }
        }
        exact.ring_offsets.push(exact.ring.len() as u32);
    }
    factorize(&mut exact, lane_from_vertex[ANCHOR_VERTEX as usize] as usize);
    fold(&compact, &mut exact);
    let fans = Fans::gather(&compact.faces, &lane_from_vertex);
    TinyBaked {
        compact_id: compact_id(&compact),
        faces: compact.faces.clone(),
        lane_from_vertex,
        vertex_from_lane: VERTEX_FROM_LANE.to_vec(),
        rotation_scale: compact.rotation_scale,
        stretch_scale: compact.stretch_scale,
        blocks: compact.blocks.iter().map(baked_block).collect(),
        components: compact.components.iter().map(baked_component).collect(),
        fan_offsets: fans.fan_offsets,
        fans: fans.fans,
        exact,
        fast: None,
        render: compact.render.clone(),
    }
}

fn baked_block(block: &BlockRecord) -> BakedBlock {
    BakedBlock {
        level: block.level,
        parent_component: block.parent_component,
        first_component: block.first_component,
        component_count: block.component_count,
        bias: block.decoder.bias,
    }
}

fn baked_component(component: &ComponentRecord<'static>) -> BakedComponent<'static> {
    BakedComponent {
        name: component.name,
        block: component.block,
        minimum: component.minimum,
        maximum: component.maximum,
        value_scale: component.value_scale,
    }
}

/// The Laplacian, with 1 added at the anchor (a lane), to `F D F^T` by blocks, dense.
fn factorize(tier: &mut TinyTier, anchor: usize) {
    const BLOCK_COUNT: usize = VERTEX_COUNT.div_ceil(TILE_SIDE);
    // Where the last block has no node it has a node of its own, so that it can be inverted.
    let mut lower = [[0.0_f64; BLOCK_COUNT * TILE_SIDE]; BLOCK_COUNT * TILE_SIDE];
    let solver = |lane: usize| tier.solver_from_lane[lane] as usize;
    for lane in 0..VERTEX_COUNT {
        let row = solver(lane);
        for entry in tier.ring_offsets[lane] as usize..tier.ring_offsets[lane + 1] as usize {
            let weight = f64::from(tier.ring_weights[entry]);
            lower[row][row] += weight;
            lower[row][solver(tier.ring[entry] as usize)] -= weight;
        }
    }
    lower[solver(anchor)][solver(anchor)] += 1.0;
    for (row, entries) in lower.iter_mut().enumerate().skip(VERTEX_COUNT) {
        entries[row] = 1.0;
    }
    tier.tile_offsets.push(0);
    for column in 0..BLOCK_COUNT {
        let own = column * TILE_SIDE..(column + 1) * TILE_SIDE;
        let inverse = inverse(core::array::from_fn(|r| {
            core::array::from_fn(|c| lower[own.start + r][own.start + c])
        }));
        tier.inverse_diagonals.push(core::array::from_fn(|n| {
            let (r, c) = (n / TILE_SIDE, n % TILE_SIDE);
            let is_node = own.start + r.max(c) < VERTEX_COUNT;
            if is_node { inverse[r][c] as f32 } else { 0.0 }
        }));
        let rest = own.end..BLOCK_COUNT * TILE_SIDE;
        let before = lower;
        for row in rest.clone() {
            for c in 0..TILE_SIDE {
                lower[row][own.start + c] = (0..TILE_SIDE).map(|n| before[row][own.start + n] * inverse[n][c]).sum();
            }
            for other in rest.clone() {
                let update = own.clone().map(|n| lower[row][n] * before[other][n]);
                lower[row][other] -= update.sum::<f64>();
            }
        }
        for row in column + 1..BLOCK_COUNT {
            let tile: [f32; TILE_ENTRIES] =
                core::array::from_fn(|n| lower[row * TILE_SIDE + n / TILE_SIDE][own.start + n % TILE_SIDE] as f32);
            if tile != [0.0; TILE_ENTRIES] {
                tier.tile_rows.push(row as u32);
                tier.tiles.push(tile);
            }
        }
        tier.tile_offsets.push(tier.tile_rows.len() as u32);
    }
}

/// Gauss and Jordan's, of a positive definite matrix.
fn inverse(mut matrix: [[f64; TILE_SIDE]; TILE_SIDE]) -> [[f64; TILE_SIDE]; TILE_SIDE] {
    for n in 0..TILE_SIDE {
        let pivot = matrix[n][n];
        matrix[n][n] = 1.0;
        matrix[n] = matrix[n].map(|value| value / pivot);
        let row = matrix[n];
        for other in (0..TILE_SIDE).filter(|&other| other != n) {
            let share = matrix[other][n];
            matrix[other][n] = 0.0;
            for c in 0..TILE_SIDE {
                matrix[other][c] -= share * row[c];
            }
        }
    }
    matrix
}

/// Multiplies the components by the decoders: `point C_k + neighbour mean C_k`, on supports grown by a ring.
fn fold(compact: &TinyCompact, tier: &mut TinyTier) {
    let dense = dense_components(compact);
    let mut entries = Vec::new();
    for (k, component) in compact.components.iter().enumerate() {
        let decoder = &compact.blocks[component.block as usize].decoder;
        for (lane, values) in convolve(decoder, &dense[k], tier).into_iter().enumerate() {
            if values != [0.0; FEATURE_COUNT] {
                let halves = values.map(|value| f16::from_f32(value).to_bits());
                entries.push((k, component.block, lane as u32, halves));
            }
        }
    }
    let patches = Patches::gather(VERTEX_COUNT, entries);
    tier.patch_offsets = patches.patch_offsets;
    tier.patch_owners = patches.patch_owners;
    tier.patch_values = patches.patch_values;
}

/// Components without their value scales. Shape: `[K][V]`, source order.
fn dense_components(compact: &TinyCompact) -> Vec<[[f32; FEATURE_COUNT]; VERTEX_COUNT]> {
    let mut values = compact.values.iter();
    let dense = compact.support_bits.iter().map(|bits| {
        core::array::from_fn(|v| match bits >> v & 1 {
            1 => values.next().map_or([0.0; FEATURE_COUNT], |halves| {
                halves.map(|half| f16::from_bits(half).to_f32())
            }),
            _ => [0.0; FEATURE_COUNT],
        })
    });
    dense.collect()
}

/// One component through a convolution without its bias; in source order, out in lanes.
fn convolve(
    conv: &GraphConvRecord,
    component: &[[f32; FEATURE_COUNT]; VERTEX_COUNT],
    tier: &TinyTier,
) -> Vec<[f32; FEATURE_COUNT]> {
    let in_lanes = |lane: u32| component[VERTEX_FROM_LANE[lane as usize] as usize];
    let product = |matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT], input: [f32; FEATURE_COUNT]| {
        matrix.map(|row| row.iter().zip(input).map(|(a, x)| a * x).sum::<f32>())
    };
    let convolved = (0..VERTEX_COUNT).map(|lane| {
        let ring = &tier.ring[tier.ring_offsets[lane] as usize..tier.ring_offsets[lane + 1] as usize];
        let mean: [f32; FEATURE_COUNT] =
            core::array::from_fn(|i| ring.iter().map(|&other| in_lanes(other)[i]).sum::<f32>() / ring.len() as f32);
        let (point, neighbour) = (
            product(&conv.point, in_lanes(lane as u32)),
            product(&conv.neighbour, mean),
        );
        core::array::from_fn(|i| point[i] + neighbour[i])
    });
    convolved.collect()
}

/// A grid of unit squares, its middle raised.
fn rest_positions() -> Vec<[f32; 3]> {
    (0..VERTEX_COUNT)
        .map(|v| [(v % 3) as f32, (v / 3) as f32, if v == 4 { 0.5 } else { 0.0 }])
        .collect()
}

/// Two triangles a square, counter-clockwise from above.
fn faces() -> Vec<[u32; 3]> {
    [0, 1, 3, 4]
        .iter()
        .flat_map(|&v: &u32| [[v, v + 1, v + 4], [v, v + 4, v + 3]])
        .collect()
}

/// Half the cotangent sum of each edge, at least 0, and 1 for the bridge; none where no edge is.
fn edge_weights() -> [[Option<f32>; VERTEX_COUNT]; VERTEX_COUNT] {
    let positions = rest_positions();
    let mut weights = [[None; VERTEX_COUNT]; VERTEX_COUNT];
    for face in faces() {
        for corner in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|turn| face[(corner + turn) % 3] as usize);
            let leg = |to: usize| -> [f64; 3] {
                core::array::from_fn(|i| f64::from(positions[to][i]) - f64::from(positions[a][i]))
            };
            let dot = |x: [f64; 3], y: [f64; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
            let (u, w) = (leg(b), leg(c));
            let sine_squared = dot(u, u) * dot(w, w) - dot(u, w) * dot(u, w);
            let half_cotangent = (0.5 * dot(u, w) / square_root(sine_squared)) as f32;
            let sum: f32 = weights[b][c].unwrap_or(0.0) + half_cotangent;
            weights[b][c] = Some(sum);
            weights[c][b] = Some(sum);
        }
    }
    for weight in weights.as_flattened_mut().iter_mut().flatten() {
        *weight = weight.max(0.0);
    }
    weights[0][8] = Some(1.0);
    weights[8][0] = Some(1.0);
    weights
}

/// Newton's steps, as `core` has no square root: the same bits everywhere.
fn square_root(square: f64) -> f64 {
    const STEPS: usize = 40;
    (0..STEPS).fold(square.max(1.0), |root, _| 0.5 * (root + square / root))
}

/// A matrix near a multiple of the identity, with a little of each neighbour in the list.
fn convolution(point: f32, neighbour: f32, bias: f32) -> GraphConvRecord {
    let matrix = |diagonal: f32| {
        core::array::from_fn(|row: usize| {
            core::array::from_fn(|column: usize| match row.abs_diff(column) {
                0 => diagonal,
                1 => diagonal / 16.0,
                _ => 0.0,
            })
        })
    };
    GraphConvRecord {
        point: matrix(point),
        neighbour: matrix(neighbour),
        bias: core::array::from_fn(|i| bias * i as f32 / FEATURE_COUNT as f32),
    }
}

/// The id that the compact package gets when it is written.
fn compact_id(compact: &TinyCompact) -> [u8; 16] {
    write_compact(&compact.basis())
        .ok()
        .and_then(|bytes| Header::read(&bytes).ok())
        .filter(|header| header.kind == PackageKind::Compact)
        .map_or([0; 16], |header| header.content_id)
}
