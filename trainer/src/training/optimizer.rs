//! burn's Adam over the stack's weights: one tensor for all of C, one for all convolutions, each with its own rate.

use burn::optim::{Adam, AdamConfig, AdamState, AdaptiveMomentumState, Optimizer};
use burn::tensor::{Device, Tensor, TensorData};

use crate::network::device::host_device;
use crate::network::weights::StackWeights;

/// Adam's guard against division by zero; the paper's framework default. burn's own default, 1e-5, is above many of
/// the gradients here.
const EPSILON: f32 = 1e-8;

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
    components: Option<AdamState<1>>,
    convolutions: Option<AdamState<1>>,
}

impl Stepper {
    pub(super) fn new() -> Self {
        let adam = AdamConfig::new().with_epsilon(EPSILON).build();
        Self {
            adam,
            device: host_device(),
            components: None,
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
        let (values, slope) = (weights.flat_components(), gradient.flat_components());
        let stepped = self.step_tensor(component_rate, values, slope, true);
        weights.set_flat_components(&stepped);
        let (values, slope) = (weights.flat_convolutions(), gradient.flat_convolutions());
        let stepped = self.step_tensor(convolution_rate, values, slope, false);
        weights.set_flat_convolutions(&stepped);
    }

    fn step_tensor(&mut self, rate: f64, values: Vec<f32>, gradient: Vec<f32>, of_components: bool) -> Vec<f32> {
        let state = if of_components {
            &mut self.components
        } else {
            &mut self.convolutions
        };
        let (values, gradient) = (upload(values, &self.device), upload(gradient, &self.device));
        let (stepped, next) = self.adam.step(rate, values, gradient, state.take());
        *state = next;
        download(stepped)
    }

    /// What a checkpoint keeps; nothing before the first step.
    pub(super) fn state(&self) -> Option<StepperState> {
        let moments = |state: &AdamState<1>| Moments {
            first: download(state.momentum.moment_1.clone()),
            second: download(state.momentum.moment_2.clone()),
        };
        let (components, convolutions) = (self.components.as_ref()?, self.convolutions.as_ref()?);
        Some(StepperState {
            time: components.momentum.time as u64,
            components: moments(components),
            convolutions: moments(convolutions),
        })
    }

    /// Goes on from what a checkpoint kept.
    pub(super) fn restore(state: Option<StepperState>) -> Self {
        let mut stepper = Self::new();
        if let Some(state) = state {
            let device = stepper.device.clone();
            let rebuild = |moments: Moments| {
                let (first, second) = (upload(moments.first, &device), upload(moments.second, &device));
                Some(AdamState::new(AdaptiveMomentumState::new(
                    state.time as usize,
                    first,
                    second,
                )))
            };
            stepper.components = rebuild(state.components);
            stepper.convolutions = rebuild(state.convolutions);
        }
        stepper
    }
}

fn upload(values: Vec<f32>, device: &Device) -> Tensor<1> {
    let len = values.len();
    Tensor::from_data(TensorData::new(values, [len]), device)
}

fn download(tensor: Tensor<1>) -> Vec<f32> {
    tensor
        .into_data()
        .try_into_vec()
        .expect("tensors of this module are made of f32")
}
