//! The map: which knob moves which controls, on which page, and how. Plain records in the caller's memory, checked once
//! against a basis; what a mapping file says, minus its syntax.

mod error;

use core::ops::Range;

use sinew_runtime::{Basis, Component};

use crate::calibrate::KnobCalibration;
use crate::filter::Smoothing;
use crate::response::Response;
use crate::takeover::Takeover;
pub use error::MapError;

/// One knob of the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knob<'m> {
    /// Its address, as in [`KnobEvent::knob`](crate::KnobEvent::knob).
    pub address: u16,
    /// Name for people; may be empty.
    pub name: &'m str,
    /// What it really sends; `None`: assumed from its scale ([`KnobCalibration::assumed`]).
    pub calibration: Option<KnobCalibration>,
    /// How it is smoothed.
    pub smoothing: Smoothing,
    /// For encoders: travel of one step, parts of the whole. Default 0.01. Range: `(0, 1]`.
    pub step: f32,
    /// For encoders: how many times further a step goes when the encoder is spun, at 100 steps a second and more. Default 1:
    /// no further. Range: `[1, 100]`.
    pub acceleration: f32,
}

impl<'m> Knob<'m> {
    /// A knob without calibration, everything at its default.
    pub fn new(address: u16, name: &'m str) -> Self {
        Self {
            address,
            name,
            calibration: None,
            smoothing: Smoothing::default(),
            step: 0.01,
            acceleration: 1.0,
        }
    }
}

/// Pages on which a binding holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum OnPage {
    /// All.
    #[default]
    Every,
    /// This one, from 0.
    Only(u16),
}

impl OnPage {
    fn includes(self, page: u16) -> bool {
        match self {
            Self::Every => true,
            Self::Only(own) => own == page,
        }
    }

    fn meets(self, other: Self) -> bool {
        match other {
            Self::Every => true,
            Self::Only(page) => self.includes(page),
        }
    }
}

/// One knob moves one control. Several bindings of one knob make a group, each control with its own scale.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Binding {
    /// Index of the knob in the map's list.
    pub knob: u16,
    /// Where it holds.
    pub page: OnPage,
    /// Index of the component.
    pub control: u16,
    /// How the control answers.
    pub response: Response,
    /// What happens when the control stands elsewhere.
    pub takeover: Takeover,
}

/// Which knobs follow the tree, and how their controls answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreePages {
    /// Index of the first knob in the map's list; the fine ones come after the coarse ones.
    pub first_knob: u16,
    /// Knobs for the coarse components. At least 1.
    pub coarse_knobs: u16,
    /// Knobs for the children of the coarse knob last turned; may be 0.
    pub fine_knobs: u16,
    /// Whether a turn brings the children; otherwise only [`Command::Focus`] does.
    pub follow_touch: bool,
    /// How every control answers.
    pub response: Response,
    /// What happens when a control stands elsewhere.
    pub takeover: Takeover,
}

impl Default for TreePages {
    /// Eight knobs: three coarse ones, five fine ones.
    fn default() -> Self {
        Self {
            first_knob: 0,
            coarse_knobs: 3,
            fine_knobs: 5,
            follow_touch: true,
            response: Response::default(),
            takeover: Takeover::default(),
        }
    }
}

impl TreePages {
    /// Coarse and fine knobs out of `knob_count`: three eighths are coarse, as on a box of eight, but never more than there
    /// are coarse components, and all of them where no component has children.
    pub fn share(basis: &Basis<'_>, knob_count: u16) -> (u16, u16) {
        let knob_count = knob_count.max(1);
        let is_coarse = |component: &Component<'_>| component.parent.is_none();
        let coarse_components = basis.components().filter(is_coarse).count();
        if coarse_components == basis.component_count() {
            return (knob_count, 0);
        }
        let share = u32::from(knob_count) * 3 / 8;
        // The format allows 4,096 components.
        let coarse = (share as u16).clamp(1, (coarse_components as u16).max(1));
        (coarse, knob_count - coarse)
    }

    /// Indices of its knobs.
    pub(crate) fn knobs(&self) -> Range<usize> {
        let first = usize::from(self.first_knob);
        first..first + self.slot_count()
    }

    pub(crate) fn slot_count(&self) -> usize {
        usize::from(self.coarse_knobs) + usize::from(self.fine_knobs)
    }
}

/// What a button, or a program, can ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Ease everything to rest and hold it there, as long as the button is down. A button that goes up releases.
    Stop,
    /// End a stop: each control stays at rest until its knob picks it up.
    Release,
    /// Next page: of the tree if there is one, of the bindings otherwise. The last is followed by the first.
    Next,
    /// Previous page.
    Previous,
    /// Tree: the children of the knob last turned take the coarse knobs.
    Into,
    /// Tree: back up.
    Out,
    /// Tree: next page of the fine knobs.
    NextFine,
    /// Tree: this component's children come onto the fine knobs.
    Focus(u16),
    /// This page of the bindings.
    Page(u16),
}

/// A button of the device: down while it reads over half of its scale. On an encoder a step to the right presses, one to the
/// left releases.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Button {
    /// Its address, as in [`KnobEvent::knob`](crate::KnobEvent::knob).
    pub address: u16,
    /// What it does.
    pub command: Command,
}

/// Most buttons of a device.
pub const BUTTONS_MAX: usize = 64;

/// A checked map. Borrows the caller's records and the basis; cheap to copy.
#[derive(Debug, Clone, Copy)]
pub struct ControlMap<'m> {
    pub(crate) basis: Basis<'m>,
    pub(crate) knobs: &'m [Knob<'m>],
    pub(crate) bindings: &'m [Binding],
    pub(crate) buttons: &'m [Button],
    pub(crate) tree: Option<TreePages>,
    page_count: u16,
}

impl<'m> ControlMap<'m> {
    /// Checks everything, once.
    ///
    /// # Errors
    /// A [`MapError`] for the first record that does not fit.
    pub fn new(
        basis: Basis<'m>,
        knobs: &'m [Knob<'m>],
        bindings: &'m [Binding],
        buttons: &'m [Button],
        tree: Option<TreePages>,
    ) -> Result<Self, MapError> {
        let index_max = usize::from(u16::MAX);
        if knobs.len() > index_max || bindings.len() > index_max || buttons.len() > BUTTONS_MAX {
            return Err(MapError::TooMany);
        }
        let page_count = bindings.iter().map(|binding| match binding.page {
            OnPage::Every => 1,
            OnPage::Only(page) => page.saturating_add(1),
        });
        let map = Self {
            basis,
            knobs,
            bindings,
            buttons,
            tree,
            page_count: page_count.max().unwrap_or(1),
        };
        map.check_knobs()?;
        map.check_bindings()?;
        map.check_buttons()?;
        map.check_tree()?;
        Ok(map)
    }

    fn check_knobs(&self) -> Result<(), MapError> {
        let addresses = || {
            let knobs = self.knobs.iter().map(|knob| knob.address);
            knobs.chain(self.buttons.iter().map(|button| button.address))
        };
        for (n, address) in addresses().enumerate() {
            if addresses().take(n).any(|earlier| earlier == address) {
                return Err(MapError::SameAddress { address });
            }
        }
        for (index, knob) in self.knobs.iter().enumerate() {
            if knob.calibration.is_some_and(|calibration| !calibration.is_valid()) {
                return Err(MapError::Calibration { knob: index });
            }
            if !knob.smoothing.is_valid() {
                return Err(MapError::Smoothing { knob: index });
            }
            if !(knob.step > 0.0 && knob.step <= 1.0) {
                return Err(MapError::Step { knob: index });
            }
            if !(1.0..=100.0).contains(&knob.acceleration) {
                return Err(MapError::Acceleration { knob: index });
            }
        }
        Ok(())
    }

    fn check_control(&self, control: u16) -> Result<(), MapError> {
        let component_count = self.basis.component_count();
        if usize::from(control) < component_count {
            Ok(())
        } else {
            Err(MapError::NoSuchControl {
                control,
                component_count,
            })
        }
    }

    fn check_bindings(&self) -> Result<(), MapError> {
        for (index, binding) in self.bindings.iter().enumerate() {
            if usize::from(binding.knob) >= self.knobs.len() {
                return Err(MapError::NoSuchKnob {
                    binding: index,
                    knob: binding.knob,
                });
            }
            self.check_control(binding.control)?;
            let component = self.basis.component(binding.control.into());
            if let Err(fault) = binding.response.resolve(component.minimum, component.maximum) {
                return Err(MapError::Response { binding: index, fault });
            }
            let meets = |earlier: &Binding| earlier.control == binding.control && earlier.page.meets(binding.page);
            if let Some(first) = self.bindings[..index].iter().position(meets) {
                return Err(MapError::TwoHands { first, second: index });
            }
        }
        Ok(())
    }

    fn check_buttons(&self) -> Result<(), MapError> {
        for button in self.buttons {
            match button.command {
                Command::Focus(control) => self.check_control(control)?,
                Command::Page(page) if page >= self.page_count => return Err(MapError::NoSuchPage { page }),
                _ => {}
            }
        }
        Ok(())
    }

    fn check_tree(&self) -> Result<(), MapError> {
        let Some(tree) = self.tree else { return Ok(()) };
        let knobs = tree.knobs();
        if tree.coarse_knobs == 0 || knobs.end > self.knobs.len() {
            return Err(MapError::TreeKnobs);
        }
        if let Some(binding) = self.bindings.iter().position(|b| knobs.contains(&usize::from(b.knob))) {
            return Err(MapError::TreeKnobBound { binding });
        }
        for (control, component) in self.basis.components().enumerate() {
            if let Err(fault) = tree.response.resolve(component.minimum, component.maximum) {
                return Err(MapError::TreeResponse { control, fault });
            }
        }
        Ok(())
    }

    /// The basis it was checked against.
    pub fn basis(&self) -> &Basis<'m> {
        &self.basis
    }

    /// Pages of the bindings, at least 1.
    pub fn page_count(&self) -> u16 {
        self.page_count
    }

    /// The knobs.
    pub fn knobs(&self) -> &'m [Knob<'m>] {
        self.knobs
    }

    /// Index of the knob at an address.
    pub fn knob_at(&self, address: u16) -> Option<usize> {
        self.knobs.iter().position(|knob| knob.address == address)
    }

    /// Knobs that move nothing on any page.
    pub fn unmapped_knobs(&self) -> impl Iterator<Item = usize> + use<'m> {
        let map = *self;
        (0..self.knobs.len()).filter(move |&knob| {
            let in_tree = map.tree.is_some_and(|tree| tree.knobs().contains(&knob));
            !in_tree && !map.bindings.iter().any(|binding| usize::from(binding.knob) == knob)
        })
    }

    /// Whether a binding, on any page, has this control; the tree leaves those out.
    pub(crate) fn is_bound(&self, control: usize) -> bool {
        self.bindings
            .iter()
            .any(|binding| usize::from(binding.control) == control)
    }

    /// Whether a binding holds on a page.
    pub(crate) fn holds(binding: &Binding, page: u16) -> bool {
        binding.page.includes(page)
    }
}

#[cfg(test)]
mod tests;
