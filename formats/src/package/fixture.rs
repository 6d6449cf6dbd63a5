//! Hand-made packages small enough to break byte by byte: a bumpy 3 x 3 grid with a root block of two components and a
//! block on each. Feature `fixture`; nothing on the path of data uses it.
//!
//! The mesh, its Laplacian and its factor belong together, and the baked package is folded from the compact one, so
//! that a frame runs on it: the smallest worked example of what a baker does, dense and plain.

use alloc::vec::Vec;

mod after;
mod bones;
mod surface;

pub use after::{TinyAfter, TinyPrior};
pub use bones::TinyBones;
pub use surface::TinySurface;

use super::{
    BakedBasis, BakedBlock, BakedComponent, BakedExact, BakedSolve, BlockRecord, CompactBasis, ComponentRecord,
    FAN_VERTICES, FEATURE_COUNT, Fans, GraphConvRecord, Header, Indices, NONE, PackageKind, Patches, Provenance, QUAD,
    Quality, TILE_ENTRIES, ValueScales, write_compact,
};

/// V of the grid.
pub const VERTEX_COUNT: usize = 9;
/// K: two coarse components, one fine component on each.
pub const COMPONENT_COUNT: usize = 4;
/// Order of decoding: the elimination order backwards, which takes the middle of the grid last.
pub const VERTEX_FROM_SLOT: [u32; VERTEX_COUNT] = [4, 7, 5, 3, 1, 8, 6, 2, 0];
/// The vertex that the solve holds.
pub const ANCHOR_VERTEX: u32 = 0;

/// Owns what a [`CompactBasis`] borrows; a test changes a field and writes.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "fields are those of CompactBasis")]
pub struct TinyCompact {
    pub rest_positions: Vec<[f32; 3]>,
    pub surface: TinySurface,
    pub bridges: Vec<[u32; 2]>,
    pub anchor_vertex: u32,
    pub rotation_scale: f32,
    pub stretch_scale: f32,
    pub blocks: Vec<BlockRecord>,
    pub components: Vec<ComponentRecord<'static>>,
    pub support_bits: Vec<u32>,
    pub values: Vec<[i16; FEATURE_COUNT]>,
    pub after: TinyAfter,
    pub prior: TinyPrior,
    pub encoder: Vec<u8>,
    pub provenance: Provenance<'static>,
    pub quality: Quality,
}

/// Owns what a [`BakedBasis`] borrows; a test changes a field and writes.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "fields are those of BakedBasis")]
pub struct TinyBaked {
    pub compact_id: [u8; 16],
    pub rotation_scale: f32,
    pub stretch_scale: f32,
    pub blocks: Vec<BakedBlock>,
    pub components: Vec<BakedComponent<'static>>,
    pub rest_positions: Vec<[f32; 3]>,
    pub slot_from_vertex: Vec<u32>,
    pub vertex_from_slot: Vec<u32>,
    pub surface: TinySurface,
    pub fan_offsets: Vec<u32>,
    pub fans: Vec<[u32; FAN_VERTICES]>,
    pub exact: TinyTier,
    pub has_exact: bool,
    pub bones: Option<TinyBones>,
    pub after: TinyAfter,
    pub prior: TinyPrior,
}

/// Owns what a [`BakedExact`] borrows: patches, and a [`BakedSolve`].
#[derive(Debug, Clone, Default)]
#[expect(missing_docs, reason = "fields are those of BakedPatches and BakedSolve")]
pub struct TinyTier {
    pub patches: Patches,
    pub ring_offsets: Vec<u32>,
    pub ring: Vec<u32>,
    pub ring_weights: Vec<f32>,
    pub tile_offsets: Vec<u32>,
    pub tile_rows: Vec<u32>,
    pub tiles: Vec<[f32; TILE_ENTRIES]>,
    pub inverse_diagonals: Vec<[f32; TILE_ENTRIES]>,
    pub solver_from_slot: Vec<u32>,
}

impl TinyCompact {
    /// Borrowed, ready to be written.
    pub fn basis(&self) -> CompactBasis<'_> {
        CompactBasis {
            rest_positions: &self.rest_positions,
            surface: self.surface.record(self.rest_positions.len()),
            bridges: &self.bridges,
            anchor_vertex: self.anchor_vertex,
            rotation_scale: self.rotation_scale,
            stretch_scale: self.stretch_scale,
            blocks: &self.blocks,
            components: &self.components,
            support_bits: &self.support_bits,
            values: &self.values,
            after: self.after.record(),
            prior: self.prior.record(),
            encoder: &self.encoder,
            provenance: self.provenance,
            quality: self.quality,
        }
    }
}

impl TinyBaked {
    /// Borrowed, ready to be written.
    pub fn basis(&self) -> BakedBasis<'_> {
        let vertex_count = self.rest_positions.len();
        BakedBasis {
            compact_id: self.compact_id,
            rotation_scale: self.rotation_scale,
            stretch_scale: self.stretch_scale,
            blocks: &self.blocks,
            components: &self.components,
            rest_positions: &self.rest_positions,
            slot_from_vertex: Indices::of(vertex_count, &self.slot_from_vertex),
            vertex_from_slot: Indices::of(vertex_count, &self.vertex_from_slot),
            surface: self.surface.record(vertex_count),
            fan_offsets: &self.fan_offsets,
            fans: Indices::of(vertex_count, self.fans.as_flattened()),
            exact: self.has_exact.then(|| BakedExact {
                patches: self.exact.patches.record(),
                solve: self.exact.solve(vertex_count),
            }),
            bones: self.bones.as_ref().map(TinyBones::record),
            after: self.after.record(),
            prior: self.prior.record(),
        }
    }
}

impl TinyTier {
    fn solve(&self, node_count: usize) -> BakedSolve<'_> {
        BakedSolve {
            ring_offsets: &self.ring_offsets,
            ring: Indices::of(node_count, &self.ring),
            ring_weights: &self.ring_weights,
            tile_offsets: &self.tile_offsets,
            tile_rows: Indices::of(node_count, &self.tile_rows),
            tiles: &self.tiles,
            inverse_diagonals: &self.inverse_diagonals,
            solver_from_slot: Indices::of(node_count, &self.solver_from_slot),
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
        value_scales: ValueScales {
            rotation: 0.5 / 65_536.0,
            stretch: 0.25 / 65_536.0,
        },
    };
    // Rows 0 and 1 of the grid; rows 1 and 2; a corner each.
    let supports: [&[usize]; COMPONENT_COUNT] = [&[0, 1, 2, 3, 4, 5], &[3, 4, 5, 6, 7, 8], &[1, 2], &[6, 7]];
    let values = supports.iter().enumerate().flat_map(|(k, support)| {
        support.iter().map(move |&v| {
            core::array::from_fn(|i| {
                let step = ((3 * k + 5 * v + 7 * i) % 17) as i16;
                4000 * (step - 8)
            })
        })
    });
    TinyCompact {
        rest_positions: rest_positions(),
        surface: TinySurface::with_seam(&rest_positions(), &faces()),
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
        after: TinyAfter::of_the_grid(),
        prior: TinyPrior::of_the_grid(),
        encoder: alloc::vec![1, 2, 3],
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
    }
}

/// The baked package of [`tiny_compact`].
pub fn tiny_baked() -> TinyBaked {
    let compact = tiny_compact();
    let weights = edge_weights();
    let slot_from_vertex: Vec<u32> = (0..VERTEX_COUNT as u32)
        .map(|vertex| VERTEX_FROM_SLOT.iter().position(|&v| v == vertex).unwrap_or_default() as u32)
        .collect();
    let mut exact = TinyTier {
        ring_offsets: alloc::vec![0],
        solver_from_slot: (0..VERTEX_COUNT as u32).rev().collect(),
        ..TinyTier::default()
    };
    for row in 0..VERTEX_COUNT {
        for column in 0..VERTEX_COUNT {
            if let Some(weight) = weights[VERTEX_FROM_SLOT[row] as usize][VERTEX_FROM_SLOT[column] as usize] {
                exact.ring.push(column as u32);
                exact.ring_weights.push(weight);
            }
        }
        exact.ring_offsets.push(exact.ring.len() as u32);
    }
    factorize(&mut exact, slot_from_vertex[ANCHOR_VERTEX as usize] as usize);
    let scales = fold(&compact, &mut exact);
    let fans = Fans::gather(&faces(), &slot_from_vertex);
    let components = compact.components.iter().zip(scales);
    TinyBaked {
        compact_id: compact_id(&compact),
        rotation_scale: compact.rotation_scale,
        stretch_scale: compact.stretch_scale,
        blocks: compact.blocks.iter().map(baked_block).collect(),
        components: components
            .map(|(component, scales)| baked_component(component, scales))
            .collect(),
        rest_positions: VERTEX_FROM_SLOT.map(|v| compact.rest_positions[v as usize]).to_vec(),
        surface: compact.surface.in_slots(&slot_from_vertex),
        slot_from_vertex,
        vertex_from_slot: VERTEX_FROM_SLOT.to_vec(),
        fan_offsets: fans.fan_offsets,
        fans: fans.fans,
        exact,
        has_exact: true,
        bones: None,
        after: compact.after.in_slots(),
        prior: compact.prior,
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

fn baked_component(component: &ComponentRecord<'static>, value_scales: ValueScales) -> BakedComponent<'static> {
    BakedComponent {
        name: component.name,
        block: component.block,
        minimum: component.minimum,
        maximum: component.maximum,
        value_scales,
    }
}

/// The Laplacian, with 1 added at the anchor (a slot), to `F D F^T` by blocks, dense.
fn factorize(tier: &mut TinyTier, anchor: usize) {
    const QUAD_COUNT: usize = VERTEX_COUNT.div_ceil(QUAD);
    // Where the last quad has no node it has a node of its own, so that it can be inverted.
    let mut lower = [[0.0_f64; QUAD_COUNT * QUAD]; QUAD_COUNT * QUAD];
    let solver = |slot: usize| tier.solver_from_slot[slot] as usize;
    for slot in 0..VERTEX_COUNT {
        let row = solver(slot);
        for entry in tier.ring_offsets[slot] as usize..tier.ring_offsets[slot + 1] as usize {
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
    for column in 0..QUAD_COUNT {
        let own = column * QUAD..(column + 1) * QUAD;
        let inverse = inverse(core::array::from_fn(|r| {
            core::array::from_fn(|c| lower[own.start + r][own.start + c])
        }));
        tier.inverse_diagonals.push(core::array::from_fn(|n| {
            let (r, c) = (n / QUAD, n % QUAD);
            let is_node = own.start + r.max(c) < VERTEX_COUNT;
            if is_node { inverse[r][c] as f32 } else { 0.0 }
        }));
        let rest = own.end..QUAD_COUNT * QUAD;
        let before = lower;
        for row in rest.clone() {
            for c in 0..QUAD {
                lower[row][own.start + c] = (0..QUAD).map(|n| before[row][own.start + n] * inverse[n][c]).sum();
            }
            for other in rest.clone() {
                let update = own.clone().map(|n| lower[row][n] * before[other][n]);
                lower[row][other] -= update.sum::<f64>();
            }
        }
        for row in column + 1..QUAD_COUNT {
            let tile: [f32; TILE_ENTRIES] =
                core::array::from_fn(|n| lower[row * QUAD + n % QUAD][own.start + n / QUAD] as f32);
            if tile != [0.0; TILE_ENTRIES] {
                tier.tile_rows.push(row as u32);
                tier.tiles.push(tile);
            }
        }
        tier.tile_offsets.push(tier.tile_rows.len() as u32);
    }
}

/// Gauss and Jordan's, of a positive definite matrix.
fn inverse(mut matrix: [[f64; QUAD]; QUAD]) -> [[f64; QUAD]; QUAD] {
    for n in 0..QUAD {
        let pivot = matrix[n][n];
        matrix[n][n] = 1.0;
        matrix[n] = matrix[n].map(|value| value / pivot);
        let row = matrix[n];
        for other in (0..QUAD).filter(|&other| other != n) {
            let share = matrix[other][n];
            matrix[other][n] = 0.0;
            for c in 0..QUAD {
                matrix[other][c] -= share * row[c];
            }
        }
    }
    matrix
}

/// Multiplies the components by the decoders: `point C_k + neighbour mean C_k`, on supports grown by a ring. Gives the scales.
fn fold(compact: &TinyCompact, tier: &mut TinyTier) -> Vec<ValueScales> {
    let dense = dense_components(compact);
    let (mut entries, mut all_scales) = (Vec::new(), Vec::new());
    for (k, component) in compact.components.iter().enumerate() {
        let decoder = &compact.blocks[component.block as usize].decoder;
        let folded = convolve(decoder, &dense[k], tier);
        let scales = ValueScales::for_values(&folded);
        for (slot, values) in folded.iter().enumerate() {
            if *values != [0.0; FEATURE_COUNT] {
                entries.push((k, component.block, slot as u32, scales.round(values)));
            }
        }
        all_scales.push(scales);
    }
    tier.patches = Patches::gather(VERTEX_COUNT, entries);
    all_scales
}

/// Components everywhere. Shape: `[K][V]`, source order.
fn dense_components(compact: &TinyCompact) -> Vec<[[f32; FEATURE_COUNT]; VERTEX_COUNT]> {
    let mut values = compact.values.iter();
    let components = compact.support_bits.iter().zip(&compact.components);
    let dense = components.map(|(bits, component)| {
        core::array::from_fn(|v| match bits >> v & 1 {
            1 => values
                .next()
                .map_or([0.0; FEATURE_COUNT], |whole| component.value_scales.widen(whole)),
            _ => [0.0; FEATURE_COUNT],
        })
    });
    dense.collect()
}

/// One component through a convolution without its bias; in source order, out in slots.
fn convolve(
    conv: &GraphConvRecord,
    component: &[[f32; FEATURE_COUNT]; VERTEX_COUNT],
    tier: &TinyTier,
) -> Vec<[f32; FEATURE_COUNT]> {
    let in_slots = |slot: u32| component[VERTEX_FROM_SLOT[slot as usize] as usize];
    let product = |matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT], input: [f32; FEATURE_COUNT]| {
        matrix.map(|row| row.iter().zip(input).map(|(a, x)| a * x).sum::<f32>())
    };
    let convolved = (0..VERTEX_COUNT).map(|slot| {
        let ring = &tier.ring[tier.ring_offsets[slot] as usize..tier.ring_offsets[slot + 1] as usize];
        let mean: [f32; FEATURE_COUNT] =
            core::array::from_fn(|i| ring.iter().map(|&other| in_slots(other)[i]).sum::<f32>() / ring.len() as f32);
        let (point, neighbour) = (
            product(&conv.point, in_slots(slot as u32)),
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
