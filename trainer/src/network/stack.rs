//! The stack as a differentiable burn model: every operation a tensor operation, every gradient burn's own.
//!
//! It states the network of method section 2 in the algebra of the fused [`super::kernel`] (the decoder's convolution
//! applied to C, blocks of a level batched) and is what that kernel is checked against. It runs wherever
//! [`super::device`] points; on the CPU it is several times slower.

use burn::module::{Module, Param};
use burn::tensor::{Device, IndexingUpdateOp, Int, Tensor, TensorData};
use sinew_formats::package::FEATURE_COUNT;

use super::activation::Activation;
use super::attention::Attention;
use super::device::model_device;
use super::loss::{LossSettings, LossTerms, NORM_SOFTENING};
use super::ring::RingMean;
use super::weights::{LevelWeights, StackWeights};

/// Keeps the root of a row's squared length differentiable where the row is zero.
const LENGTH_GUARD: f32 = 1e-30;

/// Graph convolutions of all blocks of a level.
#[derive(Module, Debug)]
struct GraphConvolutions {
    /// Shape: `[B, out, in]`.
    point: Param<Tensor<3>>,
    /// Shape: `[B, out, in]`.
    neighbour: Param<Tensor<3>>,
    /// Shape: `[B, 1, out]`.
    bias: Param<Tensor<3>>,
}

/// All autoencoder blocks of a level.
#[derive(Module, Debug)]
struct Autoencoders {
    encoder: GraphConvolutions,
    decoder: GraphConvolutions,
    /// C. Shape: `[B, K, V, 9]`.
    components: Param<Tensor<4>>,
}

/// The stack's parameters.
#[derive(Module, Debug)]
struct Stack {
    levels: Vec<Autoencoders>,
}

/// What blocks of a level answer.
struct Answer {
    /// Z. Shape: `[B, N, K]`.
    latents: Tensor<3>,
    /// y. Shape: `[B, N, V, 9]`.
    output: Tensor<4>,
}

/// The differentiable model bound to a mesh. V vertices.
pub struct DifferentiableStack {
    device: Device,
    mean: TensorMean,
    attention: Attention,
    activation: Activation,
    /// Shape: `[1, 1, V, 1]`.
    vertex_weights: Tensor<4>,
    /// Shape: `[V 9, I]`, absent without modes.
    modes: Option<Tensor<2>>,
}

impl DifferentiableStack {
    /// As [`super::kernel::Kernel::new`].
    pub fn new(
        ring: &RingMean,
        vertex_weights: &[f32],
        modes: &[f32],
        attention: Attention,
        activation: Activation,
    ) -> Self {
        let device = model_device().autodiff();
        let vertex_count = ring.vertex_count();
        let len = vertex_count * FEATURE_COUNT;
        let mode_count = modes.len() / len;
        Self {
            mean: TensorMean::new(ring, &device),
            attention,
            activation,
            vertex_weights: tensor(vertex_weights, [1, 1, vertex_count, 1], &device),
            modes: (mode_count > 0).then(|| tensor(modes, [mode_count, len], &device).transpose()),
            device,
        }
    }

    /// As [`super::kernel::Kernel::differentiate`].
    pub fn differentiate(
        &self,
        weights: &StackWeights,
        shapes: &[f32],
        outside: &[Vec<bool>],
        settings: &LossSettings,
    ) -> (LossTerms, StackWeights) {
        let vertex_count = weights.vertex_count;
        let shape_count = shapes.len() / (vertex_count * FEATURE_COUNT);
        let stack = Stack::new(weights, &self.device);
        let mut input = tensor(shapes, [1, shape_count, vertex_count, FEATURE_COUNT], &self.device);
        let mut error = input.clone();
        let mut block_error = zero(&self.device);
        let mut range = zero(&self.device);
        for level in &stack.levels {
            let answer = level.forward(input.clone(), &self.mean, self.activation);
            let residual = input - answer.output.clone();
            block_error = block_error + self.squared_norm(residual.clone());
            error = error - answer.output.sum_dim(0);
            range = range + range_excess(answer.latents, settings);
            input = level.attend(residual, self.attention);
        }
        let per_shape = settings.reconstruction_weight / shape_count as f32;
        let position = match &self.modes {
            Some(modes) => {
                let flat = error.clone().reshape([shape_count, vertex_count * FEATURE_COUNT]);
                flat.matmul(modes.clone()).square().sum()
            }
            None => zero(&self.device),
        };
        let terms = [
            block_error.mul_scalar(per_shape * settings.block_weight),
            self.squared_norm(error).mul_scalar(per_shape * settings.total_weight),
            position.mul_scalar(per_shape * settings.position_weight),
            stack.sparsity(outside, settings, &self.device),
            range,
        ];
        let [block, total, position, sparsity, range] = terms.each_ref().map(|term| numbers(term.clone())[0]);
        let loss = terms.into_iter().fold(zero(&self.device), |sum, term| sum + term);
        (
            LossTerms {
                block,
                total,
                position,
                sparsity,
                range,
            },
            stack.gradient(&loss, weights),
        )
    }

    /// Sum over shapes of the weighted squared norm.
    fn squared_norm(&self, residual: Tensor<4>) -> Tensor<1> {
        (residual.square() * self.vertex_weights.clone()).sum()
    }
}

impl Stack {
    fn new(weights: &StackWeights, device: &Device) -> Self {
        let of_level = |level: &LevelWeights| {
            let (block_count, k_count) = (level.blocks.len(), level.component_count);
            let components: Vec<f32> = level
                .blocks
                .iter()
                .flat_map(|block| &block.components)
                .copied()
                .collect();
            let shape = [block_count, k_count, weights.vertex_count, FEATURE_COUNT];
            let convolutions = |encoder: bool| {
                let all = level
                    .blocks
                    .iter()
                    .map(|block| if encoder { &block.encoder } else { &block.decoder });
                let square = [block_count, FEATURE_COUNT, FEATURE_COUNT];
                let gather = |numbers: Vec<f32>, shape| Param::from_tensor(tensor(&numbers, shape, device));
                GraphConvolutions {
                    point: gather(
                        all.clone().flat_map(|one| one.point.as_flattened()).copied().collect(),
                        square,
                    ),
                    neighbour: gather(
                        all.clone()
                            .flat_map(|one| one.neighbour.as_flattened())
                            .copied()
                            .collect(),
                        square,
                    ),
                    bias: gather(all.flat_map(|one| one.bias).collect(), [block_count, 1, FEATURE_COUNT]),
                }
            };
            Autoencoders {
                encoder: convolutions(true),
                decoder: convolutions(false),
                components: Param::from_tensor(tensor(&components, shape, device)),
            }
        };
        Self {
            levels: weights.levels.iter().map(of_level).collect(),
        }
    }

    /// `λ2 Σ_blocks (1/K) Σ_k Σ_v Λ_kv |C_kv|`.
    fn sparsity(&self, outside: &[Vec<bool>], settings: &LossSettings, device: &Device) -> Tensor<1> {
        let mut sum = zero(device);
        if settings.sparsity_weight == 0.0 {
            return sum;
        }
        let mut rest = outside;
        for level in &self.levels {
            let mut components = level.components.val();
            let [block_count, k_count, vertex_count, _] = components.dims();
            if settings.unit_rows {
                let energy = components.clone().square().sum_dim(3).sum_dim(2);
                components = components / energy.add_scalar(LENGTH_GUARD).sqrt();
            }
            let softening = NORM_SOFTENING * NORM_SOFTENING;
            let norms = components
                .square()
                .sum_dim(3)
                .add_scalar(softening)
                .sqrt()
                .sub_scalar(NORM_SOFTENING);
            let (own, after) = rest.split_at(block_count);
            let mask: Vec<f32> = own
                .iter()
                .flatten()
                .map(|&outside| f32::from(u8::from(outside)))
                .collect();
            let mask = tensor(&mask, [block_count, k_count, vertex_count, 1], device);
            sum = sum
                + (norms * mask)
                    .sum()
                    .mul_scalar(settings.sparsity_weight / k_count as f32);
            rest = after;
        }
        sum
    }

    /// Gradients of all parameters, in the shape of the weights.
    fn gradient(&self, loss: &Tensor<1>, weights: &StackWeights) -> StackWeights {
        let gradients = loss.backward();
        let mut sum = StackWeights::zeros(weights.vertex_count, &weights.component_counts());
        for (level, sums) in self.levels.iter().zip(&mut sum.levels) {
            let spread = |numbers: Option<Vec<f32>>, len: usize, write: &mut dyn FnMut(usize, &[f32])| {
                // A parameter without influence has no gradient: zero stands already.
                let numbers = numbers.unwrap_or_default();
                numbers.chunks_exact(len).enumerate().for_each(|(b, own)| write(b, own));
            };
            let square = FEATURE_COUNT * FEATURE_COUNT;
            let blocks = &mut sums.blocks;
            for (convolutions, encoder) in [(&level.encoder, true), (&level.decoder, false)] {
                let mut write = |param: &Param<Tensor<3>>, len: usize, part: usize| {
                    spread(param.val().grad(&gradients).map(numbers), len, &mut |b, own| {
                        let block = &mut blocks[b];
                        let target = if encoder {
                            &mut block.encoder
                        } else {
                            &mut block.decoder
                        };
                        match part {
                            0 => target.point.as_flattened_mut().copy_from_slice(own),
                            1 => target.neighbour.as_flattened_mut().copy_from_slice(own),
                            _ => target.bias.copy_from_slice(own),
                        }
                    });
                };
                write(&convolutions.point, square, 0);
                write(&convolutions.neighbour, square, 1);
                write(&convolutions.bias, FEATURE_COUNT, 2);
            }
            let len = blocks[0].components.len();
            spread(
                level.components.val().grad(&gradients).map(numbers),
                len,
                &mut |b, own| {
                    blocks[b].components.copy_from_slice(own);
                },
            );
        }
        sum
    }
}

impl Autoencoders {
    /// Input of shape `[B, N, V, 9]`.
    fn forward(&self, input: Tensor<4>, mean: &TensorMean, activation: Activation) -> Answer {
        let [block_count, shape_count, vertex_count, _] = input.dims();
        let components = self.components.val();
        let k_count = components.dims()[1];
        let len = vertex_count * FEATURE_COUNT;
        let rows = components.clone().reshape([block_count, k_count, len]);
        let hidden = self.encoder.activate(self.encoder.convolve(input, mean), activation);
        let latents = hidden.reshape([block_count, shape_count, len]).matmul(rows.transpose());
        let hat = self
            .decoder
            .convolve(components, mean)
            .reshape([block_count, k_count, len]);
        let blend = latents
            .clone()
            .matmul(hat)
            .reshape([block_count, shape_count * vertex_count, FEATURE_COUNT]);
        let output =
            self.decoder
                .activate(blend, activation)
                .reshape([block_count, shape_count, vertex_count, FEATURE_COUNT]);
        Answer { latents, output }
    }

    /// What the blocks below see of a residual `[B, N, V, 9]`: `[B K, N, V, 9]`.
    fn attend(&self, residual: Tensor<4>, attention: Attention) -> Tensor<4> {
        let energy = self.components.val().square().sum_dim(3);
        let [block_count, k_count, vertex_count, _] = energy.dims();
        let shape_count = residual.dims()[1];
        let masks: Tensor<4> = match attention {
            Attention::Components => {
                let raised = energy.add_scalar(attention.floor(vertex_count));
                raised.clone() / raised.sum_dim(1)
            }
            Attention::Equal => energy.zeros_like().add_scalar(1.0 / k_count as f32),
        };
        let len = [block_count, 1, shape_count, vertex_count, FEATURE_COUNT];
        let product = residual.reshape(len) * masks.reshape([block_count, k_count, 1, vertex_count, 1]);
        product.reshape([block_count * k_count, shape_count, vertex_count, FEATURE_COUNT])
    }
}

impl GraphConvolutions {
    /// `W_point x + W_neighbour mean x` of fields `[B, R, V, 9]`, without bias. Shape: `[B, R V, 9]`.
    fn convolve(&self, fields: Tensor<4>, mean: &TensorMean) -> Tensor<3> {
        let [block_count, row_count, vertex_count, _] = fields.dims();
        let flat = [block_count, row_count * vertex_count, FEATURE_COUNT];
        let means = mean.apply(
            fields
                .clone()
                .reshape([block_count * row_count, vertex_count, FEATURE_COUNT]),
        );
        let point = fields.reshape(flat).matmul(self.point.val().transpose());
        point + means.reshape(flat).matmul(self.neighbour.val().transpose())
    }

    /// tanh, less as much of the same at rest as the activation says.
    fn activate(&self, convolved: Tensor<3>, activation: Activation) -> Tensor<3> {
        let bias = self.bias.val();
        (convolved + bias.clone()).tanh() - bias.tanh().mul_scalar(activation.rest_share())
    }
}

/// The mean over one-rings as gather and scatter over the edges.
struct TensorMean {
    /// Vertex that receives, for each directed edge.
    receivers: Tensor<1, Int>,
    /// Vertex that gives.
    givers: Tensor<1, Int>,
    /// One over the receiver's degree. Shape: `[1, E, 1]`.
    shares: Tensor<3>,
}

impl TensorMean {
    fn new(ring: &RingMean, device: &Device) -> Self {
        let edges = || (0..ring.vertex_count()).flat_map(|v| ring.ring(v).iter().map(move |&j| (v, j)));
        let indices = |numbers: Vec<i64>| {
            let len = numbers.len();
            Tensor::from_data(TensorData::new(numbers, [len]), device)
        };
        let shares: Vec<f32> = edges().map(|(v, _)| ring.inverse_degree[v]).collect();
        Self {
            receivers: indices(edges().map(|(v, _)| v as i64).collect()),
            givers: indices(edges().map(|(_, j)| i64::from(j)).collect()),
            shares: tensor(&shares, [1, shares.len(), 1], device),
        }
    }

    /// Fields of shape `[R, V, 9]`.
    fn apply(&self, fields: Tensor<3>) -> Tensor<3> {
        let zeros = fields.zeros_like();
        if self.shares.dims()[1] == 0 {
            return zeros;
        }
        let given = fields.select(1, self.givers.clone()) * self.shares.clone();
        zeros.select_assign(1, self.receivers.clone(), given, IndexingUpdateOp::Add)
    }
}

/// `V(Z) = Σ_blocks (1/K) Σ_k max(max_m |Z_mk| - θ, 0)`.
fn range_excess(latents: Tensor<3>, settings: &LossSettings) -> Tensor<1> {
    let k_count = latents.dims()[2];
    let excess = latents
        .abs()
        .max_dim(1)
        .sub_scalar(settings.range_threshold)
        .clamp_min(0.0);
    excess.sum().mul_scalar(settings.range_weight / k_count as f32)
}

fn zero(device: &Device) -> Tensor<1> {
    Tensor::zeros([1], device)
}

fn tensor<const D: usize>(numbers: &[f32], shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(numbers.to_vec(), shape), device)
}

fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor
        .into_data()
        .try_into_vec()
        .expect("tensors of this module are made of f32")
}
