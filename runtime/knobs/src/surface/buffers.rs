//! Memory of a surface for programs that have a heap.

use std::vec;
use std::vec::Vec;

use super::{KnobState, SlotState, SurfaceLayout, SurfaceMemory};
use crate::map::ControlMap;

/// What a [`ControlSurface`](super::ControlSurface) borrows.
#[derive(Debug, Clone)]
pub struct SurfaceBuffers {
    knobs: Vec<KnobState>,
    slots: Vec<SlotState>,
    left: Vec<f32>,
}

impl SurfaceBuffers {
    /// As much as a map needs.
    pub fn for_map(map: &ControlMap<'_>) -> Self {
        let layout = SurfaceLayout::for_map(map);
        Self {
            knobs: vec![KnobState::default(); layout.knob_count],
            slots: vec![SlotState::default(); layout.slot_count],
            left: vec![f32::NAN; layout.control_count],
        }
    }

    /// Lent to a surface.
    pub fn memory(&mut self) -> SurfaceMemory<'_> {
        SurfaceMemory {
            knobs: &mut self.knobs,
            slots: &mut self.slots,
            left: &mut self.left,
        }
    }
}
