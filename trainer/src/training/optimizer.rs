//! burn's Adam over the stack's weights: C in pieces that fit a core's cache, all convolutions in one tensor, each of
//! the two with its own rate.

use burn::optim::{Adam, AdamConfig, AdamState, AdaptiveMomentumState, Optimizer};
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;

use crate::network::device::host_device;
use crate::network::weights::StackWeights;

/// Adam's guard against division by zero; the paper's framework default. burn's own default, 1e-5, is above many of
/// the gradients here.
const EPSILON: f32 = 1e-8;

/// Numbers of C that Adam steps at once. It works on each number alone, so the size changes no bit; burn makes some ten
/// passes, each with a temporary, and a piece with all of them stays in the second-level cache.
const PIECE_LEN: usize = 1 << 14;

/// Both moments of one tensor, as plain numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Moments {
    pub(super) first: Vec<f32>,
    pub(super) second: Vec<f32>,
}

/// All that Adam remembers, as plain numbers for the checkpoint.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StepperState {
    /// Steps behind the moments, at least one.
    pub(super) time: u64,
    pub(super) components: Moments,
    pub(super) convolutions: Moments,
}

/// Takes steps.
pub(super) struct Stepper {
    adam: Adam,
    device: Device,
    /// One for each piece of C, block by block; empty before the first step.
    components: Vec<Option<AdamState<1>>>,
    convolutions: Option<AdamState<1>>,
}

impl Stepper {
    pub(super) fn new() -> Self {
        let adam = AdamConfig::new().with_epsilon(EPSILON).build();
        Self {
            adam,
            device: host_device(),
            components: Vec::new(),
            convolutions: None,
        }
    }

    /// One step down the gradient.
    pub(super) fn step(
        &mut self,
        weights: &mut StackWeights,
        gradient: &StackWeights,
        component_rate: f64,
        convolution_rate: f64,
    ) {
        let (adam, device) = (&self.adam, &self.device);
        let mut values = weights.flat_convolutions();
        let slope = gradient.flat_convolutions();
        step_piece(
            adam,
            device,
            convolution_rate,
            &mut values,
            &slope,
            &mut self.convolutions,
        );
        weights.set_flat_convolutions(&values);
        let pieces: Vec<(&mut [f32], &[f32])> = weights
            .blocks_mut()
            .zip(gradient.blocks())
            .flat_map(|(block, gradient)| {
                let slopes = gradient.components.chunks(PIECE_LEN);
                block.components.chunks_mut(PIECE_LEN).zip(slopes)
            })
            .collect();
        self.components.resize_with(pieces.len(), || None);
        pieces
            .into_par_iter()
            .zip(&mut self.components)
            .for_each(|((values, slope), state)| step_piece(adam, device, component_rate, values, slope, state));
    }

    /// What a checkpoint keeps; nothing before the first step.
    pub(super) fn state(&self) -> Option<StepperState> {
        let components: Vec<&AdamState<1>> = self.components.iter().flatten().collect();
        let convolutions = self.convolutions.as_ref()?;
        let time = components.first()?.momentum.time as u64;
        Some(StepperState {
            time,
            components: moments(&components),
            convolutions: moments(&[convolutions]),
        })
    }

    /// Goes on from what a checkpoint kept of a fit of such weights.
    pub(super) fn restore(state: Option<StepperState>, weights: &StackWeights) -> Self {
        let mut stepper = Self::new();
        if let Some(state) = state {
            let device = &stepper.device;
            let rebuild = |first: &[f32], second: &[f32]| {
                let (first, second) = (upload(first, device), upload(second, device));
                Some(AdamState::new(AdaptiveMomentumState::new(
                    state.time as usize,
                    first,
                    second,
                )))
            };
            let (mut first, mut second) = (state.components.first.as_slice(), state.components.second.as_slice());
            for piece in weights.blocks().flat_map(|block| block.components.chunks(PIECE_LEN)) {
                let (own_first, own_second);
                (own_first, first) = first.split_at(piece.len());
                (own_second, second) = second.split_at(piece.len());
                stepper.components.push(rebuild(own_first, own_second));
            }
            stepper.convolutions = rebuild(&state.convolutions.first, &state.convolutions.second);
        }
        stepper
    }
}

fn step_piece(
    adam: &Adam,
    device: &Device,
    rate: f64,
    values: &mut [f32],
    slope: &[f32],
    state: &mut Option<AdamState<1>>,
) {
    let (stepped, next) = adam.step(rate, upload(values, device), upload(slope, device), state.take());
    *state = next;
    values.copy_from_slice(&download(stepped));
}

/// The moments of consecutive pieces, end to end.
fn moments(pieces: &[&AdamState<1>]) -> Moments {
    let join = |pick: fn(&AdamState<1>) -> &Tensor<1>| {
        let parts = pieces.iter().map(|state| download(pick(state).clone()));
        parts.collect::<Vec<_>>().concat()
    };
    Moments {
        first: join(|state| &state.momentum.moment_1),
        second: join(|state| &state.momentum.moment_2),
    }
}

fn upload(values: &[f32], device: &Device) -> Tensor<1> {
    Tensor::from_data(TensorData::new(values.to_vec(), [values.len()]), device)
}

fn download(tensor: Tensor<1>) -> Vec<f32> {
    tensor
        .into_data()
        .try_into_vec()
        .expect("tensors of this module are made of f32")
}
