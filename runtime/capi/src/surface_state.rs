//! What a surface shows and what it can be asked for: takeover of each knob, health of the device, commands.

use sinew_knobs::{Assignment, Command, ControlMap, ControlSurface, Direction, TakeoverState};
use sinew_runtime::ControlError;

use crate::basis::SINEW_NONE;
use crate::fault::Fault;
use crate::structs::GrowingStruct;

/// What to do, as a button of the device would.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewCommand {
    /// Ease everything to rest and hold it there until `RELEASE`.
    Stop = 1,
    /// End a stop: each control stays at rest until its knob picks it up.
    Release = 2,
    /// Next page: of the tree if there is one, of the bindings otherwise. The last is followed by the first.
    Next = 3,
    /// Previous page.
    Previous = 4,
    /// Tree: the children of the knob last turned take the coarse knobs.
    Into = 5,
    /// Tree: back up.
    Out = 6,
    /// Tree: next page of the fine knobs.
    NextFine = 7,
    /// Tree: the children of the control in `argument` come onto the fine knobs.
    Focus = 8,
    /// The page of the bindings in `argument`, from 0.
    Page = 9,
}

/// Where a knob stands with what it should move.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewTakeoverState {
    /// The knob moves nothing on this page.
    Unassigned = 0,
    /// The knob has not been heard of since it was plugged in.
    Unheard = 1,
    /// Everything is held: unplugged, easing to rest, or stopped.
    Held = 2,
    /// The knob moves its control.
    Engaged = 3,
    /// The knob must first be turned left, counter-clockwise, to pick its control up.
    TurnLeft = 4,
    /// The knob must first be turned right.
    TurnRight = 5,
}

/// One knob as a display shows it.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewKnobState {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// Where it stands with its control: of several the first that is not engaged.
    pub state: SinewTakeoverState,
    /// That control; `SINEW_NONE` where there is none.
    pub control: u32,
    /// How far to turn, in travels of the knob; 0 unless it must be turned.
    pub distance: f32,
    /// Where the knob stands, calibrated and smoothed, 0 to 1; -1 for encoders, and before its first reading.
    pub position: f32,
}

// SAFETY: `repr(C)`, the size first. It is only written, never read.
unsafe impl GrowingStruct for SinewKnobState {
    const NAME: &'static str = "state";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// How a surface and its device are doing.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewSurfaceStatus {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// Readings taken.
    pub readings: u64,
    /// Of those: from addresses that no knob has.
    pub unlisted: u64,
    /// Times the device was lost.
    pub losses: u64,
    /// Whether the device is gone: said to be unplugged, or silent too long. 0 or 1, as those below.
    pub is_lost: u32,
    /// Of that: silent too long, though nobody said unplugged.
    pub is_silent: u32,
    /// It sends, but its noisy knobs do not tremble any more.
    pub is_frozen: u32,
    /// It sends more than it should.
    pub is_flooding: u32,
    /// A stop holds everything at rest, or is on its way there.
    pub is_stopped: u32,
    /// Page of the bindings, from 0.
    pub page: u32,
    /// Pages of the bindings.
    pub page_count: u32,
    /// Tree: the control whose children are on the coarse knobs; `SINEW_NONE`: the coarsest are.
    pub tree_parent: u32,
    /// Tree: the control whose children are on the fine knobs; `SINEW_NONE`: none are.
    pub tree_focus: u32,
    /// Readings that the spike guard threw away.
    pub spikes: u32,
}

// SAFETY: `repr(C)`, the size first. It is only written, never read.
unsafe impl GrowingStruct for SinewSurfaceStatus {
    const NAME: &'static str = "status";
    const FIRST_BYTES: usize = size_of::<Self>();
}

impl SinewKnobState {
    pub(crate) fn of(surface: &ControlSurface<'_>, knob: usize) -> Self {
        let own = || surface.assignments().filter(move |assignment| assignment.knob == knob);
        let is_engaged = |assignment: &Assignment| assignment.state == TakeoverState::Engaged;
        let shown = own()
            .find(|assignment| !is_engaged(assignment))
            .or_else(|| own().next());
        let (state, distance) = match shown.map(|assignment| assignment.state) {
            None | Some(TakeoverState::Unassigned) => (SinewTakeoverState::Unassigned, 0.0),
            Some(TakeoverState::Unheard) => (SinewTakeoverState::Unheard, 0.0),
            Some(TakeoverState::Held) => (SinewTakeoverState::Held, 0.0),
            Some(TakeoverState::Engaged) => (SinewTakeoverState::Engaged, 0.0),
            Some(TakeoverState::Waiting { direction, distance }) => match direction {
                Direction::Left => (SinewTakeoverState::TurnLeft, distance),
                Direction::Right => (SinewTakeoverState::TurnRight, distance),
            },
        };
        Self {
            struct_bytes: size_of::<Self>(),
            state,
            control: shown.map_or(SINEW_NONE, |assignment| assignment.control as u32),
            distance,
            position: surface.position(knob).unwrap_or(-1.0),
        }
    }
}

impl SinewSurfaceStatus {
    pub(crate) fn of(surface: &ControlSurface<'_>) -> Self {
        let (status, view) = (surface.status(), surface.view());
        let shown = |control: Option<u16>| control.map_or(SINEW_NONE, u32::from);
        Self {
            struct_bytes: size_of::<Self>(),
            readings: status.events,
            unlisted: status.unlisted,
            losses: status.losses,
            is_lost: status.health.lost.into(),
            is_silent: status.health.silent.into(),
            is_frozen: status.health.frozen.into(),
            is_flooding: status.health.flooding.into(),
            is_stopped: surface.is_stopped().into(),
            page: surface.page().into(),
            page_count: surface.map().page_count().into(),
            tree_parent: shown(view.parent),
            tree_focus: shown(view.focus),
            spikes: status.spikes.min(u32::MAX.into()) as u32,
        }
    }
}

/// The command of a number and its argument, if the map has what it names.
pub(crate) fn command(command: i32, argument: u32, map: &ControlMap<'_>) -> Result<Command, Fault> {
    const PLAIN: [(SinewCommand, Command); 7] = [
        (SinewCommand::Stop, Command::Stop),
        (SinewCommand::Release, Command::Release),
        (SinewCommand::Next, Command::Next),
        (SinewCommand::Previous, Command::Previous),
        (SinewCommand::Into, Command::Into),
        (SinewCommand::Out, Command::Out),
        (SinewCommand::NextFine, Command::NextFine),
    ];
    let index = argument as usize;
    if command == SinewCommand::Focus as i32 {
        let component_count = map.basis().component_count();
        let control = u16::try_from(argument).ok().filter(|_| index < component_count);
        return control
            .map(Command::Focus)
            .ok_or(Fault::Control(ControlError::NoSuchComponent {
                component: index,
                component_count,
            }));
    }
    if command == SinewCommand::Page as i32 {
        let page_count = map.page_count().into();
        let page = u16::try_from(argument).ok().filter(|_| index < page_count);
        return page.map(Command::Page).ok_or(Fault::NoSuchPage {
            page: index,
            page_count,
        });
    }
    let plain = PLAIN.iter().find(|(known, _)| *known as i32 == command);
    plain.map(|(_, command)| *command).ok_or(Fault::UnknownChoice {
        name: "command",
        value: command,
    })
}
