//! What a surface is made from: structs of the caller's, checked, become the runtime's map. Before anything is written the
//! whole map has been built once on the stack, so what does not fit is refused with nothing changed.

use sinew_knobs::{
    Binding, Centre, ControlMap, Curve, Failsafe, Knob, KnobCalibration, MapError, OnPage, Response, SurfaceSettings,
    Takeover, TreePages,
};
use sinew_runtime::Basis;

use crate::basis::SINEW_NONE;
use crate::fault::Fault;
use crate::memory::Regions;
use crate::number;
use crate::structs::{Elements, GrowingElement, GrowingStruct, choice};

/// Knobs of a surface, at most.
pub const SINEW_KNOBS_MAX: usize = 128;
/// Bindings of a surface, at most.
pub const SINEW_BINDINGS_MAX: usize = 512;

/// What a knob does with a control that stands elsewhere.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewTakeover {
    /// The control waits until the knob passes its place, however fast.
    Pickup = 0,
    /// The control goes to the knob at the knob's first move.
    Jump = 1,
    /// The control follows in proportion, so that both meet at an end.
    Scale = 2,
    /// The control moves as much as the knob.
    Relative = 3,
}

const TAKEOVERS: [Takeover; 4] = [Takeover::Pickup, Takeover::Jump, Takeover::Scale, Takeover::Relative];

/// Shape of the way from one end to the other. `curve_number` is the slope at the steep end over that at the flat one, above
/// 1, at most 1000; of an S curve the slope in the middle, 1 to 8.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewCurve {
    /// Equal turns, equal moves.
    Linear = 0,
    /// Fine at the start, coarse at the end.
    Exponential = 1,
    /// Coarse at the start, fine at the end.
    Logarithmic = 2,
    /// Fine at both ends.
    S = 3,
}

/// Where rest stands on a knob.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewCentre {
    /// In the middle, with a detent of 3 % of the travel; where the control moves one way only, as `EVEN`.
    Usual = 0,
    /// The range is spread evenly; rest stands where it falls.
    Even = 1,
    /// In the middle, with a detent of `detent`.
    Rest = 2,
}

/// One knob of the device. Zero everywhere but in the address is a knob that nobody calibrated.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewKnob {
    /// Its address, as in `SinewReading`.
    pub address: u32,
    /// The largest value that the device can send; 0: not calibrated, and the next four members are not looked at.
    pub full_scale: u32,
    /// Reading at the lower stop, in steps of `full_scale` as those below.
    pub lowest: u32,
    /// Reading at the upper stop.
    pub highest: u32,
    /// Reading where it comes to rest by itself; 0: nowhere.
    pub centre: u32,
    /// Largest deviation of a resting knob from its mean.
    pub noise: u32,
    /// For encoders: travel of one step, parts of the whole, at most 1; 0: one hundredth.
    pub step: f32,
}

// SAFETY: `repr(C)`, numbers only.
unsafe impl GrowingElement for SinewKnob {
    const NAME: &'static str = "settings.knobs";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// One knob moves one control. Several bindings of one knob make a group.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewBinding {
    /// Index of the knob on the surface.
    pub knob: u32,
    /// The control.
    pub control: u32,
    /// Page on which it holds, from 0; `SINEW_NONE`: on all.
    pub page: u32,
    /// What happens when the control stands elsewhere.
    pub takeover: number::SinewTakeover,
    /// 0, or 1: clockwise lowers.
    pub inverted: u32,
    /// Shape of the way.
    pub curve: number::SinewCurve,
    /// Of the curve; not looked at where it is linear.
    pub curve_number: f32,
    /// Where rest stands.
    pub centre: number::SinewCentre,
    /// Share of the travel, at most 0.5; looked at for `SINEW_CENTRE_REST` alone.
    pub detent: f32,
    /// Weight at the lower end; with `maximum`, 0 and 0: the control's own stops. Never wider than those.
    pub minimum: f32,
    /// Weight at the upper end.
    pub maximum: f32,
    /// Fastest change, weight a second; 0: as fast as the hand.
    pub slew: f32,
}

// SAFETY: `repr(C)`, numbers only.
unsafe impl GrowingElement for SinewBinding {
    const NAME: &'static str = "settings.bindings";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// Which knobs there are, what they move, and what happens when the device does not behave. With `knob_count` alone the knobs
/// follow the tree of components.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewSurfaceSettings {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// Knobs of the device, 1 to `SINEW_KNOBS_MAX`.
    pub knob_count: usize,
    /// The knobs, `knob_count` of them; NULL: not calibrated, and addresses from 0 on.
    pub knobs: *const SinewKnob,
    /// `sizeof(SinewKnob)`; 0 where `knobs` is NULL.
    pub knob_bytes: usize,
    /// What the knobs move; NULL where `binding_count` is 0.
    pub bindings: *const SinewBinding,
    /// At most `SINEW_BINDINGS_MAX`.
    pub binding_count: usize,
    /// `sizeof(SinewBinding)`; 0 where there are none.
    pub binding_bytes: usize,
    /// Index of the first knob that follows the tree; the others are for bindings.
    pub tree_first: u32,
    /// Knobs for coarse components. With `tree_fine`, 0 and 0: without bindings three eighths of the knobs are coarse and
    /// the rest fine; with bindings no knob follows the tree.
    pub tree_coarse: u32,
    /// Knobs behind those for the children of the coarse knob last turned.
    pub tree_fine: u32,
    /// Of the knobs that follow the tree.
    pub tree_takeover: number::SinewTakeover,
    /// 0: a turn of a coarse knob brings its children; 1: only `SINEW_COMMAND_FOCUS` does.
    pub tree_stays: u32,
    /// Whether a reading far from the last waits until a second confirms it, 0 or 1: for text lines, which have no checksum.
    pub spike_guard: u32,
    /// How long the pose of a device that is gone is held before it eases to rest, microseconds; 0: 5 seconds,
    /// `UINT64_MAX`: for ever.
    pub hold_us: u64,
    /// How long the way to rest takes, microseconds; 0: 2 seconds.
    pub ease_us: u64,
    /// A device that sends all the time and is silent for this long counts as gone, microseconds; 0: never.
    pub silence_us: u64,
}

// SAFETY: `repr(C)`, the size first, raw pointers and integers only.
unsafe impl GrowingStruct for SinewSurfaceSettings {
    const NAME: &'static str = "settings";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// The records of a map, on the stack while they are checked.
pub(crate) struct Records {
    knobs: [Knob<'static>; SINEW_KNOBS_MAX],
    knob_count: usize,
    bindings: [Binding; SINEW_BINDINGS_MAX],
    binding_count: usize,
    pub(crate) tree: Option<TreePages>,
    pub(crate) settings: SurfaceSettings,
}

impl Records {
    /// Reads and converts the caller's structs.
    ///
    /// # Safety
    /// The arrays of `settings` are null or as long as it says.
    pub(crate) unsafe fn read(
        settings: &SinewSurfaceSettings,
        basis: &Basis<'static>,
        regions: &mut Regions,
    ) -> Result<Self, Fault> {
        let (knob_count, binding_count) = (settings.knob_count, settings.binding_count);
        for (name, actual, limit) in [
            ("settings.knob_count", knob_count, SINEW_KNOBS_MAX),
            ("settings.binding_count", binding_count, SINEW_BINDINGS_MAX),
        ] {
            if actual > limit {
                return Err(Fault::TooMany { name, limit, actual });
            }
        }
        let named = if settings.knobs.is_null() { 0 } else { knob_count };
        // SAFETY: the caller's promise, both.
        let (knobs, bindings) = unsafe {
            (
                Elements::new(settings.knobs, named, settings.knob_bytes, regions)?,
                Elements::new(settings.bindings, binding_count, settings.binding_bytes, regions)?,
            )
        };
        let mut records = Self {
            knobs: core::array::from_fn(|n| Knob::new(n as u16, "")),
            knob_count,
            bindings: [Binding::default(); SINEW_BINDINGS_MAX],
            binding_count,
            tree: settings.tree(basis)?,
            settings: settings.surface(),
        };
        for index in 0..knobs.count() {
            if let Some(knob) = knobs.get(index) {
                records.knobs[index] = knob?.resolve(index)?;
            }
        }
        for index in 0..bindings.count() {
            if let Some(binding) = bindings.get(index) {
                records.bindings[index] = binding?.resolve(basis.component_count())?;
            }
        }
        Ok(records)
    }

    pub(crate) fn knobs(&self) -> &[Knob<'static>] {
        &self.knobs[..self.knob_count]
    }

    pub(crate) fn bindings(&self) -> &[Binding] {
        &self.bindings[..self.binding_count]
    }

    /// The map of these records, checked.
    pub(crate) fn map<'m>(&'m self, basis: &Basis<'m>) -> Result<ControlMap<'m>, Fault> {
        Ok(ControlMap::new(*basis, self.knobs(), self.bindings(), &[], self.tree)?)
    }
}

impl SinewSurfaceSettings {
    fn tree(&self, basis: &Basis<'static>) -> Result<Option<TreePages>, Fault> {
        let takeover = choice("settings.tree_takeover", self.tree_takeover, &TAKEOVERS)?;
        let usual = self.tree_coarse == 0 && self.tree_fine == 0;
        if usual && self.binding_count > 0 {
            return Ok(None);
        }
        let narrow = |count: u32| u16::try_from(count).map_err(|_| Fault::Map(MapError::TreeKnobs));
        let first_knob = narrow(self.tree_first)?;
        let (coarse_knobs, fine_knobs) = if usual {
            let left = self.knob_count.saturating_sub(first_knob.into());
            TreePages::share(basis, left as u16)
        } else {
            (narrow(self.tree_coarse)?, narrow(self.tree_fine)?)
        };
        Ok(Some(TreePages {
            first_knob,
            coarse_knobs,
            fine_knobs,
            follow_touch: self.tree_stays == 0,
            takeover,
            ..TreePages::default()
        }))
    }

    fn surface(&self) -> SurfaceSettings {
        let usual = Failsafe::default();
        let failsafe = Failsafe {
            ease_after_us: match self.hold_us {
                0 => usual.ease_after_us,
                u64::MAX => None,
                hold_us => Some(hold_us),
            },
            ease_us: if self.ease_us == 0 { usual.ease_us } else { self.ease_us },
            silence_us: Some(self.silence_us).filter(|&silence_us| silence_us > 0),
            ..usual
        };
        SurfaceSettings {
            failsafe,
            spike_guard: self.spike_guard != 0,
        }
    }
}

impl SinewKnob {
    fn resolve(&self, index: usize) -> Result<Knob<'static>, Fault> {
        let narrow = |number: u32| u16::try_from(number).map_err(|_| Fault::Map(MapError::Calibration { knob: index }));
        let bad = Fault::BadAddress { address: self.address };
        let address = u16::try_from(self.address).map_err(|_| bad)?;
        let mut knob = Knob::new(address, "");
        if self.full_scale > 0 {
            knob.calibration = Some(KnobCalibration {
                full_scale: narrow(self.full_scale)?,
                lowest: narrow(self.lowest)?,
                highest: narrow(self.highest)?,
                centre: Some(narrow(self.centre)?).filter(|&centre| centre > 0),
                noise: narrow(self.noise)?,
            });
        }
        if self.step != 0.0 {
            knob.step = self.step;
        }
        Ok(knob)
    }
}

impl SinewBinding {
    fn resolve(&self, component_count: usize) -> Result<Binding, Fault> {
        let knob = u16::try_from(self.knob).map_err(|_| Fault::NoSuchKnob {
            knob: self.knob as usize,
            knob_count: SINEW_KNOBS_MAX,
        })?;
        let control = u16::try_from(self.control).map_err(|_| {
            Fault::Control(sinew_runtime::ControlError::NoSuchComponent {
                component: self.control as usize,
                component_count,
            })
        })?;
        let page = match (self.page, u16::try_from(self.page)) {
            (SINEW_NONE, _) => OnPage::Every,
            (_, Ok(page)) => OnPage::Only(page),
            (page, Err(_)) => {
                return Err(Fault::NoSuchPage {
                    page: page as usize,
                    page_count: u16::MAX.into(),
                });
            }
        };
        let number = self.curve_number;
        let curves = [
            Curve::Linear,
            Curve::Exponential { ratio: number },
            Curve::Logarithmic { ratio: number },
            Curve::SCurve { steepness: number },
        ];
        let centres = [Centre::default(), Centre::Even, Centre::Rest { detent: self.detent }];
        let limits = (self.minimum != 0.0 || self.maximum != 0.0).then_some((self.minimum, self.maximum));
        let response = Response {
            minimum: limits.map(|(minimum, _)| minimum),
            maximum: limits.map(|(_, maximum)| maximum),
            inverted: self.inverted != 0,
            centre: choice("binding.centre", self.centre, &centres)?,
            curve: choice("binding.curve", self.curve, &curves)?,
            slew: Some(self.slew).filter(|&slew| slew != 0.0),
        };
        Ok(Binding {
            knob,
            page,
            control,
            response,
            takeover: choice("binding.takeover", self.takeover, &TAKEOVERS)?,
        })
    }
}
