//! The control surface: one device's knobs, from their events to the weights of a basis. Everything between a reading and a
//! control in the order in which it acts: calibration, supply, deadband, filter, pages, takeover, response, slew, failsafe.
//!
//! Several surfaces may share one set of controls, and so may other code: a weight that somebody else changed is taken up
//! where it is, as after a page change.

mod frame;
mod knob;
mod state;

use core::fmt;

use super::event::{KnobEvent, Reading};
use super::failsafe::{Ease, Failsafe, SurfaceStatus, Watch};
use super::map::{Command, ControlMap};
use super::pages::TreeView;
use super::source::SourceEvent;
use super::supply::Supply;
use super::takeover::Grip;
pub use knob::KnobState;
pub use state::Assignment;

/// How a surface behaves as a whole.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SurfaceSettings {
    /// What happens when the device does not behave.
    pub failsafe: Failsafe,
    /// Whether to correct the readings for a supply that sags: for potentiometers on a weak rail, never for MIDI or for
    /// sliders of a program. Default no.
    pub follow_supply: bool,
}

/// How much memory a surface needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SurfaceLayout {
    /// Elements of [`KnobState`].
    pub knob_count: usize,
    /// Elements of [`SlotState`].
    pub slot_count: usize,
}

impl SurfaceLayout {
    /// Layout for a map: one state a knob, one slot a binding and a knob of the tree.
    pub fn for_map(map: &ControlMap<'_>) -> Self {
        Self {
            knob_count: map.knobs.len(),
            slot_count: map.bindings.len() + map.tree.map_or(0, |tree| tree.slot_count()),
        }
    }
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
                "the surface needs {} knob states and {} slots and got {} and {}",
                required.knob_count, required.slot_count, actual.knob_count, actual.slot_count
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

/// A frame longer than this counts as this long: after a stall nothing leaps.
pub const FRAME_US_MAX: u64 = 100_000;

/// One device's knobs on one basis. Events as they come, [`ControlSurface::advance`] once a frame; neither allocates, and
/// both cost O(knobs + bindings), except that a change of the tree's pages and the way to rest look at every component.
#[derive(Debug)]
pub struct ControlSurface<'m> {
    map: ControlMap<'m>,
    settings: SurfaceSettings,
    knobs: &'m mut [KnobState],
    slots: &'m mut [SlotState],
    page: u16,
    view: TreeView,
    now_us: Option<u64>,
    watch: Watch,
    supply: Supply,
    lost_since_us: Option<u64>,
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
    /// A surface that has heard nothing yet and holds every weight. Elements beyond the layout's stay untouched.
    ///
    /// # Errors
    /// [`SurfaceError::TooSmall`].
    pub fn new(
        map: ControlMap<'m>,
        settings: SurfaceSettings,
        knobs: &'m mut [KnobState],
        slots: &'m mut [SlotState],
    ) -> Result<Self, SurfaceError> {
        let required = SurfaceLayout::for_map(&map);
        let actual = SurfaceLayout {
            knob_count: knobs.len(),
            slot_count: slots.len(),
        };
        if actual.knob_count < required.knob_count || actual.slot_count < required.slot_count {
            return Err(SurfaceError::TooSmall { required, actual });
        }
        let knobs = &mut knobs[..required.knob_count];
        let slots = &mut slots[..required.slot_count];
        knobs.fill(KnobState::default());
        slots.fill(SlotState::default());
        let mut surface = Self {
            map,
            settings,
            knobs,
            slots,
            page: 0,
            view: TreeView::default(),
            now_us: None,
            watch: Watch::default(),
            supply: Supply::default(),
            lost_since_us: None,
            ease: None,
            buttons_down: 0,
            stop_down: false,
            stop_asked: false,
            stopping: false,
            status: SurfaceStatus {
                supply: 1.0,
                ..SurfaceStatus::default()
            },
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
        let first = self.knobs[index].read(&self.map.knobs[index], at_us, event.reading, self.supply.factor());
        if first {
            for slot in 0..self.slots.len() {
                if self.wiring(slot).is_some_and(|wiring| wiring.knob == index) {
                    self.slots[slot].armed = false;
                }
            }
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
        for (slot, binding) in self.slots.iter_mut().zip(self.map.bindings) {
            // What holds on both pages stays in the hand.
            if !ControlMap::holds(binding, before) {
                slot.armed = false;
            }
        }
    }

    /// Gives the tree's knobs the components of the view; those that change are taken up anew.
    fn deal(&mut self) {
        let Some(tree) = self.map.tree else { return };
        for (n, slot) in self.slots[self.map.bindings.len()..].iter_mut().enumerate() {
            let control = self.view.control_at(&self.map, &tree, n);
            if control != slot.control {
                slot.control = control;
                slot.armed = false;
            }
        }
    }

    /// The device is gone: the pose holds, then eases to rest as [`Failsafe`] says.
    pub fn unplugged(&mut self, at_us: u64) {
        if self.lost_since_us.is_none() {
            self.lost_since_us = Some(at_us);
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
        for knob in &mut *self.knobs {
            knob.forget();
        }
        self.supply = Supply::default();
        self.status.supply = 1.0;
        self.buttons_down = 0;
        self.stop_down = false;
        self.release_slots();
    }

    /// From here on every control waits to be picked up.
    fn release_slots(&mut self) {
        for slot in &mut *self.slots {
            slot.armed = false;
            slot.grip.wary = true;
        }
    }
}

#[cfg(test)]
mod tests;
