//! Adam over the stack's weights: rows of C and convolutions, each with a rate of its own.
//!
//! One pass over memory a step, where a tensor library makes ten. The test beside it holds it to burn's Adam, bit by bit.
//! Source: Kingma and Ba, *Adam: A Method for Stochastic Optimization*, ICLR 2015, algorithm 1, with both bias
//! corrections in the step's size, as at the end of its section 2.

use rayon::prelude::*;

use crate::network::weights::StackWeights;

/// Share of the first moment that a step keeps; the paper's.
const FIRST_DECAY: f32 = 0.9;
/// Share of the second moment that a step keeps; the paper's.
const SECOND_DECAY: f32 = 0.999;
/// Guard against division by zero, the paper's. burn's default, 1e-5, is above many of the gradients here.
const EPSILON: f32 = 1e-8;

/// Numbers that one task of the thread pool steps. Each number is stepped alone, so the length changes no bit.
const PIECE_LEN: usize = 1 << 14;

/// Both moments of some weights; empty before the first step.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Moments {
    pub(super) first: Vec<f32>,
    pub(super) second: Vec<f32>,
}

/// Takes steps down the gradient, and remembers.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Adam {
    /// Steps behind the moments.
    pub(super) time: u64,
    /// In the order of [`StackWeights::flat_components`].
    pub(super) components: Moments,
    /// In the order of [`StackWeights::flat_convolutions`].
    pub(super) convolutions: Moments,
}

/// What a step multiplies by, the same for every number.
#[derive(Clone, Copy)]
struct Factors {
    rate: f32,
    /// Root of the second moment's bias correction over the first's.
    correction: f32,
    guard: f32,
}

impl Adam {
    /// One step down the gradient.
    pub(super) fn step(
        &mut self,
        weights: &mut StackWeights,
        gradient: &StackWeights,
        component_rate: f64,
        convolution_rate: f64,
    ) {
        self.time += 1;
        let time = self.time as i32;
        let second_root = (1.0 - SECOND_DECAY.powi(time)).sqrt();
        let factors = |rate: f64| Factors {
            rate: rate as f32,
            correction: second_root / (1.0 - FIRST_DECAY.powi(time)),
            guard: EPSILON * second_root,
        };

        let mut values = weights.flat_convolutions();
        let slope = gradient.flat_convolutions();
        self.convolutions.resize(values.len());
        let Moments { first, second } = &mut self.convolutions;
        step_piece(&mut values, &slope, first, second, factors(convolution_rate));
        weights.set_flat_convolutions(&values);

        let len = weights.blocks().map(|block| block.components.len()).sum();
        self.components.resize(len);
        let Moments { first, second } = &mut self.components;
        let (mut first, mut second) = (first.as_mut_slice(), second.as_mut_slice());
        for (block, gradient) in weights.blocks_mut().zip(gradient.blocks()) {
            let (own_first, own_second);
            (own_first, first) = first.split_at_mut(block.components.len());
            (own_second, second) = second.split_at_mut(block.components.len());
            block
                .components
                .par_chunks_mut(PIECE_LEN)
                .zip(gradient.components.par_chunks(PIECE_LEN))
                .zip(own_first.par_chunks_mut(PIECE_LEN))
                .zip(own_second.par_chunks_mut(PIECE_LEN))
                .for_each(|(((values, slope), first), second)| {
                    step_piece(values, slope, first, second, factors(component_rate));
                });
        }
    }
}

impl Moments {
    fn resize(&mut self, len: usize) {
        self.first.resize(len, 0.0);
        self.second.resize(len, 0.0);
    }
}

fn step_piece(values: &mut [f32], slope: &[f32], first: &mut [f32], second: &mut [f32], factors: Factors) {
    let Factors {
        rate,
        correction,
        guard,
    } = factors;
    for (((value, &slope), first), second) in values.iter_mut().zip(slope).zip(first).zip(second) {
        *first = *first * FIRST_DECAY + slope * (1.0 - FIRST_DECAY);
        *second = *second * SECOND_DECAY + slope * slope * (1.0 - SECOND_DECAY);
        *value -= *first * correction / (second.sqrt() + guard) * rate;
    }
}

#[cfg(test)]
mod tests {
    use burn::optim::{AdamConfig, Optimizer};
    use burn::tensor::{Tensor, TensorData};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{Adam, EPSILON};
    use crate::network::device::host_device;
    use crate::network::weights::StackWeights;

    const STEPS: usize = 20;
    const RATES: [f64; 2] = [1e-3, 3e-4];

    /// Wide enough for several pieces, and a last one that is short.
    fn random_stack(random: &mut ChaCha8Rng, reach: f32) -> StackWeights {
        let mut weights = StackWeights::zeros(701, &[4, 3]);
        let mut numbers = |len: usize| -> Vec<f32> { (0..len).map(|_| random.random_range(-reach..reach)).collect() };
        let components = numbers(weights.flat_components().len());
        weights.set_flat_components(&components);
        let convolutions = numbers(weights.flat_convolutions().len());
        weights.set_flat_convolutions(&convolutions);
        weights
    }

    #[test]
    fn steps_are_those_of_burns_adam() {
        let random = &mut ChaCha8Rng::seed_from_u64(5);
        let mut weights = random_stack(random, 1.0);
        let device = host_device();
        let upload = |values: Vec<f32>| {
            let shape = [values.len()];
            Tensor::<1>::from_data(TensorData::new(values, shape), &device)
        };
        let burns = AdamConfig::new().with_epsilon(EPSILON).build();
        let flat = |weights: &StackWeights| [weights.flat_components(), weights.flat_convolutions()];
        let mut expected = flat(&weights).map(|values| (upload(values), None));
        let mut adam = Adam::default();
        for step in 0..STEPS {
            // Gradients from common to vanishing.
            let gradient = random_stack(random, 10_f32.powi(-(step as i32)));
            adam.step(&mut weights, &gradient, RATES[0], RATES[1]);
            for (((tensor, state), slope), rate) in expected.iter_mut().zip(flat(&gradient)).zip(RATES) {
                (*tensor, *state) = burns.step(rate, tensor.clone(), upload(slope), state.take());
            }
            for ((tensor, _), found) in expected.iter().zip(flat(&weights)) {
                let expected: Vec<f32> = tensor.clone().into_data().try_into_vec().expect("numbers of f32");
                assert!(found == expected, "step {step} differs");
            }
        }
    }
}
