//! The compact payload: rest shape, component tree, sparse components as whole numbers, the network around them, and where
//! they come from. Written by the trainer, read by the baker and by the evaluator.

use rkyv::{Archive, Serialize, with::InlineAsBox};

use super::{After, FEATURE_COUNT, Prior, Surface, ValueScales};

/// What the trainer learned, small enough to ship: V vertices, F faces, B blocks, K components.
#[derive(Archive, Serialize, Debug)]
pub struct CompactBasis<'a> {
    /// Rest shape in the order of the source files. Shape: `[V]`, units of the source.
    #[rkyv(with = InlineAsBox)]
    pub rest_positions: &'a [[f32; 3]],
    /// Triangles and what an engine draws. Points are vertices.
    pub surface: Surface<'a>,
    /// Extra edges `[from, to]` that tie separate pieces and loose vertices to the rest, sorted, `from < to`.
    #[rkyv(with = InlineAsBox)]
    pub bridges: &'a [[u32; 2]],
    /// The vertex whose displacement the solve holds at zero (the null space of the Laplacian is one translation).
    pub anchor_vertex: u32,
    /// Network value to log-rotation: `r = rotation_scale * x`, radians. Positive.
    pub rotation_scale: f32,
    /// Network value to stretch: `S = I + stretch_scale * x`. Positive.
    pub stretch_scale: f32,
    /// Autoencoder blocks, parents before children, coarse to fine. Shape: `[B]`, at least one.
    #[rkyv(with = InlineAsBox)]
    pub blocks: &'a [BlockRecord],
    /// Components in block order. Shape: `[K]`.
    #[rkyv(with = InlineAsBox)]
    pub components: &'a [ComponentRecord<'a>],
    /// Where each component is not zero, one bit a vertex, lowest bit first. Shape: `[K][ceil(V / 32)]`; unused high bits zero.
    #[rkyv(with = InlineAsBox)]
    pub support_bits: &'a [u32],
    /// Values of the components on their supports as whole numbers, in order of component, then vertex; times the
    /// component's scales. Shape: `[sum of popcounts]`.
    #[rkyv(with = InlineAsBox)]
    pub values: &'a [[i16; FEATURE_COUNT]],
    /// What is added to positions after the solve. Points are vertices.
    pub after: After<'a>,
    /// What is known of the weights.
    pub prior: Prior<'a>,
    /// What reading weights off a shape with the network needs besides, in the trainer's own form; may be empty. Neither the
    /// baker nor the runtime looks at it.
    #[rkyv(with = InlineAsBox)]
    pub encoder: &'a [u8],
    /// Where the package comes from.
    pub provenance: Provenance<'a>,
    /// What the trainer measured.
    pub quality: Quality,
}

/// One autoencoder block (method section 2): its convolutions, and which components are its latents.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct BlockRecord {
    /// 0 for the root block, one more than the parent's block otherwise.
    pub level: u32,
    /// The component whose attention mask feeds this block; [`super::NONE`] for the root.
    pub parent_component: u32,
    /// First of this block's components.
    pub first_component: u32,
    /// How many components follow. Redundant ones are gone, so it may be less than was asked for.
    pub component_count: u32,
    /// Convolution in front of the latents.
    pub encoder: GraphConvRecord,
    /// Convolution behind the latents.
    pub decoder: GraphConvRecord,
}

/// `y_v = point x_v + neighbour mean_{j in ring(v)} x_j + bias`, then tanh, less the same at x = 0 so that rest maps to rest.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct GraphConvRecord {
    /// Row-major: `point[out][in]`.
    pub point: [[f32; FEATURE_COUNT]; FEATURE_COUNT],
    /// Row-major: `neighbour[out][in]`.
    pub neighbour: [[f32; FEATURE_COUNT]; FEATURE_COUNT],
    /// Shape: `[out]`.
    pub bias: [f32; FEATURE_COUNT],
}

/// One deformation component and the control that drives it.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct ComponentRecord<'a> {
    /// Unique name of the control, for example `c03` or `c03.f2`.
    #[rkyv(with = InlineAsBox)]
    pub name: &'a str,
    /// The block this component is a latent of.
    pub block: u32,
    /// Vertex where the component is strongest.
    pub centre_vertex: u32,
    /// Geodesic radius within which it was asked to stay, as a share of the largest distance, in [0, 1].
    pub scale: f32,
    /// Mean displacement of the vertices it moves, at its typical weight; share of the bounding-box diagonal.
    pub strength: f32,
    /// Share of its energy within `scale` of its centre, in [0, 1].
    pub locality: f32,
    /// Least weight seen on the training shapes and their mixes; the lower stop of the control.
    pub minimum: f32,
    /// Greatest weight seen on the training shapes and their mixes; the upper stop of the control.
    pub maximum: f32,
    /// Multiply the whole numbers.
    pub value_scales: ValueScales,
}

/// Where a package comes from: enough to train it again.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct Provenance<'a> {
    /// Program and version that wrote the package.
    #[rkyv(with = InlineAsBox)]
    pub tool: &'a str,
    /// Name of the sequence (the last part of its path).
    #[rkyv(with = InlineAsBox)]
    pub sequence: &'a str,
    /// The whole configuration, as TOML.
    #[rkyv(with = InlineAsBox)]
    pub config: &'a str,
    /// Seed of every random choice.
    pub seed: u64,
    /// Shapes in the sequence.
    pub shape_count: u32,
    /// Which of them were trained on, ascending.
    #[rkyv(with = InlineAsBox)]
    pub train_shapes: &'a [u32],
}

/// What the trainer measured while it trained. NaN is refused; a figure that was not measured is -1.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Root mean square error of the held-out part of the training shapes, positions, per mille of the bounding ball.
    pub validation_e_rms: f32,
    /// Optimiser steps behind the weights that were kept.
    pub steps: u32,
    /// Optimiser steps that were run in all.
    pub steps_run: u32,
}
