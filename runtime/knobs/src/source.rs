//! Sources: where knob events come from. A device's thread, a socket or a program's own sliders stand behind one trait that
//! never blocks; the frame polls it and hands what it says to the surface.

use crate::event::{KnobEvent, Reading};
use crate::protocol::Name;

/// What a source says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SourceEvent {
    /// A knob's reading.
    Knob(KnobEvent),
    /// The device is gone. Its knobs hold, then ease to rest.
    Unplugged,
    /// The device is back. Nothing moves until its knobs pick their controls up.
    Replugged,
    /// The device calls a knob so. Told before the knob's first reading where the device labels it, later where it says its names later.
    Named {
        /// Address of the knob.
        knob: u16,
        /// Its name.
        name: Name,
    },
}

/// Something that knob events come from.
///
/// A source neither blocks, waits for a lock nor allocates in `poll`: what takes time happens in a thread of its own. Times are
/// microseconds of one clock that never runs back, chosen by the caller; a source that reads a clock itself reads that one.
pub trait ControlSource {
    /// Hands over everything that came since the last call, each knob's oldest first, with the time at which it arrived, which
    /// is not later than `now_us`. Of several positions of one knob only the newest need be handed over.
    fn poll(&mut self, now_us: u64, sink: &mut dyn FnMut(u64, SourceEvent));
}

/// Why a slider did not move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SliderError {
    /// There is no such slider.
    NoSuchSlider {
        /// The index asked for.
        slider: usize,
        /// How many there are.
        slider_count: usize,
    },
    /// The position is NaN or infinite.
    NotFinite,
}

impl core::error::Error for SliderError {}

impl core::fmt::Display for SliderError {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::NoSuchSlider { slider, slider_count } => {
                write!(out, "there is no slider {slider}: there are {slider_count}")
            }
            Self::NotFinite => write!(out, "the position is not a finite number; the slider stays"),
        }
    }
}

/// One slider of a [`SliderSource`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Slider {
    value: u16,
    changed_us: Option<u64>,
}

/// Sliders that a program or a user interface moves: a source without a device. Slider `n` is the knob of address `n`.
#[derive(Debug)]
pub struct SliderSource<'m> {
    sliders: &'m mut [Slider],
}

impl<'m> SliderSource<'m> {
    /// As many sliders as the caller has memory for, none moved yet; more than 65,536 have no address and are left out.
    pub fn new(sliders: &'m mut [Slider]) -> Self {
        sliders.fill(Slider::default());
        Self { sliders }
    }

    /// Puts a slider at `position`, clamped to `[0, 1]`. The surface sees it at the next poll.
    ///
    /// # Errors
    /// [`SliderError`]; the slider then stays.
    pub fn set(&mut self, now_us: u64, slider: usize, position: f32) -> Result<(), SliderError> {
        let slider_count = self.sliders.len();
        let Some(own) = self.sliders.get_mut(slider).filter(|_| slider <= usize::from(u16::MAX)) else {
            return Err(SliderError::NoSuchSlider { slider, slider_count });
        };
        if !position.is_finite() {
            return Err(SliderError::NotFinite);
        }
        *own = Slider {
            value: libm::roundf(position.clamp(0.0, 1.0) * f32::from(u16::MAX)) as u16,
            changed_us: Some(now_us),
        };
        Ok(())
    }
}

impl ControlSource for SliderSource<'_> {
    fn poll(&mut self, now_us: u64, sink: &mut dyn FnMut(u64, SourceEvent)) {
        for (knob, slider) in self.sliders.iter_mut().enumerate() {
            if let Some(at_us) = slider.changed_us.take() {
                let reading = Reading::Position {
                    value: slider.value,
                    full_scale: u16::MAX,
                };
                let event = KnobEvent {
                    knob: knob as u16,
                    reading,
                };
                sink(at_us.min(now_us), SourceEvent::Knob(event));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn the_newest_position_wins_and_is_told_once() {
        let mut memory = [Slider::default(); 3];
        let mut source = SliderSource::new(&mut memory);
        source.set(1, 2, 0.1).unwrap();
        source.set(2, 2, 1.0).unwrap();
        source.set(3, 0, -4.0).unwrap();
        let mut heard = Vec::new();
        source.poll(10, &mut |at, event| heard.push((at, event)));
        source.poll(11, &mut |_, _| panic!("told already"));
        let event = |knob, value| {
            SourceEvent::Knob(KnobEvent {
                knob,
                reading: Reading::Position {
                    value,
                    full_scale: u16::MAX,
                },
            })
        };
        assert_eq!(heard, [(3, event(0, 0)), (2, event(2, u16::MAX))]);
    }

    #[test]
    fn validity() {
        let mut memory = [Slider::default(); 2];
        let mut source = SliderSource::new(&mut memory);
        let missing = SliderError::NoSuchSlider {
            slider: 2,
            slider_count: 2,
        };
        assert_eq!(source.set(0, 2, 0.0), Err(missing));
        for bad in [f32::NAN, f32::INFINITY] {
            assert_eq!(source.set(0, 0, bad), Err(SliderError::NotFinite));
        }
        source.poll(0, &mut |_, _| panic!("nothing moved"));
    }
}
