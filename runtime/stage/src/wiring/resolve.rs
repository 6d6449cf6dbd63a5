//! The rules of a mapping file that need the package: names of components, ranges, two hands on one control.

use core::ops::Range;

use sinew_knobs::{Binding, Button, Command, OnPage, Response, SurfaceSettings, TreePages};
use sinew_runtime::Basis;

use super::{HeardKnob, WiredKnob, Wiring, split};
use crate::calibration::DeviceCalibration;
use crate::config::keys::{Fault, Found, nearest};
use crate::config::{ButtonCommand, ConfigError, ControlEntry, Feel, KnobEntry, KnobsFile, Place};

/// Knobs of a box that nobody has heard of yet.
const KNOBS_EXPECTED: usize = 8;

/// What the records are made from.
struct Resolver<'a> {
    file: &'a KnobsFile,
    basis: &'a Basis<'a>,
    heard: &'a [HeardKnob],
    calibration: Option<&'a DeviceCalibration>,
    wiring: Wiring,
    /// The place of each knob of the wiring; `None` for those that take whichever comes.
    places: Vec<Option<Place>>,
}

/// Makes the records of a map. Without a tree and without controls in the file, the knobs found follow the component tree.
///
/// # Errors
/// The first rule that the file breaks, with its place.
pub fn resolve(
    file: &KnobsFile,
    basis: &Basis<'_>,
    heard: &[HeardKnob],
    calibration: Option<&DeviceCalibration>,
) -> Result<Wiring, ConfigError> {
    let mut resolver = Resolver {
        file,
        basis,
        heard,
        calibration,
        wiring: Wiring::default(),
        places: Vec::new(),
    };
    match resolver.run() {
        Ok(()) => Ok(resolver.wiring),
        Err(fault) => Err(file.error(fault)),
    }
}

impl Resolver<'_> {
    fn run(&mut self) -> Result<(), Fault> {
        self.wiring.settings = SurfaceSettings {
            failsafe: self.file.failsafe,
            spike_guard: self.file.device.guards_against_spikes(),
        };
        self.check_places()?;
        let has_controls = self.file.knobs.iter().any(|knob| !knob.controls.is_empty());
        if self.file.tree.is_some() || !has_controls {
            self.tree()?;
        }
        for knob in &self.file.knobs {
            self.knob(knob)?;
        }
        self.buttons()
    }

    /// No place is listed twice.
    fn check_places(&self) -> Result<(), Fault> {
        let knobs = self.file.knobs.iter().map(|knob| &knob.place);
        let buttons = self.file.buttons.iter().map(|button| &button.place);
        let mut seen: Vec<&Place> = Vec::new();
        for place in knobs.chain(buttons) {
            if seen.contains(&&place.value) {
                return Err(
                    Fault::new(place.span.clone(), format!("knob {} is listed already", place.value))
                        .help("a knob that moves several components has one [[knob]] with a [[knob.control]] for each"),
                );
            }
            seen.push(&place.value);
        }
        Ok(())
    }

    fn tree(&mut self) -> Result<(), Fault> {
        let entry = self.file.tree.as_ref();
        let (coarse, fine) = entry.map_or((None, None), |tree| (tree.coarse, tree.fine));
        let listed: &[Found<Place>] = entry.map_or(&[], |tree| &tree.knobs);
        let own: Vec<&KnobEntry> = self
            .file
            .knobs
            .iter()
            .filter(|knob| !knob.controls.is_empty())
            .collect();
        let mut places: Vec<Option<Place>> = Vec::new();
        for place in listed {
            if own.iter().any(|knob| knob.place.value == place.value) {
                return Err(Fault::new(
                    place.span.clone(),
                    format!("knob {} has a component of its own", place.value),
                )
                .help("leave it out of the tree, or take its component away"));
            }
            if places.contains(&Some(place.value.clone())) {
                return Err(Fault::new(
                    place.span.clone(),
                    format!("knob {} is in the tree already", place.value),
                ));
            }
            places.push(Some(place.value.clone()));
        }
        if listed.is_empty() {
            places = self.found_places();
            let wanted = match (coarse, fine) {
                (Some(coarse), Some(fine)) => usize::from(coarse) + usize::from(fine),
                _ if places.is_empty() => KNOBS_EXPECTED,
                _ => places.len(),
            };
            places.resize(wanted, None);
        }
        let count = places.len().min(usize::from(u16::MAX)) as u16;
        let (coarse_knobs, fine_knobs) = split(self.basis, count, coarse, fine);
        if let Some(tree) = entry
            && usize::from(coarse_knobs) + usize::from(fine_knobs) != places.len()
        {
            let message = format!(
                "{} knobs are listed, and coarse + fine make {}",
                places.len(),
                u32::from(coarse_knobs) + u32::from(fine_knobs)
            );
            return Err(Fault::new(tree.span.clone(), message));
        }
        let feel = entry.map_or(Feel::default(), |tree| tree.feel).over(self.file.defaults);
        for place in places {
            self.add_knob(place);
        }
        self.wiring.tree = Some(TreePages {
            first_knob: 0,
            coarse_knobs,
            fine_knobs,
            follow_touch: entry.is_none_or(|tree| tree.follow_touch),
            response: response(feel),
            takeover: feel.takeover.unwrap_or_default(),
        });
        Ok(())
    }

    /// Knobs that a tree without a list takes: those listed without controls, heard, or calibrated.
    fn found_places(&self) -> Vec<Option<Place>> {
        let taken = |place: &Place| {
            let knobs = self.file.knobs.iter().filter(|knob| !knob.controls.is_empty());
            let mut own = knobs.map(|knob| &knob.place.value);
            own.any(|own| own == place) || self.file.buttons.iter().any(|button| button.place.value == *place)
        };
        let mut places: Vec<Place> = Vec::new();
        let mut add = |place: Place| {
            if !taken(&place) && !places.contains(&place) {
                places.push(place);
            }
        };
        for knob in self.file.knobs.iter().filter(|knob| knob.controls.is_empty()) {
            add(knob.place.value.clone());
        }
        let is_listed_name = |name: &str| {
            let named = |place: &Place| *place == Place::Name(name.to_owned());
            self.file.knobs.iter().any(|knob| named(&knob.place.value))
                || self.file.buttons.iter().any(|button| named(&button.place.value))
        };
        let unlisted = |name: Option<&str>| !name.is_some_and(is_listed_name);
        for knob in self.heard.iter().filter(|knob| unlisted(knob.name.as_deref())) {
            add(Place::Number(knob.address));
        }
        for knob in self.calibration.iter().flat_map(|device| &device.knobs) {
            if unlisted(Some(&knob.name)) && knob.address < Place::OWN_ADDRESSES {
                add(Place::Number(knob.address));
            }
        }
        places.into_iter().map(Some).collect()
    }

    /// Appends a knob; returns its index.
    fn add_knob(&mut self, place: Option<Place>) -> u16 {
        let entry = place
            .as_ref()
            .and_then(|place| self.file.knobs.iter().find(|knob| knob.place.value == *place));
        let (number, name) = match &place {
            Some(Place::Number(address)) => {
                let heard = self.heard.iter().find(|knob| knob.address == *address);
                (Some(*address), heard.and_then(|knob| knob.name.as_deref()))
            }
            Some(Place::Name(name)) => (None, Some(name.as_str())),
            None => (None, None),
        };
        let shown = entry
            .map(|entry| entry.name.as_str())
            .filter(|name| !name.is_empty())
            .or(name);
        let knob = WiredKnob {
            address: match &place {
                Some(place) => self.wiring.routes.address_of(place),
                None => self.wiring.routes.free_address(),
            },
            name: shown.unwrap_or("").to_owned(),
            calibration: self.calibration.and_then(|device| device.of(number, name)),
            smoothing: entry.and_then(|entry| entry.smoothing).unwrap_or(self.file.smoothing),
            step: entry.and_then(|entry| entry.step).unwrap_or(0.01),
            acceleration: entry.and_then(|entry| entry.acceleration).unwrap_or(1.0),
        };
        self.wiring.knobs.push(knob);
        self.places.push(place);
        (self.wiring.knobs.len() - 1) as u16
    }

    fn knob(&mut self, entry: &KnobEntry) -> Result<(), Fault> {
        if self.places.contains(&Some(entry.place.value.clone())) {
            return Ok(()); // a knob of the tree: its entry was looked at there
        }
        if entry.controls.is_empty() {
            return Err(Fault::new(
                entry.place.span.clone(),
                format!("knob {} moves nothing", entry.place.value),
            )
            .help("add component = \"...\" or list it in [tree]"));
        }
        let knob = self.add_knob(Some(entry.place.value.clone()));
        for control in &entry.controls {
            let binding = self.binding(knob, control)?;
            let on = |page: OnPage, other: OnPage| page == OnPage::Every || other == OnPage::Every || page == other;
            let meets = |earlier: &&Binding| earlier.control == binding.control && on(earlier.page, binding.page);
            if let Some(first) = self.wiring.bindings.iter().find(meets) {
                let other = self.places[usize::from(first.knob)]
                    .as_ref()
                    .map_or(String::new(), Place::to_string);
                let message = format!("`{}` is moved by knob {other} already", control.component.value);
                return Err(Fault::new(control.span.clone(), message).help("put one of the two on another `page`"));
            }
            self.wiring.bindings.push(binding);
        }
        Ok(())
    }

    fn binding(&self, knob: u16, entry: &ControlEntry) -> Result<Binding, Fault> {
        let control = self.component(&entry.component)?;
        let component = self.basis.component(control.into());
        let feel = entry.feel.over(self.file.defaults);
        let mut response = response(feel);
        (response.minimum, response.maximum) = (entry.minimum, entry.maximum);
        if let Some(scale) = entry.scale {
            response.minimum = Some(component.minimum * scale.abs());
            response.maximum = Some(component.maximum * scale.abs());
            response.inverted ^= scale < 0.0;
        }
        if let Err(fault) = response.resolve(component.minimum, component.maximum) {
            return Err(Fault::new(entry.span.clone(), fault.to_string()).help(format!(
                "`{}` goes from {} to {}",
                component.name, component.minimum, component.maximum
            )));
        }
        Ok(Binding {
            knob,
            page: entry.page.map_or(OnPage::Every, |page| OnPage::Only(page - 1)),
            control,
            response,
            takeover: feel.takeover.unwrap_or_default(),
        })
    }

    fn component(&self, name: &Found<String>) -> Result<u16, Fault> {
        match self.basis.component_named(&name.value) {
            // The format of packages allows 4,096 components.
            Some(k) => Ok(k as u16),
            None => {
                let (message, help) = unknown_component(self.basis, &name.value);
                Err(Fault::new(name.span.clone(), message).help(help))
            }
        }
    }

    fn buttons(&mut self) -> Result<(), Fault> {
        let pages = self.wiring.bindings.iter().map(|binding| match binding.page {
            OnPage::Every => 1,
            OnPage::Only(page) => page + 1,
        });
        let page_count = pages.max().unwrap_or(1);
        let (file, mut buttons) = (self.file, Vec::new());
        for entry in &file.buttons {
            if self.places.contains(&Some(entry.place.value.clone())) {
                return Err(Fault::new(
                    entry.place.span.clone(),
                    format!("{} is a knob of the tree", entry.place.value),
                ));
            }
            let command = match &entry.command {
                ButtonCommand::Plain(command) => *command,
                ButtonCommand::Focus(component) => Command::Focus(self.component(component)?),
                ButtonCommand::Page(page) if page.value > page_count => {
                    return Err(one_page_too_many(&page.span, page.value, page_count));
                }
                ButtonCommand::Page(page) => Command::Page(page.value - 1),
            };
            let address = self.wiring.routes.address_of(&entry.place.value);
            buttons.push(Button { address, command });
        }
        if let Some(entry) = file.buttons.get(sinew_knobs::BUTTONS_MAX) {
            return Err(Fault::new(entry.place.span.clone(), "a device has at most 64 buttons"));
        }
        self.wiring.buttons = buttons;
        Ok(())
    }
}

fn one_page_too_many(span: &Range<usize>, page: u16, page_count: u16) -> Fault {
    Fault::new(
        span.clone(),
        format!("there is no page {page}: knobs use pages up to {page_count}"),
    )
}

/// What to say of a component that the package lacks: the fault, and what was meant.
pub fn unknown_component(basis: &Basis<'_>, name: &str) -> (String, String) {
    let names: Vec<&str> = basis.components().map(|component| component.name).collect();
    let help = match nearest(name, names.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? `sinew inspect` lists all of them"),
        None => {
            let first: Vec<&str> = names.iter().copied().take(8).collect();
            let more = if names.len() > first.len() { ", ..." } else { "" };
            format!("its components are {}{more}", first.join(", "))
        }
    };
    (format!("the package has no component `{name}`"), help)
}

fn response(feel: Feel) -> Response {
    Response {
        minimum: None,
        maximum: None,
        inverted: feel.inverted.unwrap_or(false),
        centre: feel.centre.unwrap_or_default(),
        curve: feel.curve.unwrap_or_default(),
        slew: feel.slew,
    }
}
