//! The paper's encoder, evaluated plainly from a compact package whose recipe is the paper's: block by block, every latent read
//! by the row that decodes it. Nothing is folded here; the decoder's half is the unfolded one, so it checks the folding too.

use sinew_formats::package::{BlockRecord, CompactView, FEATURE_COUNT, GraphConvRecord, NONE};

use crate::{
    bake::sparse::{SparseComponent, unpack_components},
    mesh::topology::Topology,
    network::{activation::Activation, attention::Attention},
};

/// Added to every component's energy at a vertex before masks are normalised, times `1 / V`: where no component of a block
/// lives, its masks share equally instead of dividing zero by zero. The training uses the same.
pub const MASK_FLOOR: f64 = crate::network::kernel::MASK_FLOOR as f64;

/// One value of each feature.
type Features = [f64; FEATURE_COUNT];

/// What the paper's encoder takes from how a package was trained.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EncoderSettings {
    /// How residuals are shared out among blocks.
    pub attention: Attention,
    /// What follows a convolution.
    pub activation: Activation,
}

/// The paper's encoder, ready for any number of shapes. V vertices, B blocks, K components.
#[derive(Debug, Clone)]
pub struct StackEncoder<'t> {
    topology: &'t Topology,
    activation: Activation,
    blocks: Vec<BlockRecord>,
    components: Vec<SparseComponent>,
    /// Attention masks of the components that have a block below them; empty for the others. Shape: `[K][V]`.
    masks: Vec<Vec<f64>>,
}

/// What the encoder says of one shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Encoding {
    /// Weights of all components. Shape: `[K]`.
    pub weights: Vec<f64>,
    /// `|X - Xhat|^2` after the root block alone.
    pub root_residual_energy: f64,
    /// `|X - Xhat|^2` after all levels.
    pub residual_energy: f64,
    /// `|X|^2`.
    pub energy: f64,
}

impl<'t> StackEncoder<'t> {
    /// Prepares the masks. `topology` is that of the package ([`crate::bake::Surface`]); `settings` those of its training.
    pub fn new(package: &CompactView<'_>, topology: &'t Topology, settings: EncoderSettings) -> Self {
        let blocks: Vec<BlockRecord> = package.blocks().collect();
        let components = unpack_components(package);
        let mut masks = vec![Vec::new(); components.len()];
        for block in &blocks {
            let members = component_range(block);
            let has_child = |k: usize| blocks.iter().any(|child| child.parent_component == k as u32);
            if members.clone().any(has_child) {
                let block_masks = match settings.attention {
                    Attention::Components => attention_masks(topology.vertex_count, &components[members.clone()]),
                    Attention::Equal => {
                        vec![vec![1.0 / members.len() as f64; topology.vertex_count]; members.len()]
                    }
                };
                for (k, mask) in members.zip(block_masks) {
                    masks[k] = mask;
                }
            }
        }
        Self {
            topology,
            activation: settings.activation,
            blocks,
            components,
            masks,
        }
    }

    /// Encodes one shape, coarse to fine: each child block reads its parent's residual through its component's mask.
    /// Shape: `features` `[V]`, source order, network units.
    pub fn encode(&self, features: &[[f32; FEATURE_COUNT]]) -> Encoding {
        let whole: Vec<Features> = features.iter().map(|x| x.map(f64::from)).collect();
        let mut weights = vec![0.0; self.components.len()];
        let mut residuals: Vec<Vec<Features>> = Vec::with_capacity(self.blocks.len());
        let mut sum = vec![[0.0; FEATURE_COUNT]; whole.len()];
        let mut root_sum = Vec::new();
        for block in &self.blocks {
            let input = match block.parent_component {
                NONE => whole.clone(),
                parent => {
                    let parent = parent as usize;
                    masked(&self.masks[parent], &residuals[self.block_of(parent)])
                }
            };
            let hidden = convolve(&block.encoder, self.topology, &input, self.activation);
            let mut blend = vec![[0.0; FEATURE_COUNT]; whole.len()];
            for k in component_range(block) {
                weights[k] = self.latent(k, &hidden);
                self.blend(k, weights[k], &mut blend);
            }
            let output = convolve(&block.decoder, self.topology, &blend, self.activation);
            residuals.push(difference(&input, &output));
            add(&mut sum, &output);
            if block.parent_component == NONE && root_sum.is_empty() {
                root_sum.clone_from(&sum);
            }
        }
        Encoding {
            weights,
            root_residual_energy: energy(&difference(&whole, &root_sum)),
            residual_energy: energy(&difference(&whole, &sum)),
            energy: energy(&whole),
        }
    }

    /// Features of given weights: the sum of all blocks' decoders, unfolded. Shapes: `[K]` to `[V]`, source order.
    pub fn decode(&self, weights: &[f64]) -> Vec<[f64; FEATURE_COUNT]> {
        let mut sum = vec![[0.0; FEATURE_COUNT]; self.topology.vertex_count];
        for block in &self.blocks {
            let mut blend = vec![[0.0; FEATURE_COUNT]; sum.len()];
            for k in component_range(block) {
                self.blend(k, weights[k], &mut blend);
            }
            add(
                &mut sum,
                &convolve(&block.decoder, self.topology, &blend, self.activation),
            );
        }
        sum
    }

    fn block_of(&self, k: usize) -> usize {
        self.blocks.partition_point(|block| block.first_component as usize <= k) - 1
    }

    /// `z_k = sum_v C_k,v . h_v`.
    fn latent(&self, k: usize, hidden: &[Features]) -> f64 {
        let component = &self.components[k];
        let entries = component.vertices.iter().zip(&component.values);
        entries
            .map(|(&v, value)| {
                (0..FEATURE_COUNT)
                    .map(|c| value[c] * hidden[v as usize][c])
                    .sum::<f64>()
            })
            .sum()
    }

    fn blend(&self, k: usize, weight: f64, blend: &mut [Features]) {
        let component = &self.components[k];
        for (&v, value) in component.vertices.iter().zip(&component.values) {
            for c in 0..FEATURE_COUNT {
                blend[v as usize][c] += weight * value[c];
            }
        }
    }
}

fn component_range(block: &BlockRecord) -> core::ops::Range<usize> {
    let first = block.first_component as usize;
    first..first + block.component_count as usize
}

/// `AM_k,v = (|C_k,v|^2 + f) / (sum_k |C_k,v|^2 + K f)` with `f = MASK_FLOOR / V`; sums to one over the block's components.
fn attention_masks(vertex_count: usize, components: &[SparseComponent]) -> Vec<Vec<f64>> {
    let floor = MASK_FLOOR / vertex_count as f64;
    let mut masks = vec![vec![floor; vertex_count]; components.len()];
    let mut sums = vec![floor * components.len() as f64; vertex_count];
    for (mask, component) in masks.iter_mut().zip(components) {
        for (&v, value) in component.vertices.iter().zip(&component.values) {
            let strength: f64 = value.iter().map(|x| x * x).sum();
            mask[v as usize] += strength;
            sums[v as usize] += strength;
        }
    }
    for mask in &mut masks {
        for (share, sum) in mask.iter_mut().zip(&sums) {
            *share /= sum;
        }
    }
    masks
}

/// `tanh(point x_v + neighbour mean_{j in ring(v)} x_j + bias)`, less `tanh(bias)` where the activation says so.
fn convolve(conv: &GraphConvRecord, topology: &Topology, input: &[Features], activation: Activation) -> Vec<Features> {
    let widen = |matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT]| matrix.map(|row| row.map(f64::from));
    let (point, neighbour, bias) = (widen(&conv.point), widen(&conv.neighbour), conv.bias.map(f64::from));
    let at_rest = bias.map(|b| f64::from(activation.rest_share()) * b.tanh());
    (0..input.len())
        .map(|v| {
            let ring = topology.ring_of(v);
            let mut mean = [0.0; FEATURE_COUNT];
            for &j in ring {
                for c in 0..FEATURE_COUNT {
                    mean[c] += input[j as usize][c];
                }
            }
            let mean = mean.map(|sum| sum / ring.len().max(1) as f64);
            core::array::from_fn(|out| {
                let along = |row: &Features, x: &Features| row.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
                let linear = along(&point[out], &input[v]) + along(&neighbour[out], &mean) + bias[out];
                linear.tanh() - at_rest[out]
            })
        })
        .collect()
}

fn masked(mask: &[f64], features: &[Features]) -> Vec<Features> {
    mask.iter()
        .zip(features)
        .map(|(&share, x)| x.map(|x| share * x))
        .collect()
}

fn difference(a: &[Features], b: &[Features]) -> Vec<Features> {
    a.iter()
        .zip(b)
        .map(|(a, b)| core::array::from_fn(|c| a[c] - b[c]))
        .collect()
}

fn add(sum: &mut [Features], x: &[Features]) {
    for (sum, x) in sum.iter_mut().zip(x) {
        for c in 0..FEATURE_COUNT {
            sum[c] += x[c];
        }
    }
}

fn energy(x: &[Features]) -> f64 {
    x.as_flattened().iter().map(|x| x * x).sum()
}
