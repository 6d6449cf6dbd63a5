//! From a mapping file and the knobs found to the records of a [`ControlMap`]: names become components, places become
//! addresses, and what a file leaves open follows the component tree.

mod resolve;
mod split;

use sinew_knobs::{
    Binding, Button, ControlMap, Knob, KnobCalibration, KnobEvent, MapError, Reading, Smoothing, SurfaceSettings,
    TreePages,
};
use sinew_runtime::Basis;

use crate::config::Place;
pub use resolve::{resolve, unknown_component};
pub use split::split;

/// A knob heard while the program started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HeardKnob {
    /// Its address on the device.
    pub address: u16,
    /// What the device calls it.
    pub name: Option<String>,
}

/// A knob of the map, with its own name.
#[derive(Debug, Clone, PartialEq)]
pub struct WiredKnob {
    /// Address in the map.
    pub address: u16,
    /// Name for people; may be empty.
    pub name: String,
    /// What it really sends.
    pub calibration: Option<KnobCalibration>,
    /// How it is smoothed.
    pub smoothing: Smoothing,
    /// Travel of an encoder's step.
    pub step: f32,
    /// How many times further a step goes when the encoder is spun.
    pub acceleration: f32,
}

/// Everything that a map borrows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Wiring {
    /// The knobs; those of the tree first.
    pub knobs: Vec<WiredKnob>,
    /// What they move.
    pub bindings: Vec<Binding>,
    /// The buttons.
    pub buttons: Vec<Button>,
    /// The tree's knobs.
    pub tree: Option<TreePages>,
    /// How the surface behaves.
    pub settings: SurfaceSettings,
    /// How the device's addresses become the map's.
    pub routes: Routes,
}

impl Wiring {
    /// The knobs as a map wants them.
    pub fn borrowed_knobs(&self) -> Vec<Knob<'_>> {
        let knobs = self.knobs.iter().map(|knob| Knob {
            address: knob.address,
            name: &knob.name,
            calibration: knob.calibration,
            smoothing: knob.smoothing,
            step: knob.step,
            acceleration: knob.acceleration,
        });
        knobs.collect()
    }

    /// The map.
    ///
    /// # Errors
    /// None for a wiring that [`resolve`] made; a take's may not fit.
    pub fn map<'m>(&'m self, basis: Basis<'m>, knobs: &'m [Knob<'m>]) -> Result<ControlMap<'m>, MapError> {
        ControlMap::new(basis, knobs, &self.bindings, &self.buttons, self.tree)
    }
}

/// Addresses of the device that have another one in the map.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Routes {
    /// Addresses that are the same in both.
    pub same: Vec<u16>,
    /// Knobs known by name, and their addresses in the map.
    pub named: Vec<(String, u16)>,
    /// Addresses in the map for knobs that come without being expected, in order.
    pub free: Vec<u16>,
}

impl Routes {
    /// Address in the map for a place; each place has one.
    fn address_of(&mut self, place: &Place) -> u16 {
        match place {
            Place::Number(address) => {
                if !self.same.contains(address) {
                    self.same.push(*address);
                }
                *address
            }
            Place::Name(name) => {
                if let Some((_, address)) = self.named.iter().find(|(known, _)| known == name) {
                    return *address;
                }
                let address = Place::OWN_ADDRESSES + self.named.len() as u16;
                self.named.push((name.clone(), address));
                address
            }
        }
    }

    /// One more address for whichever knob comes next.
    fn free_address(&mut self) -> u16 {
        let address = Place::OWN_ADDRESSES + 2000 + self.free.len() as u16;
        self.free.push(address);
        address
    }
}

/// Routes at work: one look at a table an event.
#[derive(Debug)]
pub struct Router {
    routes: Routes,
    taken: usize,
    /// Indexed by the device's address.
    table: Vec<u16>,
}

/// Not looked up yet. A device's address that the map lacks stays what it is.
const UNSEEN: u16 = u16::MAX;

impl Router {
    /// Nothing looked up yet.
    pub fn new(routes: Routes) -> Self {
        Self {
            routes,
            taken: 0,
            table: vec![UNSEEN; usize::from(u16::MAX) + 1],
        }
    }

    /// The device calls a knob so: the map may know it by that name, however it was taken before.
    pub fn name(&mut self, address: u16, name: &str) {
        let named = self.routes.named.iter().find(|(known, _)| known == name);
        if let Some((_, own)) = named {
            self.table[usize::from(address)] = *own;
        }
    }

    /// Address in the map. A knob that comes without being expected takes a place of its own once it has been turned: what only
    /// goes from one end to the other is a button, or half of a pair.
    pub fn route(&mut self, event: KnobEvent) -> u16 {
        let address = event.knob;
        let known = self.table[usize::from(address)];
        if known != UNSEEN {
            return known;
        }
        let is_turned = match event.reading {
            Reading::Position { value, full_scale } => value > 0 && value < full_scale,
            Reading::Steps(_) => true,
        };
        let routed = match self.routes.free.get(self.taken) {
            _ if self.routes.same.contains(&address) => address,
            Some(_) if !is_turned => return address,
            Some(&free) => {
                self.taken += 1;
                free
            }
            None => address,
        };
        self.table[usize::from(address)] = routed;
        routed
    }
}

#[cfg(test)]
mod tests;
