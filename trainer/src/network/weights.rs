//! The network's weights as plain numbers: what the closed-form start writes, training improves, extraction and baking read.

use sinew_formats::package::GraphConvRecord;

/// All blocks of the stack, level by level.
#[derive(Debug, Clone, PartialEq)]
pub struct StackWeights {
    /// V.
    pub vertex_count: usize,
    /// `levels[0]` holds the root block alone; `levels[l + 1]` one block for each component of level l, in order:
    /// block `b` of level l + 1 is fed by component `b % K_l` of block `b / K_l` of level l.
    pub levels: Vec<LevelWeights>,
}

/// Blocks of one level, all with as many components.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelWeights {
    /// K_l: components of each block.
    pub component_count: usize,
    /// Shape: `[product of K over the levels above]`.
    pub blocks: Vec<BlockWeights>,
}

/// One autoencoder block.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockWeights {
    /// Convolution in front of the latents.
    pub encoder: GraphConvRecord,
    /// Convolution behind the latents.
    pub decoder: GraphConvRecord,
    /// C. Shape: `[K][V][9]`, flat.
    pub components: Vec<f32>,
}
