//! Largest counts and numbers a package may hold. Opening refuses what exceeds them, so that no later sum of indices
//! overflows and no product of numbers on the frame path does. They lie far above what a real mesh needs.

/// Vertices.
pub const VERTICES: usize = 4 << 20;
/// Triangles.
pub const FACES: usize = 16 << 20;
/// Bridges between pieces.
pub const BRIDGES: usize = VERTICES;
/// Entries of all one-rings together.
pub const RING_ENTRIES: usize = 64 << 20;
/// Tiles of the factor below its diagonal.
pub const TILES: usize = 32 << 20;
/// Components, and so controls.
pub const COMPONENTS: usize = 4096;
/// Autoencoder blocks: the root and at most one a component.
pub const BLOCKS: usize = COMPONENTS + 1;
/// Entries of all components together.
pub const ENTRIES: usize = 128 << 20;
/// Patches of all components together.
pub const PATCHES: usize = 8 << 20;
/// Steps of all fans together.
pub const FANS: usize = 32 << 20;
/// Shapes of the sequence.
pub const SHAPES: usize = 16 << 20;

/// Bytes of a component's name.
pub const NAME_BYTES: usize = 64;
/// Bytes of the names of tool and sequence.
pub const TITLE_BYTES: usize = 256;
/// Bytes of the configuration.
pub const CONFIG_BYTES: usize = 1 << 20;
/// Bytes of a payload: its 32-bit relative pointers reach no further.
pub const PAYLOAD_BYTES: u64 = i32::MAX as u64;

/// Render vertices: a vertex has as many as texture coordinates.
pub const RENDER_VERTICES: usize = 16 << 20;
/// Texture coordinate, either sign.
pub const TEXTURE: f32 = 1e6;

/// Loose pieces that move as a whole.
pub const PIECES: usize = 4096;
/// Modes of the residual.
pub const MODES: usize = 8;
/// Factors of the prior.
pub const PRIOR_FACTORS: usize = 16;
/// Bytes of what the trainer keeps for its encoder.
pub const ENCODER_BYTES: usize = 64 << 20;

/// Coordinate of a rest position, either sign, units of the source.
pub const POSITION: f32 = 1e9;
/// Weight of a control, either sign.
pub const CONTROL: f32 = 1e4;
/// Scale of whole numbers.
pub const VALUE_SCALE: f32 = 1e6;
/// Network value to radians, and to stretch.
pub const FEATURE_SCALE: f32 = 1e3;
/// Entry of a convolution's matrix or bias, either sign.
pub const NETWORK_VALUE: f32 = 1e6;
/// Bones: engines hold 256, of which they may want some.
pub const BONES: usize = 250;
/// Nodes that bones are made of.
pub const BONE_NODES: usize = 1 << 12;
/// What a node's gradient counts in a bone's, either sign.
pub const BONE_VALUE: f32 = 1e3;
/// Cotangent weight of an edge.
pub const EDGE_WEIGHT: f32 = 1e9;
/// Entry of the factor, either sign; for a Laplacian with non-negative weights the entries of a row are at most 1 together.
pub const FACTOR_VALUE: f32 = 1e6;
/// Entry of the inverse of a diagonal block, either sign.
pub const INVERSE_PIVOT: f32 = 1e12;
/// Quality and error figures.
pub const QUALITY: f32 = 1e9;
