//! The opened package of a module instance, with its workspace, controls and outputs.

use core::cell::UnsafeCell;
use core::fmt;

use sinew_runtime::{
    Basis, Component, ControlError, Controls, Drag, Frame, FrameError, FrameOutcome, HandleError, Handles,
    HandlesLayout, OpenError, Workspace, WorkspaceError, WorkspaceLayout,
};

use crate::memory::Arena;

/// Vertices that can be held at once: two hands and some pins.
const HELD_MAX: usize = 8;

/// Why a call refused.
pub(crate) enum Fault {
    NothingReserved,
    NothingOpen,
    OutOfMemory,
    Open(OpenError),
    Workspace(WorkspaceError),
    Control(ControlError),
    Frame(FrameError),
    Held(HandleError),
}

impl fmt::Display for Fault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingReserved => out.write_str("no room was reserved for a package"),
            Self::NothingOpen => out.write_str("no package is open"),
            Self::OutOfMemory => out.write_str("the browser has no memory left for this package"),
            Self::Open(error) => error.fmt(out),
            Self::Workspace(error) => error.fmt(out),
            Self::Control(error) => error.fmt(out),
            Self::Frame(error) => error.fmt(out),
            Self::Held(error) => error.fmt(out),
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

impl From<HandleError> for Fault {
    fn from(error: HandleError) -> Self {
        Self::Held(error)
    }
}

/// A package being played. Everything lies in the arena or in the slot below.
pub(crate) struct Player {
    pub(crate) basis: &'static Basis<'static>,
    pub(crate) controls: Controls<'static>,
    held: Handles<'static>,
    workspace: Workspace<'static>,
    /// Shape: `[F]`, source order.
    pub(crate) faces: &'static [[u32; 3]],
    /// Shape: `[V]`, source order.
    pub(crate) positions: &'static mut [[f32; 3]],
    /// Shape: `[V]`, source order.
    pub(crate) normals: &'static mut [[f32; 3]],
    /// Whether positions and normals are those of the workspace's pose.
    is_drawn: bool,
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

    pub(crate) fn frame(&mut self) -> Result<FrameOutcome, Fault> {
        let job = Frame {
            basis: self.basis,
            controls: &self.controls,
            positions: self.positions,
            normals: Some(self.normals),
        };
        if self.is_drawn && !job.would_change(&self.workspace) {
            return Ok(FrameOutcome::Unchanged);
        }
        self.is_drawn = true;
        Ok(job.run(&mut self.workspace)?)
    }

    pub(crate) fn hold(&mut self, vertex: usize) -> Result<(), Fault> {
        Ok(self.held.add(self.basis, &mut self.workspace, vertex)?)
    }

    pub(crate) fn let_go(&mut self, vertex: usize) -> Result<(), Fault> {
        Ok(self.held.remove(vertex)?)
    }

    pub(crate) fn drag(&mut self, vertex: usize, target: [f32; 3]) -> Result<(), Fault> {
        self.held.set_target(vertex, target)?;
        let job = Drag {
            basis: self.basis,
            handles: &mut self.held,
            controls: &mut self.controls,
        };
        job.run(&mut self.workspace)?;
        Ok(())
    }
}

/// What an instance keeps, beside the basis that the player borrows.
struct State {
    player: Option<Player>,
    /// Where the package goes and how long it is, until it is opened, and the rest of the arena. No reference to the bytes is
    /// alive while the page writes them.
    reserved: Option<(usize, usize, Arena)>,
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
    let address = arena.reserve::<u8>(package_bytes).ok_or(Fault::OutOfMemory)?;
    state.reserved = Some((address, package_bytes, arena));
    Ok(address)
}

/// Opens what was written into the reserved bytes.
pub(crate) fn open() -> Result<(), Fault> {
    // SAFETY: as in `reserve`.
    let state = unsafe { &mut *STATE.0.get() };
    let (address, length, mut arena) = state.reserved.take().ok_or(Fault::NothingReserved)?;
    // SAFETY: the arena reserved these bytes, which linear memory holds whatever the page wrote; nobody writes them before
    // the next `reserve`, which ends this slice.
    let package = unsafe { core::slice::from_raw_parts(core::ptr::with_exposed_provenance(address), length) };
    let opened = Basis::open(package).map_err(Fault::Open)?;
    // SAFETY: a reservation means no player, and it is used up: the basis is written before it is borrowed, and not
    // again until `reserve` has dropped the player.
    let basis: &'static Basis<'static> = unsafe { (*BASIS.0.get()).insert(opened) };
    let vertex_count = basis.vertex_count();
    let layout = WorkspaceLayout::for_basis(basis);
    let memory = arena.take::<u8>(layout.unaligned_bytes());
    let held = arena.take::<u8>(HandlesLayout::for_basis(basis, HELD_MAX).unaligned_bytes());
    let weights = arena.take::<f32>(basis.component_count());
    let faces = arena.take::<[u32; 3]>(basis.face_count());
    let (positions, normals) = (arena.take(vertex_count), arena.take(vertex_count));
    let (Some(memory), Some(held), Some(weights)) = (memory, held, weights) else {
        return Err(Fault::OutOfMemory);
    };
    let Some(faces) = faces else {
        return Err(Fault::OutOfMemory);
    };
    let (Some(positions), Some(normals)) = (positions, normals) else {
        return Err(Fault::OutOfMemory);
    };
    faces
        .iter_mut()
        .zip(basis.faces().iter())
        .for_each(|(to, face)| *to = face);
    let mut player = Player {
        basis,
        controls: Controls::new(basis, weights)?,
        held: Handles::new(basis, HELD_MAX, held).map_err(Fault::Workspace)?,
        workspace: Workspace::new(basis, memory).map_err(Fault::Workspace)?,
        faces,
        positions,
        normals,
        is_drawn: false,
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
