//! The control surface: one device's knobs, from their events to the weights of a basis. Everything between a reading and a
//! control in the order in which it acts: calibration, deadband, filter, pages, takeover, response, slew, failsafe.
//!
//! Several surfaces may share one set of controls, and so may other code: a weight that somebody else changed is taken up
//! where it is, as after a page change.

#[cfg(any(test, feature = "std"))]
mod buffers;
mod frame;
mod knob;
mod state;

use core::fmt;

use super::event::{KnobEvent, Reading};
use super::failsafe::{Ease, Failsafe, SurfaceStatus, Watch};
use super::map::{Command, ControlMap};
use super::pages::TreeView;
use super::source::SourceEvent;
use super::takeover::Grip;
#[cfg(any(test, feature = "std"))]
pub use buffers::SurfaceBuffers;
use knob::Heard;
pub use knob::KnobState;
pub use state::Assignment;

/// How a surface behaves as a whole.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SurfaceSettings {
    /// What happens when the device does not behave.
    pub failsafe: Failsafe,
    /// Whether a reading far from the last one waits until a second confirms it, or [`CONFIRM_US`] have passed: for text lines, which
    /// have no checksum, so that a lost byte makes a sound `12` of `512`. Default no.
    pub spike_guard: bool,
}

/// How much memory a surface needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SurfaceLayout {
    /// Elements of [`KnobState`].
    pub knob_count: usize,
    /// Elements of [`SlotState`].
    pub slot_count: usize,
    /// Elements of [`SurfaceMemory::left`]: components of the basis.
    pub control_count: usize,
}

impl SurfaceLayout {
    /// Layout for a map: one state a knob, one slot a binding and a knob of the tree.
    pub fn for_map(map: &ControlMap<'_>) -> Self {
        Self {
            knob_count: map.knobs.len(),
            slot_count: map.bindings.len() + map.tree.map_or(0, |tree| tree.slot_count()),
            control_count: map.basis.component_count(),
        }
    }
}

/// What a surface remembers, in the caller's memory. Elements beyond the layout's stay untouched.
#[derive(Debug)]
pub struct SurfaceMemory<'m> {
    /// One a knob.
    pub knobs: &'m mut [KnobState],
    /// One a binding and a knob of the tree.
    pub slots: &'m mut [SlotState],
    /// One a component: the weight that this surface left there; NaN where it left none.
    pub left: &'m mut [f32],
}

/// Why a surface was not made, or did not move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SurfaceError {
    /// The memory has fewer elements than the layout asks for.
    TooSmall {
        /// What is needed.
        required: SurfaceLayout,
        /// What was given.
        actual: SurfaceLayout,
    },
    /// The controls belong to another basis than the map.
    ForeignControls,
}

impl core::error::Error for SurfaceError {}

impl fmt::Display for SurfaceError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooSmall { required, actual } => write!(
                out,
                "the surface needs {} knob states, {} slots and {} weights and got {}, {} and {}",
                required.knob_count,
                required.slot_count,
                required.control_count,
                actual.knob_count,
                actual.slot_count,
                actual.control_count
            ),
            Self::ForeignControls => write!(out, "the controls belong to another basis than the map"),
        }
    }
}

/// What a surface remembers of one knob against one control.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SlotState {
    /// Component of a tree's slot.
    control: Option<u16>,
    grip: Grip,
    /// Whether the grip knows where control and knob stand; not after a change of pages or of the device.
    armed: bool,
    /// The weight last left there; another one is somebody else's.
    weight: f32,
    /// How far the weight may still go: as far as the knob took it, less what the slew limit held back.
    budget: f32,
}

/// How long the spike guard waits for a second reading, µs. A box that sends all the time answers sooner; one that speaks only
/// when turned is believed after this.
pub const CONFIRM_US: u64 = 60_000;

/// A frame longer than this counts as this long: after a stall nothing leaps.
pub const FRAME_US_MAX: u64 = 100_000;

/// One device's knobs on one basis. Events as they come, [`ControlSurface::advance`] once a frame; neither allocates, and
/// both cost O(knobs + bindings), except that a change of the tree's pages and the way to rest look at every component.
#[derive(Debug)]
pub struct ControlSurface<'m> {
    map: ControlMap<'m>,
    settings: SurfaceSettings,
    memory: SurfaceMemory<'m>,
    page: u16,
    view: TreeView,
    now_us: Option<u64>,
    watch: Watch,
    lost_since_us: Option<u64>,
    /// The way to rest, once it has begun.
    ease: Option<Ease>,
    /// Buttons that are down, by their index in the map.
    buttons_down: u64,
    /// Stop buttons that are down, and the program's own.
    stop_down: bool,
    stop_asked: bool,
    /// Set by a stop, cleared once everything is at rest and nobody holds it.
    stopping: bool,
    status: SurfaceStatus,
}

impl<'m> ControlSurface<'m> {
    /// A surface that has heard nothing yet and holds every weight.
    ///
    /// # Errors
    /// [`SurfaceError::TooSmall`].
    pub fn new(
        map: ControlMap<'m>,
        settings: SurfaceSettings,
        memory: SurfaceMemory<'m>,
    ) -> Result<Self, SurfaceError> {
        let required = SurfaceLayout::for_map(&map);
        let actual = SurfaceLayout {
            knob_count: memory.knobs.len(),
            slot_count: memory.slots.len(),
            control_count: memory.left.len(),
        };
        let is_enough = actual.knob_count >= required.knob_count
            && actual.slot_count >= required.slot_count
            && actual.control_count >= required.control_count;
        if !is_enough {
            return Err(SurfaceError::TooSmall { required, actual });
        }
        let memory = SurfaceMemory {
            knobs: &mut memory.knobs[..required.knob_count],
            slots: &mut memory.slots[..required.slot_count],
            left: &mut memory.left[..required.control_count],
        };
        memory.knobs.fill(KnobState::default());
        memory.slots.fill(SlotState::default());
        memory.left.fill(f32::NAN);
        let mut surface = Self {
            map,
            settings,
            memory,
            page: 0,
            view: TreeView::default(),
            now_us: None,
            watch: Watch::default(),
            lost_since_us: None,
            ease: None,
            buttons_down: 0,
            stop_down: false,
            stop_asked: false,
            stopping: false,
            status: SurfaceStatus::default(),
        };
        surface.deal();
        Ok(surface)
    }

    /// Takes what a source says; see [`super::ControlSource::poll`].
    pub fn source_event(&mut self, at_us: u64, event: SourceEvent) {
        match event {
            SourceEvent::Knob(event) => self.event(at_us, event),
            SourceEvent::Unplugged => self.unplugged(at_us),
            SourceEvent::Replugged => self.replugged(at_us),
            SourceEvent::Named { .. } => {}
        }
    }

    /// Takes a reading, as it arrives. Nothing moves before the next [`ControlSurface::advance`]. A device thought lost that
    /// speaks is back.
    pub fn event(&mut self, at_us: u64, event: KnobEvent) {
        if self.lost_since_us.is_some() {
            self.replugged(at_us);
        }
        self.status.events += 1;
        self.status.last_event_us = Some(at_us);
        self.watch.event(at_us, &self.settings.failsafe);
        if let Reading::Position { value, full_scale } = event.reading
            && (full_scale == 0 || value > full_scale)
        {
            self.status.invalid += 1;
            return;
        }
        if let Some(index) = self.map.buttons.iter().position(|button| button.address == event.knob) {
            let down = match event.reading {
                Reading::Position { value, full_scale } => 2 * u32::from(value) > u32::from(full_scale),
                Reading::Steps(steps) => steps > 0,
            };
            self.button(index, down, matches!(event.reading, Reading::Steps(_)));
            return;
        }
        let Some(index) = self.map.knob_at(event.knob) else {
            self.status.unlisted += 1;
            return;
        };
        let guard = self.settings.spike_guard;
        match self.memory.knobs[index].read(&self.map.knobs[index], at_us, event.reading, guard) {
            Heard::First => {
                for slot in 0..self.memory.slots.len() {
                    if self.wiring(slot).is_some_and(|wiring| wiring.knob == index) {
                        self.memory.slots[slot].armed = false;
                    }
                }
            }
            Heard::AfterSpike => self.status.spikes += 1,
            Heard::Again => {}
        }
    }

    fn button(&mut self, index: usize, down: bool, encoder: bool) {
        let bit = 1 << index;
        let was_down = self.buttons_down & bit != 0;
        if down {
            self.buttons_down |= bit;
        } else {
            self.buttons_down &= !bit;
        }
        let command = self.map.buttons[index].command;
        if command == Command::Stop {
            let mut stops = self.map.buttons.iter().enumerate();
            self.stop_down = stops.any(|(n, b)| b.command == Command::Stop && self.buttons_down & (1 << n) != 0);
            self.stopping |= self.stop_down;
        } else if down && (!was_down || encoder) {
            self.command(command);
        }
    }

    /// Does what a button would. [`Command::Stop`] holds until [`Command::Release`].
    pub fn command(&mut self, command: Command) {
        match command {
            Command::Stop => {
                self.stop_asked = true;
                self.stopping = true;
            }
            Command::Release => self.stop_asked = false,
            Command::Page(page) if page < self.map.page_count() => self.show_page(page),
            Command::Next if self.map.tree.is_none() => self.show_page((self.page + 1) % self.map.page_count()),
            Command::Previous if self.map.tree.is_none() => {
                let pages = self.map.page_count();
                self.show_page((self.page + pages - 1) % pages);
            }
            _ => {
                if let Some(tree) = self.map.tree {
                    self.view.apply(&self.map, &tree, command);
                    self.deal();
                }
            }
        }
    }

    fn show_page(&mut self, page: u16) {
        let before = self.page;
        self.page = page;
        for (slot, binding) in self.memory.slots.iter_mut().zip(self.map.bindings) {
            // What holds on both pages stays in the hand.
            if !ControlMap::holds(binding, before) {
                slot.armed = false;
            }
        }
    }

    /// Gives the tree's knobs the components of the view; those that change are taken up anew.
    fn deal(&mut self) {
        let Some(tree) = self.map.tree else { return };
        for (n, slot) in self.memory.slots[self.map.bindings.len()..].iter_mut().enumerate() {
            let control = self.view.control_at(&self.map, &tree, n);
            if control != slot.control {
                slot.control = control;
                slot.armed = false;
            }
        }
    }

    /// The device is gone: the pose holds, then what it moved and nobody else has moved since eases to rest, once, as [`Failsafe`]
    /// says.
    pub fn unplugged(&mut self, at_us: u64) {
        if self.lost_since_us.is_none() {
            self.lost_since_us = Some(at_us);
            self.ease = None;
            self.status.losses += 1;
            self.status.health.lost = true;
            self.let_go();
        }
    }

    /// The device is back. Its knobs may have been turned meanwhile: nothing moves until each has picked up its controls,
    /// whatever their takeover.
    pub fn replugged(&mut self, at_us: u64) {
        self.watch.last_event_us = Some(at_us);
        self.lost_since_us = None;
        self.status.health.lost = false;
        self.status.health.silent = false;
        self.let_go();
    }

    /// Forgets where the knobs stand, and what is down.
    fn let_go(&mut self) {
        for knob in &mut *self.memory.knobs {
            knob.forget();
        }
        self.buttons_down = 0;
        self.stop_down = false;
        self.release_slots();
    }

    /// From here on every control waits to be picked up.
    fn release_slots(&mut self) {
        for slot in &mut *self.memory.slots {
            slot.armed = false;
            slot.grip.wary = true;
        }
    }
}

#[cfg(test)]
mod tests;
