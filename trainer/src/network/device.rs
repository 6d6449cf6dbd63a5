//! The one place that names the devices tensors live on.
//!
//! burn-ndarray is the project's chosen device: it runs on every machine that has only a Rust compiler. Upstream
//! deprecated it in 0.22.0 in favour of burn-flex, so the version is pinned and nothing outside this file names it.
//! The features `cuda`, `wgpu` and `flex` put the differentiable model (`engine = "tensors"`) on another device, the
//! first of them that is on; the optimiser and the fused kernel stay on the host.

use burn::tensor::Device;

/// Where the differentiable model computes.
pub fn model_device() -> Device {
    cuda().or_else(wgpu).or_else(flex).unwrap_or_else(host_device)
}

/// The first card, where the build has the feature.
fn cuda() -> Option<Device> {
    #[cfg(feature = "cuda")]
    return Some(Device::cuda(0));
    #[cfg(not(feature = "cuda"))]
    None
}

/// What wgpu takes for the best card, where the build has the feature.
fn wgpu() -> Option<Device> {
    #[cfg(feature = "wgpu")]
    return Some(Device::wgpu(burn::tensor::DeviceKind::DefaultDevice));
    #[cfg(not(feature = "wgpu"))]
    None
}

/// The host by burn-flex, where the build has the feature.
fn flex() -> Option<Device> {
    #[cfg(feature = "flex")]
    return Some(Device::flex());
    #[cfg(not(feature = "flex"))]
    None
}

/// Where the optimiser keeps its moments: beside the weights, which every step reads back.
#[allow(deprecated, reason = "burn-ndarray is pinned and kept: see the head of this file")]
pub fn host_device() -> Device {
    Device::ndarray()
}
