//! What a surface shows: which knob moves what now, whether it waits and for which turn, and how the device is doing.

use super::{ControlSurface, SlotState};
use crate::failsafe::SurfaceStatus;
use crate::map::ControlMap;
use crate::pages::TreeView;
use crate::response::ResolvedResponse;
use crate::takeover::{Takeover, TakeoverState};

/// A slot's part of the map: who moves what, and how.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wiring {
    pub(super) knob: usize,
    pub(super) control: usize,
    pub(super) response: ResolvedResponse,
    pub(super) takeover: Takeover,
}

/// A control on a knob, now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Assignment {
    /// Index of the knob in the map's list.
    pub knob: usize,
    /// Index of the component.
    pub control: usize,
    /// Whether the knob moves it.
    pub state: TakeoverState,
    /// The weight that the component would have where the knob stands; `None` for encoders, and before the first reading.
    pub knob_weight: Option<f32>,
}

impl<'m> ControlSurface<'m> {
    /// What is wired to a slot on this page.
    pub(super) fn wiring(&self, slot: usize) -> Option<Wiring> {
        let bindings = self.map.bindings;
        let (knob, control, response, takeover) = match bindings.get(slot) {
            Some(binding) if ControlMap::holds(binding, self.page) => {
                (binding.knob.into(), binding.control, binding.response, binding.takeover)
            }
            Some(_) => return None,
            None => {
                let tree = self.map.tree?;
                let knob = tree.knobs().start + slot - bindings.len();
                (knob, self.memory.slots[slot].control?, tree.response, tree.takeover)
            }
        };
        let component = self.map.basis.component(control.into());
        let response = response.resolve(component.minimum, component.maximum).ok()?;
        Some(Wiring {
            knob,
            control: control.into(),
            response,
            takeover,
        })
    }

    /// The map.
    pub fn map(&self) -> &ControlMap<'m> {
        &self.map
    }

    /// Page of the bindings.
    pub fn page(&self) -> u16 {
        self.page
    }

    /// What the tree's knobs show.
    pub fn view(&self) -> TreeView {
        self.view
    }

    /// Whether a stop holds everything at rest, or is on its way there.
    pub fn is_stopped(&self) -> bool {
        self.stopping
    }

    /// Counts and health.
    pub fn status(&self) -> SurfaceStatus {
        self.status
    }

    /// Where a knob stands, calibrated and smoothed, in `[0, 1]`; `None` for encoders, and before its first reading.
    pub fn position(&self, knob: usize) -> Option<f32> {
        let state = self.memory.knobs.get(knob)?;
        (state.heard && !state.encoder).then_some(state.position)
    }

    /// Every control that a knob has on this page.
    pub fn assignments(&self) -> impl Iterator<Item = Assignment> + '_ {
        (0..self.memory.slots.len()).filter_map(|slot| {
            let wiring = self.wiring(slot)?;
            Some(Assignment {
                knob: wiring.knob,
                control: wiring.control,
                state: self.slot_state(&self.memory.slots[slot], &wiring),
                knob_weight: self
                    .position(wiring.knob)
                    .map(|position| wiring.response.weight(wiring.response.place(position))),
            })
        })
    }

    fn slot_state(&self, slot: &SlotState, wiring: &Wiring) -> TakeoverState {
        if self.lost_since_us.is_some() || self.stopping {
            return TakeoverState::Held;
        }
        let knob = &self.memory.knobs[wiring.knob];
        if !knob.heard {
            return TakeoverState::Unheard;
        }
        // The page has just changed; the next frame knows.
        if !slot.armed {
            return TakeoverState::Held;
        }
        if knob.encoder {
            return TakeoverState::Engaged;
        }
        slot.grip.state(wiring.takeover, wiring.response.is_inverted())
    }

    /// A knob in one word: the first of its controls that is not engaged, for "turn left to pick up".
    pub fn takeover(&self, knob: usize) -> TakeoverState {
        let mut state = TakeoverState::Unassigned;
        for assignment in self.assignments().filter(|assignment| assignment.knob == knob) {
            if assignment.state != TakeoverState::Engaged {
                return assignment.state;
            }
            state = TakeoverState::Engaged;
        }
        state
    }
}
