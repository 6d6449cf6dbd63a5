//! The opened package of a module instance, with its workspace, controls and outputs.

use core::cell::UnsafeCell;
use core::fmt;

use sinew_checksum::{FULL_SCALE, weight};
use sinew_runtime::{
    Basis, Component, ControlError, Controls, Frame, FrameError, FrameOutcome, OpenError, Workspace, WorkspaceError,
    WorkspaceLayout,
};

use crate::memory::Arena;

/// Why a call refused.
pub(crate) enum Fault {
    NothingReserved,
    NothingOpen,
    OutOfMemory,
    KnobAboveFullScale(u32),
    Open(OpenError),
    Workspace(WorkspaceError),
    Control(ControlError),
    Frame(FrameError),
}

impl fmt::Display for Fault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingReserved => out.write_str("no room was reserved for a package"),
            Self::NothingOpen => out.write_str("no package is open"),
            Self::OutOfMemory => out.write_str("the browser has no memory left for this package"),
            Self::KnobAboveFullScale(knob) => write!(out, "a knob reads {knob}, more than {FULL_SCALE}"),
            Self::Open(error) => error.fmt(out),
            Self::Workspace(error) => error.fmt(out),
            Self::Control(error) => error.fmt(out),
            Self::Frame(error) => error.fmt(out),
        }
    }
}

impl From<ControlError> for Fault {
    fn from(error: ControlError) -> Self {
        Self::Control(error)
    }
}

impl From<FrameError> for Fault {
    fn from(error: FrameError) -> Self {
        Self::Frame(error)
    }
}

/// A package being played. Everything lies in the arena or in the slot below.
pub(crate) struct Player {
    pub(crate) basis: &'static Basis<'static>,
    pub(crate) controls: Controls<'static>,
    workspace: Workspace<'static>,
    /// Shape: `[V]`, source order.
    pub(crate) positions: &'static mut [[f32; 3]],
    /// Shape: `[V]`, source order.
    pub(crate) normals: &'static mut [[f32; 3]],
}

impl Player {
    pub(crate) fn component(&self, k: usize) -> Result<Component<'static>, Fault> {
        let component_count = self.basis.component_count();
        if k < component_count {
            Ok(self.basis.component(k))
        } else {
            Err(ControlError::NoSuchComponent {
                component: k,
                component_count,
            }
            .into())
        }
    }

    pub(crate) fn set_knob(&mut self, k: usize, knob: u32) -> Result<f32, Fault> {
        let component = self.component(k)?;
        let reading = u16::try_from(knob).ok().filter(|&knob| knob <= FULL_SCALE);
        let reading = reading.ok_or(Fault::KnobAboveFullScale(knob))?;
        Ok(self.controls.set(k, weight(&component, reading))?)
    }

    pub(crate) fn frame(&mut self) -> Result<FrameOutcome, Fault> {
        let job = Frame {
            basis: self.basis,
            controls: &self.controls,
            positions: self.positions,
            normals: Some(self.normals),
        };
        Ok(job.run(&mut self.workspace)?)
    }
}

/// What an instance keeps, beside the basis that the player borrows.
struct State {
    player: Option<Player>,
    /// Where the package goes, until it is opened, and the rest of the arena.
    reserved: Option<(&'static mut [u8], Arena)>,
}

struct Slot<T>(UnsafeCell<T>);

// SAFETY: the module is built without threads, so that only one call is ever inside.
unsafe impl<T> Sync for Slot<T> {}

static STATE: Slot<State> = Slot(UnsafeCell::new(State {
    player: None,
    reserved: None,
}));
/// Changed only while there is no player.
static BASIS: Slot<Option<Basis<'static>>> = Slot(UnsafeCell::new(None));

/// Room for a package; returns its address.
pub(crate) fn reserve(package_bytes: usize) -> Result<usize, Fault> {
    // SAFETY: one thread, and no reference to the state outlives a call of this module's functions.
    let state = unsafe { &mut *STATE.0.get() };
    state.player = None;
    state.reserved = None;
    // SAFETY: the player is gone, and nothing else borrows the basis.
    unsafe { *BASIS.0.get() = None };
    // SAFETY: everything that held slices of the arena is gone.
    let mut arena = unsafe { Arena::new() };
    let package = arena.take::<u8>(package_bytes).ok_or(Fault::OutOfMemory)?;
    let address = package.as_ptr().addr();
    state.reserved = Some((package, arena));
    Ok(address)
}

/// Opens what was written into the reserved bytes.
pub(crate) fn open() -> Result<(), Fault> {
    // SAFETY: as in `reserve`.
    let state = unsafe { &mut *STATE.0.get() };
    let (package, mut arena) = state.reserved.take().ok_or(Fault::NothingReserved)?;
    let opened = Basis::open(package).map_err(Fault::Open)?;
    // SAFETY: a reservation means no player, and it is used up: the basis is written before it is borrowed, and not
    // again until `reserve` has dropped the player.
    let basis: &'static Basis<'static> = unsafe { (*BASIS.0.get()).insert(opened) };
    let vertex_count = basis.vertex_count();
    let layout = WorkspaceLayout::for_basis(basis);
    let memory = arena.take::<u8>(layout.unaligned_bytes());
    let weights = arena.take::<f32>(basis.component_count());
    let (positions, normals) = (arena.take(vertex_count), arena.take(vertex_count));
    let (Some(memory), Some(weights), Some(positions), Some(normals)) = (memory, weights, positions, normals) else {
        return Err(Fault::OutOfMemory);
    };
    let mut player = Player {
        basis,
        controls: Controls::new(basis, weights)?,
        workspace: Workspace::new(basis, memory).map_err(Fault::Workspace)?,
        positions,
        normals,
    };
    player.frame()?;
    state.player = Some(player);
    Ok(())
}

/// Lets `work` at the opened package.
pub(crate) fn with_player<T>(work: impl FnOnce(&mut Player) -> Result<T, Fault>) -> Result<T, Fault> {
    // SAFETY: as in `reserve`; `work` is a closure of this crate and calls none of its exported functions.
    let state = unsafe { &mut *STATE.0.get() };
    work(state.player.as_mut().ok_or(Fault::NothingOpen)?)
}
