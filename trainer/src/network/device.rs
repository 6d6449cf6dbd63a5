//! The one place that names the device tensors live on.
//!
//! burn-ndarray is the project's chosen device: it runs on every machine that has only a Rust compiler. Upstream
//! deprecated it in 0.22.0 in favour of burn-flex, so the version is pinned and nothing outside this file names it;
//! another device is a change of this file alone.

use burn::tensor::Device;

/// Where parameters, moments and the differentiable model live.
#[allow(deprecated, reason = "burn-ndarray is pinned and kept: see the head of this file")]
pub fn training_device() -> Device {
    Device::ndarray()
}
