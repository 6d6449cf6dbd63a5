//! The controls handle: the K weights that a performer moves. Holds copies of the ranges, so that setting a weight needs
//! neither basis nor package.

use core::ffi::c_void;

use sinew_runtime::{Basis, ControlError, Controls, FrameError};

use crate::basis::{SinewBasis, share_basis};
use crate::carve::Carver;
use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle, Lent};
use crate::kind::Kind;
use crate::memory::{Out, Regions, SinewLayout, handle_memory, slice, slice_mut};
use crate::status::SinewStatus;

/// One weight a component, 0 at rest.
pub struct SinewControls {
    _opaque: (),
}

pub(crate) struct ControlsBody {
    basis_id: [u8; 16],
    arrays: Arrays,
}

/// The arrays of a handle with `K` controls.
struct Arrays {
    /// Shape: `[K]`, finite.
    weights: &'static mut [f32],
    /// Lower and upper stops. Shape: `[K]`.
    ranges: &'static mut [[f32; 2]],
}

impl Arrays {
    fn cut(carver: &mut Carver, control_count: usize) -> Self {
        Self {
            weights: carver.take(control_count, 0.0),
            ranges: carver.take(control_count, [0.0; 2]),
        }
    }
}

impl Body for ControlsBody {
    const KIND: Kind = Kind::Controls;
}

impl ControlsBody {
    pub(crate) fn layout(basis: &Basis<'_>) -> SinewLayout {
        let mut carver = Carver::measuring();
        Arrays::cut(&mut carver, basis.component_count());
        Handle::<Self>::layout(carver.bytes())
    }

    /// # Safety
    /// `memory` was checked against the layout for this basis.
    pub(crate) unsafe fn create(basis: &Basis<'_>, memory: *mut u8) -> Result<*mut SinewControls, Fault> {
        let body = |buffers: &'static mut [u8]| {
            let arrays = Arrays::cut(&mut Carver::carving(buffers), basis.component_count());
            for (range, component) in arrays.ranges.iter_mut().zip(basis.components()) {
                *range = [component.minimum, component.maximum];
            }
            Ok(Self {
                basis_id: basis.id(),
                arrays,
            })
        };
        // SAFETY: the caller's promise.
        Ok(unsafe { Handle::create(memory, Self::layout(basis), body)? }.cast())
    }

    /// The weights, for a basis of the content that these were made for.
    pub(crate) fn weights(&mut self, basis: &Basis<'_>) -> Result<&mut [f32], Fault> {
        if self.basis_id == basis.id() {
            Ok(&mut *self.arrays.weights)
        } else {
            Err(Fault::Frame(FrameError::ForeignControls))
        }
    }

    /// Where a control stops.
    fn clamped(&self, control: usize, weight: f32) -> f32 {
        let [minimum, maximum] = self.arrays.ranges[control];
        weight.clamp(minimum, maximum)
    }

    fn check_index(&self, control: u32) -> Result<usize, Fault> {
        let (component, component_count) = (control as usize, self.arrays.weights.len());
        if component < component_count {
            Ok(component)
        } else {
            Err(Fault::Control(ControlError::NoSuchComponent {
                component,
                component_count,
            }))
        }
    }

    fn check(&self, control: u32, weight: f32) -> Result<usize, Fault> {
        let component = self.check_index(control)?;
        if weight.is_finite() {
            Ok(component)
        } else {
            Err(Fault::Control(ControlError::NotFinite { component }))
        }
    }
}

/// # Safety
/// `controls` is null or controls whose memory stands.
pub(crate) unsafe fn lend_controls<'h>(
    controls: *const SinewControls,
    regions: &mut Regions,
) -> Result<Lent<'h, ControlsBody>, Fault> {
    // SAFETY: the caller's promise.
    unsafe { Handle::lend(controls.cast(), regions) }
}

/// How much memory controls for this basis need: 12 bytes a control, and some for the handle.
///
/// # Safety
/// `basis` is NULL or a basis; `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_layout(basis: *const SinewBasis, layout: *mut SinewLayout) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(layout, "layout", regions)?;
        // SAFETY: the caller's promise, both.
        unsafe { out.write(ControlsBody::layout(&share_basis(basis, regions)?.basis)) };
        Ok(())
    })
}

/// Makes controls, all at rest.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory` stays in place, and is
/// written by nobody else, until the last use of the controls.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_create(
    basis: *const SinewBasis,
    memory: *mut c_void,
    memory_bytes: usize,
    controls: *mut *mut SinewControls,
    details: *mut SinewDetails,
) -> SinewStatus {
    let create = |regions: &mut Regions| {
        let out = Out::required(controls, "controls", regions)?;
        // SAFETY: the caller's promise, all; the memory was checked against this layout.
        unsafe {
            let shared = share_basis(basis, regions)?;
            let layout = ControlsBody::layout(&shared.basis);
            let memory = handle_memory(memory, memory_bytes, layout, regions)?;
            out.write(ControlsBody::create(&shared.basis, memory)?);
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, create) }
}

/// Sets a control, clamped to its range. An infinite knob is a fault, not a wish for the stop.
///
/// `taken`: NULL, or takes the weight after clamping.
///
/// Errors: `NO_SUCH_CONTROL`, `NOT_FINITE`.
///
/// # Safety
/// `controls` is NULL or controls; `taken` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_control_set(
    controls: *mut SinewControls,
    control: u32,
    weight: f32,
    taken: *mut f32,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::optional(taken, "taken", regions)?;
        // SAFETY: the caller's promise.
        let mut lent = unsafe { lend_controls(controls, regions)? };
        let k = lent.check(control, weight)?;
        let weight = lent.clamped(k, weight);
        lent.arrays.weights[k] = weight;
        // SAFETY: the caller's promise.
        unsafe { out.write(weight) };
        Ok(())
    })
}

/// Sets a control beyond its stops, where a pose may leave what was seen in training.
///
/// Errors: `NO_SUCH_CONTROL`, `NOT_FINITE`.
///
/// # Safety
/// `controls` is NULL or controls.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_control_set_unclamped(
    controls: *mut SinewControls,
    control: u32,
    weight: f32,
) -> SinewStatus {
    edge(|| {
        // SAFETY: the caller's promise.
        let mut lent = unsafe { lend_controls(controls, &mut Regions::new())? };
        let k = lent.check(control, weight)?;
        lent.arrays.weights[k] = weight;
        Ok(())
    })
}

/// The weight of a control.
///
/// Errors: `NO_SUCH_CONTROL`.
///
/// # Safety
/// `controls` is NULL or controls; `weight` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_control_get(
    controls: *const SinewControls,
    control: u32,
    weight: *mut f32,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(weight, "weight", regions)?;
        // SAFETY: the caller's promise.
        let lent = unsafe { lend_controls(controls, regions)? };
        let k = lent.check_index(control)?;
        // SAFETY: the caller's promise.
        unsafe { out.write(lent.arrays.weights[k]) };
        Ok(())
    })
}

/// Sets all controls at once, each clamped to its range; for animation that comes as arrays.
///
/// `weights`, `weight_count`: exactly K.
///
/// Errors: `NO_SUCH_CONTROL` (more than K), `NOT_FINITE` (none is set).
///
/// # Safety
/// `controls` is NULL or controls; `weights` is NULL or readable for `weight_count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_set_all(
    controls: *mut SinewControls,
    weights: *const f32,
    weight_count: usize,
    details: *mut SinewDetails,
) -> SinewStatus {
    let set = |regions: &mut Regions| {
        // SAFETY: the caller's promise, both.
        let (mut lent, given) = unsafe {
            let lent = lend_controls(controls, regions)?;
            let count = lent.arrays.weights.len();
            (lent, slice(weights, weight_count, count, "weights", regions)?)
        };
        let count = given.len();
        if weight_count > count {
            return Err(Fault::Control(ControlError::NoSuchComponent {
                component: count,
                component_count: count,
            }));
        }
        if let Some(component) = given.iter().position(|weight| !weight.is_finite()) {
            return Err(Fault::Control(ControlError::NotFinite { component }));
        }
        for (k, &weight) in given.iter().enumerate() {
            lent.arrays.weights[k] = lent.clamped(k, weight);
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, set) }
}

/// All weights, in order.
///
/// `weights`, `weight_count`: at least K; more stay untouched.
///
/// # Safety
/// `controls` is NULL or controls; `weights` is NULL or writable for `weight_count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_get_all(
    controls: *const SinewControls,
    weights: *mut f32,
    weight_count: usize,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        unsafe {
            let lent = lend_controls(controls, regions)?;
            let own = &*lent.arrays.weights;
            slice_mut(weights, weight_count, own.len(), "weights", regions)?.copy_from_slice(own);
        }
        Ok(())
    })
}

/// All controls to rest.
///
/// # Safety
/// `controls` is NULL or controls.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_reset(controls: *mut SinewControls) -> SinewStatus {
    edge(|| {
        // SAFETY: the caller's promise.
        let mut lent = unsafe { lend_controls(controls, &mut Regions::new())? };
        lent.arrays.weights.fill(0.0);
        Ok(())
    })
}

/// Carries weights over by name when a package is exchanged: each control of `to` that has a namesake in `from` takes its
/// weight, clamped to the new range; the others stay. Play a frame with a new workspace, then close what was there before.
///
/// `from_basis`, `from`: what was played until now. `to_basis`, `to`: what takes its place.
/// `carried`: NULL, or takes how many controls had a namesake.
///
/// Errors: `FOREIGN_CONTROLS`, `NOT_FINITE` (something wrote over the weights).
///
/// # Safety
/// The handles are NULL or handles of their kind; `carried` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_carry(
    from_basis: *const SinewBasis,
    from: *const SinewControls,
    to_basis: *const SinewBasis,
    to: *mut SinewControls,
    carried: *mut u32,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::optional(carried, "carried", regions)?;
        // SAFETY: the caller's promise, all.
        let (from_basis, mut from, to_basis, mut to) = unsafe {
            (
                share_basis(from_basis, regions)?,
                lend_controls(from, regions)?,
                share_basis(to_basis, regions)?,
                lend_controls(to, regions)?,
            )
        };
        let weights = Controls::resume(&from_basis.basis, from.weights(&from_basis.basis)?)?;
        let weights = weights.weights();
        to.weights(&to_basis.basis)?;
        let (mut found, mut next) = (0, 0);
        for (k, component) in to_basis.basis.components().enumerate() {
            // Most exchanges keep the order: the search begins behind the last namesake.
            let mut places = (next..weights.len()).chain(0..next);
            let Some(namesake) = places.find(|&place| from_basis.basis.component(place).name == component.name) else {
                continue;
            };
            to.arrays.weights[k] = to.clamped(k, weights[namesake]);
            (found, next) = (found + 1, namesake + 1);
        }
        // SAFETY: the caller's promise.
        unsafe { out.write(found) };
        Ok(())
    })
}
