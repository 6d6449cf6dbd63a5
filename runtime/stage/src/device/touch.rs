//! Which knob a hand is turning: the first that has gone a clear way from where it stood.

use sinew_knobs::{KnobEvent, Reading};

/// Way that counts as a turn, parts of the full scale. Noise and a sagging supply stay under it.
const TURN: f32 = 0.12;
/// Steps of an encoder that count as a turn.
const STEPS: i32 = 4;

/// Where a knob stood when it was first heard, or when a turn was last found.
#[derive(Debug, Clone, Copy)]
struct Stand {
    knob: u16,
    start: f32,
    latest: f32,
    steps: i32,
}

/// Watches all knobs of a device.
#[derive(Debug, Default)]
pub struct Touch {
    stands: Vec<Stand>,
}

impl Touch {
    /// Takes a reading; the knob, once it has been turned. From then on all knobs are looked at anew.
    pub fn event(&mut self, event: KnobEvent) -> Option<u16> {
        let position = match event.reading {
            Reading::Position { value, full_scale } => Some(f32::from(value) / f32::from(full_scale.max(1))),
            Reading::Steps(_) => None,
        };
        let index = self
            .stands
            .iter()
            .position(|stand| stand.knob == event.knob)
            .unwrap_or_else(|| {
                let start = position.unwrap_or(0.0);
                self.stands.push(Stand {
                    knob: event.knob,
                    start,
                    latest: start,
                    steps: 0,
                });
                self.stands.len() - 1
            });
        let stand = &mut self.stands[index];
        match (event.reading, position) {
            (Reading::Steps(steps), _) => stand.steps += i32::from(steps),
            (_, Some(position)) => stand.latest = position,
            (_, None) => {}
        }
        if (stand.latest - stand.start).abs() < TURN && stand.steps.abs() < STEPS {
            return None;
        }
        self.settle();
        Some(event.knob)
    }

    /// From here on every knob stands where it is.
    pub fn settle(&mut self) {
        for stand in &mut self.stands {
            (stand.start, stand.steps) = (stand.latest, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(knob: u16, value: u16) -> KnobEvent {
        KnobEvent {
            knob,
            reading: Reading::Position {
                value,
                full_scale: 1023,
            },
        }
    }

    #[test]
    fn noise_is_no_turn_and_a_turn_is_found_once() {
        let mut touch = Touch::default();
        for n in 0..50 {
            assert_eq!(touch.event(at(0, 500 + n % 7)), None);
            assert_eq!(touch.event(at(1, 900 - n % 5)), None);
        }
        let found: Vec<u16> = (0..60).filter_map(|n| touch.event(at(1, 900 - 3 * n))).collect();
        assert_eq!(found, [1], "a longer turn is a second one");
        assert_eq!(touch.event(at(0, 503)), None);
        let step = KnobEvent {
            knob: 7,
            reading: Reading::Steps(-2),
        };
        assert_eq!((touch.event(step), touch.event(step)), (None, Some(7)));
    }
}
