//! From a mapping file and the knobs found to the records of a [`ControlMap`]: names become components, places become
//! addresses, and what a file leaves open follows the component tree.

mod resolve;
mod split;

use sinew_runtime::Basis;
use sinew_runtime::input::{
    Binding, Button, ControlMap, Knob, KnobCalibration, MapError, Smoothing, SurfaceSettings, TreePages,
};

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

/// Routes at work: looks each address up once.
#[derive(Debug)]
pub struct Router {
    routes: Routes,
    taken: usize,
    /// Indexed by the device's address.
    table: Vec<u16>,
    /// Addresses without a place in the map, which a name that comes later may give one.
    unplaced: Vec<u16>,
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
            unplaced: Vec::with_capacity(64),
        }
    }

    /// Address in the map; `name_of` asks the device what it calls a knob, once for each knob.
    pub fn route(&mut self, address: u16, name_of: impl FnOnce(u16) -> Option<String>) -> u16 {
        let known = self.table[usize::from(address)];
        if known != UNSEEN {
            return known;
        }
        let routed = self.place(address, name_of(address).as_deref());
        self.table[usize::from(address)] = routed;
        if routed == address && !self.routes.same.contains(&address) && self.unplaced.len() < self.unplaced.capacity() {
            self.unplaced.push(address);
        }
        routed
    }

    fn place(&mut self, address: u16, name: Option<&str>) -> u16 {
        let named = self.routes.named.iter().find(|(known, _)| Some(known.as_str()) == name);
        if let Some((_, own)) = named {
            return *own;
        }
        if self.routes.same.contains(&address) {
            return address;
        }
        match self.routes.free.get(self.taken) {
            Some(free) => {
                self.taken += 1;
                *free
            }
            None => address,
        }
    }

    /// Looks again at addresses without a place: names may have come since. About once a second.
    pub fn refresh(&mut self, name_of: impl Fn(u16) -> Option<String>) {
        let (routes, table) = (&self.routes, &mut self.table);
        self.unplaced.retain(|&address| {
            let name = name_of(address);
            let named = routes.named.iter().find(|(known, _)| Some(known) == name.as_ref());
            if let Some((_, own)) = named {
                table[usize::from(address)] = *own;
            }
            named.is_none()
        });
    }
}

#[cfg(test)]
mod tests;
