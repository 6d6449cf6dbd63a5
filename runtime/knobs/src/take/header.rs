//! The header of a take: device, surface, map and the names of the components, so that the take can be played on the same
//! package, and by name on another.

use super::error::TakeError;
use super::record::{command, write_command};
use super::wire::Cursor;
use crate::{
    Binding, Button, Centre, ControlMap, Curve, Failsafe, Knob, KnobCalibration, OnPage, Response, Smoothing,
    SurfaceSettings, Takeover, TreePages,
};

/// Version of the format written here.
pub(super) const VERSION: u16 = 1;

/// A control of a take that the basis at hand has no component for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MissingControl<'a> {
    /// Its name in the take.
    pub name: &'a str,
}

impl core::error::Error for MissingControl<'_> {}

impl core::fmt::Display for MissingControl<'_> {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(out, "the package has no component `{}`", self.name)
    }
}

pub(super) fn check_names(device: &str, map: &ControlMap<'_>) -> Result<(), TakeError> {
    let fits = |name: &str| name.len() <= usize::from(u16::MAX);
    let knobs = map.knobs.iter().map(|knob| knob.name);
    let mut names = map.basis.components().map(|component| component.name).chain(knobs);
    if fits(device) && names.all(fits) {
        Ok(())
    } else {
        Err(TakeError::NameTooLong)
    }
}

/// Writes the payload, piece by piece.
pub(super) fn write(device: &str, map: &ControlMap<'_>, settings: &SurfaceSettings, sink: &mut impl FnMut(&[u8])) {
    sink(&VERSION.to_le_bytes());
    sink(&VERSION.to_le_bytes());
    sink(&map.basis.compact_id());
    write_text(device, sink);
    write_count(map.basis.component_count(), sink);
    for component in map.basis.components() {
        write_text(component.name, sink);
    }
    let failsafe = settings.failsafe;
    sink(&[settings.spike_guard.into()]);
    write_option(failsafe.ease_after_us.map(u64::to_le_bytes), sink);
    sink(&failsafe.ease_us.to_le_bytes());
    write_option(failsafe.silence_us.map(u64::to_le_bytes), sink);
    write_option(failsafe.frozen_us.map(u64::to_le_bytes), sink);
    sink(&failsafe.flood_per_second.to_le_bytes());
    write_count(map.knobs.len(), sink);
    for knob in map.knobs {
        write_knob(knob, sink);
    }
    write_count(map.bindings.len(), sink);
    for binding in map.bindings {
        sink(&binding.knob.to_le_bytes());
        let page = match binding.page {
            OnPage::Every => None,
            OnPage::Only(page) => Some(page.to_le_bytes()),
        };
        write_option(page, sink);
        sink(&binding.control.to_le_bytes());
        write_response(&binding.response, sink);
        sink(&[takeover_code(binding.takeover)]);
    }
    write_count(map.buttons.len(), sink);
    for button in map.buttons {
        sink(&button.address.to_le_bytes());
        write_command(button.command, sink);
    }
    sink(&[map.tree.is_some().into()]);
    if let Some(tree) = map.tree {
        for knobs in [tree.first_knob, tree.coarse_knobs, tree.fine_knobs] {
            sink(&knobs.to_le_bytes());
        }
        sink(&[tree.follow_touch.into()]);
        write_response(&tree.response, sink);
        sink(&[takeover_code(tree.takeover)]);
    }
}

fn write_text(text: &str, sink: &mut impl FnMut(&[u8])) {
    write_count(text.len(), sink);
    sink(text.as_bytes());
}

/// Counts fit: the map and `check_names` saw to it.
fn write_count(count: usize, sink: &mut impl FnMut(&[u8])) {
    sink(&(count as u16).to_le_bytes());
}

fn write_option<const N: usize>(value: Option<[u8; N]>, sink: &mut impl FnMut(&[u8])) {
    sink(&[value.is_some().into()]);
    if let Some(value) = value {
        sink(&value);
    }
}

fn write_knob(knob: &Knob<'_>, sink: &mut impl FnMut(&[u8])) {
    sink(&knob.address.to_le_bytes());
    write_text(knob.name, sink);
    sink(&[knob.calibration.is_some().into()]);
    if let Some(calibration) = knob.calibration {
        for number in [calibration.full_scale, calibration.lowest, calibration.highest] {
            sink(&number.to_le_bytes());
        }
        write_option(calibration.centre.map(u16::to_le_bytes), sink);
        sink(&calibration.noise.to_le_bytes());
    }
    let smoothing = knob.smoothing;
    for number in [
        smoothing.minimum_cutoff_hz,
        smoothing.speed_gain,
        smoothing.speed_cutoff_hz,
        knob.step,
        knob.acceleration,
    ] {
        sink(&number.to_le_bytes());
    }
}

fn write_response(response: &Response, sink: &mut impl FnMut(&[u8])) {
    write_option(response.minimum.map(f32::to_le_bytes), sink);
    write_option(response.maximum.map(f32::to_le_bytes), sink);
    sink(&[response.inverted.into()]);
    let detent = match response.centre {
        Centre::Even => None,
        Centre::Rest { detent } => Some(detent.to_le_bytes()),
    };
    write_option(detent, sink);
    let (code, number) = match response.curve {
        Curve::Linear => (0, 0.0),
        Curve::Exponential { ratio } => (1, ratio),
        Curve::Logarithmic { ratio } => (2, ratio),
        Curve::SCurve { steepness } => (3, steepness),
    };
    sink(&[code]);
    sink(&f32::to_le_bytes(number));
    write_option(response.slew.map(f32::to_le_bytes), sink);
}

fn takeover_code(takeover: Takeover) -> u8 {
    match takeover {
        Takeover::Jump => 0,
        Takeover::Pickup => 1,
        Takeover::Scale => 2,
        Takeover::Relative => 3,
    }
}

fn takeover(cursor: &mut Cursor<'_>) -> Option<Takeover> {
    Some(match cursor.u8()? {
        0 => Takeover::Jump,
        1 => Takeover::Pickup,
        2 => Takeover::Scale,
        3 => Takeover::Relative,
        _ => return None,
    })
}

fn response(cursor: &mut Cursor<'_>) -> Option<Response> {
    Some(Response {
        minimum: cursor.option(Cursor::f32)?,
        maximum: cursor.option(Cursor::f32)?,
        inverted: cursor.flag()?,
        centre: match cursor.option(Cursor::f32)? {
            None => Centre::Even,
            Some(detent) => Centre::Rest { detent },
        },
        curve: match (cursor.u8()?, cursor.f32()?) {
            (0, _) => Curve::Linear,
            (1, ratio) => Curve::Exponential { ratio },
            (2, ratio) => Curve::Logarithmic { ratio },
            (3, steepness) => Curve::SCurve { steepness },
            _ => return None,
        },
        slew: cursor.option(Cursor::f32)?,
    })
}

fn calibration(cursor: &mut Cursor<'_>) -> Option<KnobCalibration> {
    Some(KnobCalibration {
        full_scale: cursor.u16()?,
        lowest: cursor.u16()?,
        highest: cursor.u16()?,
        centre: cursor.option(Cursor::u16)?,
        noise: cursor.u16()?,
    })
}

pub(super) fn knob<'a>(cursor: &mut Cursor<'a>) -> Option<Knob<'a>> {
    Some(Knob {
        address: cursor.u16()?,
        name: cursor.text()?,
        calibration: cursor.option(calibration)?,
        smoothing: Smoothing {
            minimum_cutoff_hz: cursor.f32()?,
            speed_gain: cursor.f32()?,
            speed_cutoff_hz: cursor.f32()?,
        },
        step: cursor.f32()?,
        acceleration: cursor.f32()?,
    })
}

pub(super) fn binding(cursor: &mut Cursor<'_>) -> Option<Binding> {
    Some(Binding {
        knob: cursor.u16()?,
        page: cursor.option(Cursor::u16)?.map_or(OnPage::Every, OnPage::Only),
        control: cursor.u16()?,
        response: response(cursor)?,
        takeover: takeover(cursor)?,
    })
}

pub(super) fn button(cursor: &mut Cursor<'_>) -> Option<Button> {
    Some(Button {
        address: cursor.u16()?,
        command: command(cursor.u8()?, cursor.u16()?)?,
    })
}

fn tree(cursor: &mut Cursor<'_>) -> Option<TreePages> {
    Some(TreePages {
        first_knob: cursor.u16()?,
        coarse_knobs: cursor.u16()?,
        fine_knobs: cursor.u16()?,
        follow_touch: cursor.flag()?,
        response: response(cursor)?,
        takeover: takeover(cursor)?,
    })
}

/// A header whose every part was read once; lists are read again when asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Header<'a> {
    pub(super) compact_id: [u8; 16],
    pub(super) device: &'a str,
    pub(super) settings: SurfaceSettings,
    pub(super) tree: Option<TreePages>,
    pub(super) names: List<'a>,
    pub(super) knobs: List<'a>,
    pub(super) bindings: List<'a>,
    pub(super) buttons: List<'a>,
}

/// Entries of one kind, one after the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct List<'a> {
    pub(super) count: u16,
    cursor: Cursor<'a>,
}

impl<'a> List<'a> {
    /// Steps over a list in which every entry can be read.
    fn read<T>(cursor: &mut Cursor<'a>, entry: fn(&mut Cursor<'a>) -> Option<T>) -> Option<Self> {
        let count = cursor.u16()?;
        let list = Self { count, cursor: *cursor };
        for _ in 0..count {
            entry(cursor)?;
        }
        Some(list)
    }

    pub(super) fn entries<T>(self, entry: fn(&mut Cursor<'a>) -> Option<T>) -> impl Iterator<Item = T> + use<'a, T> {
        let mut cursor = self.cursor;
        (0..self.count).map_while(move |_| entry(&mut cursor))
    }
}

impl<'a> Header<'a> {
    /// Reads the payload after its versions. The error is how many bytes were left.
    pub(super) fn read(payload: &'a [u8]) -> Result<Self, usize> {
        let mut cursor = Cursor::new(payload);
        let header = Self::read_from(&mut cursor);
        header.filter(|_| cursor.bytes.is_empty()).ok_or(cursor.bytes.len())
    }

    fn read_from(cursor: &mut Cursor<'a>) -> Option<Self> {
        let compact_id = cursor.array()?;
        let device = cursor.text()?;
        let names = List::read(cursor, Cursor::text)?;
        let spike_guard = cursor.flag()?;
        let failsafe = Failsafe {
            ease_after_us: cursor.option(Cursor::u64)?,
            ease_us: cursor.u64()?,
            silence_us: cursor.option(Cursor::u64)?,
            frozen_us: cursor.option(Cursor::u64)?,
            flood_per_second: cursor.u32()?,
        };
        Some(Self {
            compact_id,
            device,
            settings: SurfaceSettings { failsafe, spike_guard },
            names,
            knobs: List::read(cursor, knob)?,
            bindings: List::read(cursor, binding)?,
            buttons: List::read(cursor, button)?,
            tree: cursor.option(tree)?,
        })
    }
}
