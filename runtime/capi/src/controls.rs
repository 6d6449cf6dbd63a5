//! The controls handle: the K weights that a performer moves. Holds copies of the ranges, so that setting a weight needs
//! neither basis nor package.

use sinew_runtime::{Basis, ControlError, FrameError};

use crate::basis::{SinewBasis, share_basis};
use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle, Kind, Lent};
use crate::memory::{Access, Out, Regions, SinewLayout, array, handle_memory};
use crate::status::SinewStatus;

/// One weight a component, 0 at rest, in memory of yours.
pub struct SinewControls {
    _opaque: (),
}

pub(crate) struct ControlsBody {
    basis_id: [u8; 16],
    /// Shape: `[K]`, finite.
    pub(crate) weights: &'static mut [f32],
    /// Lower and upper stops. Shape: `[K]`.
    ranges: &'static [[f32; 2]],
}

impl Body for ControlsBody {
    const KIND: Kind = Kind::Controls;
}

impl ControlsBody {
    const BYTES_A_CONTROL: usize = size_of::<f32>() + size_of::<[f32; 2]>();

    fn layout(control_count: usize) -> SinewLayout {
        Handle::<Self>::layout(control_count * Self::BYTES_A_CONTROL)
    }

    /// Refuses a basis of other content.
    pub(crate) fn check_basis(&self, basis: &Basis<'_>) -> Result<(), Fault> {
        if self.basis_id == basis.id() {
            Ok(())
        } else {
            Err(Fault::Frame(FrameError::ForeignControls))
        }
    }

    /// Where a control stops.
    fn clamped(&self, control: usize, weight: f32) -> f32 {
        let [minimum, maximum] = self.ranges[control];
        weight.clamp(minimum, maximum)
    }

    fn check_index(&self, control: u32) -> Result<usize, Fault> {
        let (component, component_count) = (control as usize, self.weights.len());
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
/// Errors: those of a handle; `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_layout(basis: *const SinewBasis, layout: *mut SinewLayout) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(layout, "layout", regions)?;
        // SAFETY: the caller's promise, both.
        unsafe {
            let shared = share_basis(basis, regions)?;
            out.write(ControlsBody::layout(shared.basis.component_count()));
        }
        Ok(())
    })
}

/// Makes controls, all at rest.
///
/// `memory`, `memory_bytes`: at least what `sinew_controls_layout` says; what lies beyond that stays untouched.
/// `controls`: takes the handle, which lies at `memory`.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`.
/// Threads: any number at a time, each with `memory` of its own.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory` stays in place, and is
/// written by nobody else, until the last use of the controls.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_create(
    basis: *const SinewBasis,
    memory: *mut u8,
    memory_bytes: usize,
    controls: *mut *mut SinewControls,
    details: *mut SinewDetails,
) -> SinewStatus {
    let create = |regions: &mut Regions| {
        let out = Out::required(controls, "controls", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let basis = &shared.basis;
        let count = basis.component_count();
        let layout = ControlsBody::layout(count);
        handle_memory(memory, memory_bytes, layout, regions)?;
        let body = |buffers: &'static mut [u8]| {
            let start = buffers.as_mut_ptr();
            // SAFETY: the layout holds three arrays of `count` floats, aligned to 64 bytes, and zero bits are floats.
            let (weights, ranges) = unsafe {
                start.write_bytes(0, count * ControlsBody::BYTES_A_CONTROL);
                (
                    core::slice::from_raw_parts_mut(start.cast::<f32>(), count),
                    core::slice::from_raw_parts_mut(start.cast::<f32>().add(count).cast::<[f32; 2]>(), count),
                )
            };
            for (range, component) in ranges.iter_mut().zip(basis.components()) {
                *range = [component.minimum, component.maximum];
            }
            Ok(ControlsBody {
                basis_id: basis.id(),
                weights,
                ranges,
            })
        };
        // SAFETY: the memory was checked against this layout.
        unsafe { out.write(Handle::create(memory, layout, body)?.cast()) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, create) }
}

/// Ends controls: later calls with them are refused with `CLOSED_HANDLE` while their memory stands. There is nothing to
/// free, so this is optional before the memory is given back.
///
/// Errors: those of a handle.
/// Threads: one at a time for each controls handle; another one's use at this moment is noticed.
///
/// # Safety
/// `controls` is NULL or points to a handle's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_close(controls: *mut SinewControls) -> SinewStatus {
    // SAFETY: the caller's promise.
    edge(|| unsafe { Handle::<ControlsBody>::close(controls.cast()) })
}

/// Sets a control, clamped to its range. NaN and infinities are refused: an infinite knob is a fault, not a wish for the
/// stop.
///
/// `taken`: NULL, or takes the weight after clamping.
///
/// Errors: those of a handle; `NO_SUCH_CONTROL`, `NOT_FINITE`, `OVERLAP`.
/// Threads: one at a time for each controls handle; another one's use at this moment is noticed.
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
        lent.weights[k] = weight;
        // SAFETY: the caller's promise.
        unsafe { out.write(weight) };
        Ok(())
    })
}

/// Sets a control beyond its stops, where a pose may leave what was seen in training.
///
/// Errors: those of a handle; `NO_SUCH_CONTROL`, `NOT_FINITE`.
/// Threads: one at a time for each controls handle; another one's use at this moment is noticed.
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
        lent.weights[k] = weight;
        Ok(())
    })
}

/// The weight of a control.
///
/// Errors: those of a handle; `NO_SUCH_CONTROL`, `OVERLAP`.
/// Threads: one at a time for each controls handle; another one's use at this moment is noticed.
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
        unsafe { out.write(lent.weights[k]) };
        Ok(())
    })
}

/// Sets all controls at once, each clamped to its range; for animation that comes as arrays.
///
/// `weights`, `weight_count`: exactly K.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Errors: those of a handle; `TOO_SHORT`, `NO_SUCH_CONTROL` (more than K), `NOT_FINITE` (none is set),
/// `OVERLAP`, `STRUCT_SIZE`.
/// Threads: one at a time for each controls handle; another one's use at this moment is noticed.
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
        // SAFETY: the caller's promise.
        let mut lent = unsafe { lend_controls(controls, regions)? };
        let count = lent.weights.len();
        array(weights, weight_count, count, "weights", Access::Read, regions)?;
        if weight_count > count {
            return Err(Fault::Control(ControlError::NoSuchComponent {
                component: count,
                component_count: count,
            }));
        }
        // SAFETY: the caller's promise; checked, and apart from the controls' memory.
        let given = unsafe { core::slice::from_raw_parts(weights, count) };
        if let Some(component) = given.iter().position(|weight| !weight.is_finite()) {
            return Err(Fault::Control(ControlError::NotFinite { component }));
        }
        for (k, &weight) in given.iter().enumerate() {
            lent.weights[k] = lent.clamped(k, weight);
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
/// Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`.
/// Threads: one at a time for each controls handle; another one's use at this moment is noticed.
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
        // SAFETY: the caller's promise.
        let lent = unsafe { lend_controls(controls, regions)? };
        let count = lent.weights.len();
        array(weights, weight_count, count, "weights", Access::Write, regions)?;
        // SAFETY: the caller's promise; checked, and apart from the controls' memory.
        unsafe { lent.weights.as_ptr().copy_to_nonoverlapping(weights, count) };
        Ok(())
    })
}

/// All controls to rest.
///
/// Errors: those of a handle.
/// Threads: one at a time for each controls handle; another one's use at this moment is noticed.
///
/// # Safety
/// `controls` is NULL or controls.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_controls_reset(controls: *mut SinewControls) -> SinewStatus {
    edge(|| {
        // SAFETY: the caller's promise.
        unsafe { lend_controls(controls, &mut Regions::new())? }
            .weights
            .fill(0.0);
        Ok(())
    })
}
