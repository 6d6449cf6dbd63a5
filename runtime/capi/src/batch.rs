//! The batch handle: many instances of one basis, played by as many threads as the caller lends. No thread is made here, and
//! none waits.

use core::ffi::c_void;
use core::sync::atomic::{AtomicI32, Ordering};

use sinew_runtime::Batch;

use crate::basis::{SinewBasis, share_basis};
use crate::carve::Carver;
use crate::controls::SinewControls;
use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::frame::Target;
use crate::handle::{Body, Handle};
use crate::kind::Kind;
use crate::memory::{Out, Regions, SinewLayout, handle_memory};
use crate::number;
use crate::status::{SinewStatus, known};
use crate::structs::{Elements, GrowingElement, GrowingStruct, StructOut};
use crate::workspace::SinewWorkspace;

/// A round of frames over many instances, whose handles and buffers stay in place until the last use of the batch.
pub struct SinewBatch {
    _opaque: (),
}

/// One instance: what `sinew_frame` would get. Members mean what they mean in `SinewFrameOptions`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewInstance {
    /// Its workspace, of either tier; no other instance's.
    pub workspace: *mut SinewWorkspace,
    /// Its controls; no other instance's.
    pub controls: *const SinewControls,
    /// Takes the deformed positions.
    pub positions: *mut f32,
    /// Floats that `positions` has room for: at least 3 V.
    pub position_floats: usize,
    /// Takes the normals; NULL where not wanted.
    pub normals: *mut f32,
    /// Floats that `normals` has room for: at least 3 V.
    pub normal_floats: usize,
}

// SAFETY: `repr(C)`, raw pointers and integers only.
unsafe impl GrowingElement for SinewInstance {
    const NAME: &'static str = "instances";
    const FIRST_BYTES: usize = size_of::<Self>();
}

impl SinewInstance {
    fn target(&self) -> Target {
        Target {
            workspace: self.workspace,
            controls: self.controls,
            positions: self.positions,
            position_floats: self.position_floats,
            normals: self.normals,
            normal_floats: self.normal_floats,
        }
    }
}

/// How an instance's last frame went.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewInstanceReport {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// What `sinew_frame` would have returned; `SINEW_STATUS_OK` before the first frame.
    pub status: SinewStatus,
    /// 0 before the first frame and where the frame was refused.
    pub outcome: number::SinewFrameOutcome,
}

// SAFETY: `repr(C)`, the size first. It is only written, never read.
unsafe impl GrowingStruct for SinewInstanceReport {
    const NAME: &'static str = "report";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// An instance of a round, and its place in the results.
#[derive(Clone, Copy)]
struct Job {
    target: Target,
    index: usize,
}

/// Status and outcome of an instance's last frame.
#[repr(C)]
struct Outcome {
    status: AtomicI32,
    outcome: AtomicI32,
}

struct BatchBody {
    round: Batch<'static, Job>,
    jobs: *mut Job,
    outcomes: &'static [Outcome],
}

impl Body for BatchBody {
    const KIND: Kind = Kind::Batch;
}

/// The arrays of a batch.
struct Arrays {
    jobs: &'static mut [Job],
    outcomes: &'static mut [[i32; 2]],
}

impl Arrays {
    fn cut(carver: &mut Carver, instance_count: usize) -> Self {
        let nowhere = Job {
            target: Target::NOWHERE,
            index: 0,
        };
        Self {
            jobs: carver.take(instance_count, nowhere),
            outcomes: carver.take(instance_count, [0; 2]),
        }
    }
}

fn batch_layout(instance_count: usize) -> SinewLayout {
    let mut carver = Carver::measuring();
    Arrays::cut(&mut carver, instance_count);
    Handle::<BatchBody>::layout(carver.bytes())
}

/// How much memory a batch needs.
///
/// # Safety
/// `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_batch_layout(instance_count: usize, layout: *mut SinewLayout) -> SinewStatus {
    edge(|| {
        let out = Out::required(layout, "layout", &mut Regions::new())?;
        // SAFETY: the caller's promise.
        unsafe { out.write(batch_layout(instance_count)) };
        Ok(())
    })
}

/// Makes a batch of instances, with its first round begun. Checks each against each, so it takes time with the square of
/// their number.
///
/// `instances`, `instance_count`, `instance_bytes`: copied; the last is `sizeof(SinewInstance)`. Handles are of `basis`;
/// those that are of other content are refused when they are played.
///
/// Errors: `OVERLAP` (of instances with each other too), `UNKNOWN_OPTION`.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory`, and what the instances
/// point to, stay in place until the last use of the batch.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_batch_create(
    basis: *const SinewBasis,
    instances: *const SinewInstance,
    instance_count: usize,
    instance_bytes: usize,
    memory: *mut c_void,
    memory_bytes: usize,
    batch: *mut *mut SinewBatch,
    details: *mut SinewDetails,
) -> SinewStatus {
    let create = |regions: &mut Regions| {
        let out = Out::required(batch, "batch", regions)?;
        // SAFETY: the caller's promise, both.
        let (shared, instances) = unsafe {
            (
                share_basis(basis, regions)?,
                Elements::new(instances, instance_count, instance_bytes, regions)?,
            )
        };
        let layout = batch_layout(instance_count);
        let memory = handle_memory(memory, memory_bytes, layout, regions)?;
        let vertex_count = shared.basis.vertex_count();
        for index in 0..instance_count {
            let target = instance(&instances, index)?;
            let mut alone = Regions::new();
            // SAFETY: the caller's promise, all.
            unsafe {
                target.check(vertex_count, &mut { *regions })?;
                target.check(vertex_count, &mut alone)?;
                for other in 0..index {
                    instance(&instances, other)?.check(vertex_count, &mut { alone })?;
                }
            }
        }
        let body = |buffers: &'static mut [u8]| {
            let Arrays { jobs, outcomes } = Arrays::cut(&mut Carver::carving(buffers), instance_count);
            for (index, job) in jobs.iter_mut().enumerate() {
                *job = Job {
                    target: instance(&instances, index)?,
                    index,
                };
            }
            let first = jobs.as_mut_ptr();
            Ok(BatchBody {
                // SAFETY: the array that was just written, used through this alone.
                round: Batch::new(unsafe { core::slice::from_raw_parts_mut(first, instance_count) }),
                jobs: first,
                // SAFETY: an outcome is two integers; nobody else has the array.
                outcomes: unsafe { core::slice::from_raw_parts(outcomes.as_mut_ptr().cast(), instance_count) },
            })
        };
        // SAFETY: the memory was checked against this layout.
        unsafe { out.write(Handle::create(memory, layout, body)?.cast()) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, create) }
}

fn instance(instances: &Elements<SinewInstance>, index: usize) -> Result<Target, Fault> {
    let missing = Fault::NoSuchInstance {
        instance: index,
        instance_count: instances.count(),
    };
    Ok(instances.get(index).ok_or(missing)??.target())
}

/// Plays a frame of instances until none is left of this round. Any number of threads call it for one round; each instance
/// is played once, by the thread that comes first, and the results have the same bits whatever the number of threads. The
/// round is over when every call has returned; what became of each instance, `sinew_batch_report` says. Waits for nothing.
///
/// `basis`: of the instances' content.
/// `played`: NULL, or takes how many instances this call had.
///
/// Errors: none but the usual. A refusal of one instance stays with it.
///
/// # Safety
/// `basis` is NULL or a basis; `batch` is NULL or a batch; the others are NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_batch_play(
    basis: *const SinewBasis,
    batch: *const SinewBatch,
    played: *mut usize,
    details: *mut SinewDetails,
) -> SinewStatus {
    let play = |regions: &mut Regions| {
        let out = Out::optional(played, "played", regions)?;
        // SAFETY: the caller's promise, both.
        let (basis, batch) = unsafe {
            (
                share_basis(basis, regions)?,
                Handle::<BatchBody>::share(batch.cast(), regions)?,
            )
        };
        let count = batch.round.work(|job| {
            // SAFETY: what `sinew_batch_create` was promised; no other call has this job.
            let done = unsafe { job.target.play(&basis.basis, &mut { *regions }) };
            let (status, outcome) = match done {
                Ok(report) => (SinewStatus::Ok, report.outcome as i32),
                Err(fault) => (fault.status(), 0),
            };
            if let Some(own) = batch.outcomes.get(job.index) {
                own.status.store(status as i32, Ordering::Relaxed);
                own.outcome.store(outcome, Ordering::Relaxed);
            }
        });
        // SAFETY: the caller's promise.
        unsafe { out.write(count) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, play) }
}

/// Begins the next round: every instance will be played again. `IN_USE` while another thread is playing.
///
/// # Safety
/// `batch` is NULL or a batch.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_batch_begin(batch: *mut SinewBatch) -> SinewStatus {
    edge(|| {
        // SAFETY: the caller's promise.
        let mut lent = unsafe { Handle::<BatchBody>::lend(batch.cast(), &mut Regions::new())? };
        let (first, count) = (lent.jobs, lent.outcomes.len());
        // SAFETY: the batch's own array; the round that had it ends here, and nobody is at work.
        lent.round = Batch::new(unsafe { core::slice::from_raw_parts_mut(first, count) });
        Ok(())
    })
}

/// How an instance's last frame went; certain once the round is over.
///
/// Errors: `NO_SUCH_INSTANCE`.
///
/// # Safety
/// `batch` is NULL or a batch; `report` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_batch_report(
    batch: *const SinewBatch,
    instance: usize,
    report: *mut SinewInstanceReport,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (out, shared) = unsafe {
            (
                StructOut::required(report, regions)?,
                Handle::<BatchBody>::share(batch.cast(), regions)?,
            )
        };
        let own = shared.outcomes.get(instance).ok_or(Fault::NoSuchInstance {
            instance,
            instance_count: shared.outcomes.len(),
        })?;
        out.write(&SinewInstanceReport {
            struct_bytes: size_of::<SinewInstanceReport>(),
            status: known(own.status.load(Ordering::Relaxed)),
            outcome: own.outcome.load(Ordering::Relaxed),
        });
        Ok(())
    })
}
