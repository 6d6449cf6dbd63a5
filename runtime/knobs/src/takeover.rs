//! Takeover: who moves a control when its knob stands elsewhere. Works on places in `[0, 1]`, the control's own scale; holds
//! the place that the control has (`held`) against the place where its knob stands.

use libm::fabsf;

/// What a knob does with a control that stands elsewhere.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Takeover {
    /// The control goes to the knob at the knob's first move.
    Jump,
    /// The control waits until the knob passes its place, however fast.
    #[default]
    Pickup,
    /// The control follows in proportion, never more than the knob moves, so that both meet at the end that the knob is
    /// turned to when the control is the nearer to it.
    Scale,
    /// The control moves as much as the knob. At a stop the control waits for the knob to turn back.
    Relative,
}

/// Which way to turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Counter-clockwise, down.
    Left,
    /// Clockwise, up.
    Right,
}

/// Where a knob stands with what it should move; for a display.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TakeoverState {
    /// The knob moves nothing on this page.
    Unassigned,
    /// The knob has not been heard of since it was plugged in.
    Unheard,
    /// Everything is held: unplugged, easing to rest, or stopped.
    Held,
    /// The knob moves its control.
    Engaged,
    /// The knob must first be turned.
    Waiting {
        /// Turn it this way.
        direction: Direction,
        /// So far, in travels of the knob.
        distance: f32,
    },
}

/// Places closer than this are one: a third of a step of fourteen bits, and more than rounding does.
const SAME_PLACE: f32 = 2e-5;

/// State of one knob against one control.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Grip {
    /// Place of the control.
    pub(crate) held: f32,
    /// Place of the knob when last seen.
    pub(crate) knob: f32,
    pub(crate) engaged: bool,
    /// After a stop or an unplugging nothing may jump, whatever the mode.
    pub(crate) wary: bool,
}

impl Grip {
    /// Holds a control at `held` while its knob stands at `knob`.
    pub(crate) fn arm(held: f32, knob: f32, wary: bool) -> Self {
        let engaged = fabsf(held - knob) <= SAME_PLACE;
        Self {
            held,
            knob,
            engaged,
            wary,
        }
    }

    /// The knob now stands at `knob`; moves `held` as the mode says. In every mode but jump, `held` moves no further than
    /// the knob, give or take [`SAME_PLACE`].
    pub(crate) fn turn_to(&mut self, mode: Takeover, knob: f32) {
        let (before, moved) = (self.knob, knob - self.knob);
        self.knob = knob;
        if moved == 0.0 {
            return;
        }
        let mode = if self.wary && mode == Takeover::Jump {
            Takeover::Pickup
        } else {
            mode
        };
        if mode == Takeover::Relative {
            self.held = (self.held + moved).clamp(0.0, 1.0);
            self.engaged = true;
            return;
        }
        // The control's place lay on the way: what the knob passes it picks up.
        let passed = (before - self.held) * (knob - self.held) <= 0.0 || fabsf(before - self.held) <= SAME_PLACE;
        if mode == Takeover::Jump || self.engaged || passed {
            self.held = knob;
            self.engaged = true;
            self.wary = false;
        } else if mode == Takeover::Scale {
            let (room, held_room) = if moved > 0.0 {
                (1.0 - before, 1.0 - self.held)
            } else {
                (before, self.held)
            };
            let share = if room > held_room { held_room / room } else { 1.0 };
            self.held = (self.held + share * moved).clamp(0.0, 1.0);
            if fabsf(self.held - knob) <= SAME_PLACE {
                self.held = knob;
                self.engaged = true;
                self.wary = false;
            }
        }
    }

    /// An encoder turned by this much; it has no place and so nothing to pick up.
    pub(crate) fn turn_by(&mut self, moved: f32) {
        self.held = (self.held + moved).clamp(0.0, 1.0);
        self.engaged = true;
        self.wary = false;
    }

    /// For a display. `inverted`: the place grows when the knob turns left.
    pub(crate) fn state(&self, mode: Takeover, inverted: bool) -> TakeoverState {
        if self.engaged || mode == Takeover::Relative || (mode == Takeover::Jump && !self.wary) {
            return TakeoverState::Engaged;
        }
        let way = self.held - self.knob;
        let direction = if (way > 0.0) == inverted {
            Direction::Left
        } else {
            Direction::Right
        };
        TakeoverState::Waiting {
            direction,
            distance: fabsf(way),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::Noise;

    fn run(mode: Takeover, held: f32, knobs: &[f32]) -> Grip {
        let mut grip = Grip::arm(held, knobs[0], false);
        for &knob in &knobs[1..] {
            grip.turn_to(mode, knob);
        }
        grip
    }

    #[test]
    fn pickup_waits_says_where_to_turn_and_takes_over() {
        let mut grip = Grip::arm(0.7, 0.2, false);
        grip.turn_to(Takeover::Pickup, 0.5);
        assert_eq!(grip.held, 0.7);
        let TakeoverState::Waiting { direction, distance } = grip.state(Takeover::Pickup, false) else {
            panic!("waits")
        };
        assert_eq!(direction, Direction::Right);
        assert!(fabsf(distance - 0.2) < 1e-6);
        assert!(matches!(
            grip.state(Takeover::Pickup, true),
            TakeoverState::Waiting {
                direction: Direction::Left,
                ..
            }
        ));
        grip.turn_to(Takeover::Pickup, 0.71);
        assert_eq!(
            (grip.held, grip.state(Takeover::Pickup, false)),
            (0.71, TakeoverState::Engaged)
        );
        grip.turn_to(Takeover::Pickup, 0.1);
        assert_eq!(grip.held, 0.1, "and keeps it");
    }

    #[test]
    fn a_turn_that_skips_over_the_value_still_picks_up() {
        // DelugeFirmware issue 1707: large steps of a fast turn must not step over the pickup point.
        for knobs in [[0.0, 1.0], [1.0, 0.0], [0.69, 0.9], [0.9, 0.5], [0.2, 0.7]] {
            assert_eq!(run(Takeover::Pickup, 0.7, &knobs).held, knobs[1], "{knobs:?}");
            assert_eq!(run(Takeover::Scale, 0.7, &knobs).held, knobs[1], "{knobs:?}");
        }
        for knobs in [[0.0, 0.69], [1.0, 0.71]] {
            assert_eq!(run(Takeover::Pickup, 0.7, &knobs).held, 0.7, "{knobs:?}");
        }
    }

    #[test]
    fn an_unmoved_knob_is_engaged_and_the_ends_can_be_picked_up() {
        assert!(Grip::arm(0.4, 0.4, false).engaged);
        assert!(run(Takeover::Pickup, 1.0, &[0.5, 1.0]).engaged);
        assert!(run(Takeover::Pickup, 0.0, &[0.5, 0.0]).engaged);
    }

    #[test]
    fn jump_goes_at_the_first_move_unless_wary() {
        let mut grip = Grip::arm(0.7, 0.2, false);
        grip.turn_to(Takeover::Jump, 0.2);
        assert_eq!(grip.held, 0.7, "no move, no jump");
        grip.turn_to(Takeover::Jump, 0.21);
        assert_eq!(grip.held, 0.21);
        let mut grip = Grip::arm(0.7, 0.2, true);
        grip.turn_to(Takeover::Jump, 0.21);
        assert_eq!(grip.held, 0.7, "after a stop it waits");
        grip.turn_to(Takeover::Jump, 0.8);
        assert_eq!(grip.held, 0.8);
        let mut other = Grip::arm(0.1, 0.8, false);
        other.turn_to(Takeover::Jump, 0.79);
        assert_eq!(other.held, 0.79, "and jumps again from then on");
    }

    #[test]
    fn scale_meets_at_the_end() {
        let up = run(Takeover::Scale, 0.8, &[0.2, 0.4, 0.6, 0.8, 1.0]);
        assert_eq!((up.held, up.engaged), (1.0, true));
        let half_way = run(Takeover::Scale, 0.8, &[0.2, 0.6]);
        assert!(fabsf(half_way.held - 0.9) < 1e-6 && !half_way.engaged);
        let down = run(Takeover::Scale, 0.2, &[0.9, 0.5, 0.0]);
        assert_eq!((down.held, down.engaged), (0.0, true));
    }

    #[test]
    fn relative_moves_as_much_and_realigns_at_a_stop() {
        assert!(fabsf(run(Takeover::Relative, 0.8, &[0.2, 0.3]).held - 0.9) < 1e-6);
        assert_eq!(run(Takeover::Relative, 0.8, &[0.2, 0.9]).held, 1.0);
        assert!(fabsf(run(Takeover::Relative, 0.8, &[0.2, 0.9, 0.8]).held - 0.9) < 1e-6);
        let mut grip = Grip::arm(0.5, 0.0, true);
        grip.turn_by(0.25);
        assert_eq!(grip.held, 0.75);
    }

    #[test]
    fn no_mode_but_jump_moves_the_control_more_than_its_knob() {
        for seed in 0..200 {
            let mut noise = Noise::new(seed);
            for mode in [Takeover::Pickup, Takeover::Scale, Takeover::Relative] {
                let mut grip = Grip::arm(0.5 + 0.5 * noise.next(), 0.5 + 0.5 * noise.next(), seed % 2 == 0);
                for _ in 0..100 {
                    let knob = if noise.next() > 0.8 {
                        f32::from(u8::from(noise.next() > 0.0))
                    } else {
                        (grip.knob + 0.3 * noise.next()).clamp(0.0, 1.0)
                    };
                    let before = grip;
                    grip.turn_to(mode, knob);
                    let moved = fabsf(grip.held - before.held);
                    let allowed = fabsf(knob - before.knob) + 2.0 * SAME_PLACE;
                    assert!(moved <= allowed, "{mode:?}: {before:?} -> {grip:?}");
                    assert!((0.0..=1.0).contains(&grip.held));
                    if mode == Takeover::Pickup {
                        let between = (before.knob - before.held) * (knob - before.held) < 0.0;
                        assert!(!between || grip.engaged, "never skips");
                    }
                }
            }
        }
    }
}
