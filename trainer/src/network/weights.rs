//! The network's weights as plain numbers: what the closed-form start writes, training improves, extraction and baking read.

use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

/// Numbers in one graph convolution: two 9 x 9 matrices and a bias.
pub const CONVOLUTION_LEN: usize = 2 * FEATURE_COUNT * FEATURE_COUNT + FEATURE_COUNT;

/// Numbers between two looks at whether all were finite so far.
const FINITE_CHECK_LEN: usize = 4096;

/// All blocks of the stack, level by level. Gradients have the same shape and use the same type.
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

impl StackWeights {
    /// A stack of zeros: `component_counts[l]` components in every block of level l.
    pub fn zeros(vertex_count: usize, component_counts: &[usize]) -> Self {
        let mut block_count = 1;
        let levels = component_counts.iter().map(|&component_count| {
            // Each asks for zeroed memory of its own: copies of one would be written twice.
            let block = |_| BlockWeights {
                encoder: zero_convolution(),
                decoder: zero_convolution(),
                components: vec![0.0; component_count * vertex_count * FEATURE_COUNT],
            };
            let level = LevelWeights {
                component_count,
                blocks: (0..block_count).map(block).collect(),
            };
            block_count *= component_count;
            level
        });
        Self {
            vertex_count,
            levels: levels.collect(),
        }
    }

    /// K_l of every level.
    pub fn component_counts(&self) -> Vec<usize> {
        self.levels.iter().map(|level| level.component_count).collect()
    }

    /// Whether the tree is complete: one root, one block under every component, and as many numbers as V and K ask for.
    pub fn is_consistent(&self) -> bool {
        let mut block_count = 1;
        !self.levels.is_empty()
            && self.vertex_count > 0
            && self.levels.iter().all(|level| {
                let len = level.component_count * self.vertex_count * FEATURE_COUNT;
                let complete = level.component_count > 0
                    && level.blocks.len() == block_count
                    && level.blocks.iter().all(|block| block.components.len() == len);
                block_count *= level.component_count;
                complete
            })
    }

    /// Whether every weight is a finite number.
    pub fn is_finite(&self) -> bool {
        self.blocks().all(|block| {
            let mut pieces = block.components.chunks(FINITE_CHECK_LEN);
            // Without a way out inside a piece the compiler checks many numbers in one instruction.
            pieces.all(|piece| piece.iter().fold(true, |sound, value| sound & value.is_finite()))
                && [&block.encoder, &block.decoder]
                    .iter()
                    .all(|convolution| flatten_convolution(convolution).iter().all(|value| value.is_finite()))
        })
    }

    /// All blocks, level by level.
    pub fn blocks(&self) -> impl Iterator<Item = &BlockWeights> {
        self.levels.iter().flat_map(|level| &level.blocks)
    }

    /// All blocks, level by level, to be changed.
    pub fn blocks_mut(&mut self) -> impl Iterator<Item = &mut BlockWeights> {
        self.levels.iter_mut().flat_map(|level| &mut level.blocks)
    }

    /// All rows of C end to end. Shape: `[level][block][K][V][9]`.
    pub fn flat_components(&self) -> Vec<f32> {
        let mut flat = Vec::with_capacity(self.blocks().map(|block| block.components.len()).sum());
        self.blocks()
            .for_each(|block| flat.extend_from_slice(&block.components));
        flat
    }

    /// All convolutions end to end. Shape: `[level][block][encoder, decoder]`[[`CONVOLUTION_LEN`]].
    pub fn flat_convolutions(&self) -> Vec<f32> {
        let both = |block: &BlockWeights| [flatten_convolution(&block.encoder), flatten_convolution(&block.decoder)];
        self.blocks().flat_map(both).flatten().collect()
    }

    /// The inverse of [`Self::flat_components`]; `flat` must be as long as what that returns.
    pub fn set_flat_components(&mut self, flat: &[f32]) {
        let mut rest = flat;
        for block in self.blocks_mut() {
            let (own, after) = rest.split_at(block.components.len());
            block.components.copy_from_slice(own);
            rest = after;
        }
    }

    /// The inverse of [`Self::flat_convolutions`]; `flat` must be as long as what that returns.
    pub fn set_flat_convolutions(&mut self, flat: &[f32]) {
        for (block, numbers) in self.blocks_mut().zip(flat.chunks_exact(2 * CONVOLUTION_LEN)) {
            block.encoder = convolution_from_flat(&numbers[..CONVOLUTION_LEN]);
            block.decoder = convolution_from_flat(&numbers[CONVOLUTION_LEN..]);
        }
    }

    /// Scales every row of C to unit Euclidean length; a row of zeros stays as it is.
    pub fn normalize_rows(&mut self) {
        let row_len = self.vertex_count * FEATURE_COUNT;
        for block in self.blocks_mut() {
            for row in block.components.chunks_exact_mut(row_len) {
                let length = row_length(row);
                if length > 0.0 {
                    let scale = (1.0 / length) as f32;
                    row.iter_mut().for_each(|value| *value *= scale);
                }
            }
        }
    }
}

/// Euclidean length of a row of C, in double precision.
pub(crate) fn row_length(row: &[f32]) -> f64 {
    // Eight sums side by side: one alone waits for each addition.
    let mut sums = [0.0_f64; 8];
    let (whole, rest) = row.as_chunks::<8>();
    for values in whole {
        for n in 0..8 {
            sums[n] += f64::from(values[n]) * f64::from(values[n]);
        }
    }
    let rest = rest.iter().map(|&value| f64::from(value) * f64::from(value));
    (sums.iter().sum::<f64>() + rest.sum::<f64>()).sqrt()
}

/// A convolution that answers zero to everything.
pub fn zero_convolution() -> GraphConvRecord {
    GraphConvRecord {
        point: [[0.0; FEATURE_COUNT]; FEATURE_COUNT],
        neighbour: [[0.0; FEATURE_COUNT]; FEATURE_COUNT],
        bias: [0.0; FEATURE_COUNT],
    }
}

/// A convolution that multiplies what it sees by `factor`, and looks at no neighbour.
pub fn diagonal_convolution(factor: f32) -> GraphConvRecord {
    let mut convolution = zero_convolution();
    (0..FEATURE_COUNT).for_each(|c| convolution.point[c][c] = factor);
    convolution
}

/// The convolution's numbers in order point, neighbour, bias.
pub(crate) fn flatten_convolution(convolution: &GraphConvRecord) -> [f32; CONVOLUTION_LEN] {
    let mut flat = [0.0; CONVOLUTION_LEN];
    let square = FEATURE_COUNT * FEATURE_COUNT;
    flat[..square].copy_from_slice(convolution.point.as_flattened());
    flat[square..2 * square].copy_from_slice(convolution.neighbour.as_flattened());
    flat[2 * square..].copy_from_slice(&convolution.bias);
    flat
}

/// The inverse of [`flatten_convolution`]; `flat` has [`CONVOLUTION_LEN`] numbers.
pub(crate) fn convolution_from_flat(flat: &[f32]) -> GraphConvRecord {
    let mut convolution = zero_convolution();
    let square = FEATURE_COUNT * FEATURE_COUNT;
    convolution.point.as_flattened_mut().copy_from_slice(&flat[..square]);
    convolution
        .neighbour
        .as_flattened_mut()
        .copy_from_slice(&flat[square..2 * square]);
    convolution.bias.copy_from_slice(&flat[2 * square..]);
    convolution
}
