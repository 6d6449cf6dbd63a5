//! Promises that hold for any sequence of events, unpluggings, stops and page changes.

use super::*;
use crate::fixture::Noise;

/// Everything that can happen to a surface, at random.
fn mischief(show: &mut Show<'_, '_>, noise: &mut Noise, knob_count: u16) {
    let mut dice = |sides: u32| (((noise.next() + 1.0) / 2.0 * sides as f32) as u32).min(sides - 1);
    let knob = dice(knob_count.into()) as u16;
    match dice(40) {
        0 => show.surface.unplugged(show.now_us),
        1 | 2 => show.surface.replugged(show.now_us),
        3 => show.surface.command(Command::Next),
        4 => show.surface.command(Command::Into),
        5 => show.surface.command(Command::Out),
        6 => show.surface.command(Command::NextFine),
        7 => show.surface.command(Command::Focus(dice(6) as u16)),
        8 if dice(4) == 0 => show.surface.command(Command::Stop),
        9..=12 => show.surface.command(Command::Release),
        13 => show.now_us += 400_000,
        14 => show.surface.command(Command::Page(dice(3) as u16)),
        15..=17 => show.event(at(knob, [0.0, 1.0, 0.5][dice(3) as usize])),
        _ => show.event(at(knob, dice(1000) as f32 / 1000.0)),
    }
}

fn shows(takeover: Takeover, slew: Option<f32>, mut check: impl FnMut(&mut Show<'_, '_>, &mut Noise)) {
    let response = Response {
        centre: Centre::Even,
        slew,
        ..Response::default()
    };
    let on = |page, knob, control| Binding {
        page: OnPage::Only(page),
        knob,
        control,
        response,
        takeover,
    };
    let tree = TreePages {
        coarse_knobs: 2,
        fine_knobs: 2,
        response,
        takeover,
        ..TreePages::default()
    };
    let settings = SurfaceSettings {
        failsafe: Failsafe {
            ease_after_us: Some(300_000),
            ease_us: 700_000,
            ..Failsafe::default()
        },
        ..SurfaceSettings::default()
    };
    let bindings = [
        on(0, 0, 0),
        on(0, 1, 1),
        on(0, 1, 2),
        on(1, 0, 3),
        on(1, 1, 0),
        on(2, 2, 4),
        on(2, 3, 1),
    ];
    for seed in 0..40 {
        let mut noise = Noise::new(seed);
        if seed % 2 == 0 {
            with_surface(&knobs(4), &[], &[], Some(tree), settings, |show| {
                check(show, &mut noise)
            });
        } else {
            with_surface(&knobs(4), &bindings, &[], None, settings, |show| {
                check(show, &mut noise)
            });
        }
    }
}

#[test]
fn no_control_moves_further_than_its_knob() {
    let mut moves = 0;
    for takeover in [Takeover::Pickup, Takeover::Scale, Takeover::Relative] {
        shows(takeover, None, |show, noise| {
            for _ in 0..600 {
                let rests = |show: &Show<'_, '_>| show.surface.status().health.lost || show.surface.is_stopped();
                mischief(show, noise, 4);
                let rested = rests(show);
                let before: Vec<f32> = show.controls.weights().to_vec();
                let stood: Vec<Option<f32>> = (0..4).map(|knob| show.surface.position(knob)).collect();
                show.frame();
                let resting = rested || rests(show);
                let knob_moved = (0..4).filter_map(|n| Some((show.surface.position(n)? - stood[n]?).abs()));
                let knob_moved = knob_moved.fold(0.0, f32::max);
                for (control, (&now, &then)) in show.controls.weights().iter().zip(&before).enumerate() {
                    let component = show.controls.basis().component(control);
                    let range = component.maximum - component.minimum;
                    // On the way to rest it goes nearer to it, and not beyond; how fast is another test's.
                    let allowed = if resting {
                        then.abs()
                    } else {
                        range * (knob_moved + 1e-5)
                    };
                    assert!((now - then).abs() <= allowed, "{takeover:?} {control}: {then} -> {now}");
                    moves += usize::from(now != then && !resting);
                }
            }
        });
    }
    assert!(moves > 10_000, "the mischief plays: {moves}");
}

#[test]
fn no_control_moves_faster_than_its_slew_limit_whatever_happens() {
    for takeover in [Takeover::Jump, Takeover::Pickup, Takeover::Scale, Takeover::Relative] {
        shows(takeover, Some(0.8), |show, noise| {
            for _ in 0..600 {
                let then_us = show.now_us;
                mischief(show, noise, 4);
                let before: Vec<f32> = show.controls.weights().to_vec();
                show.frame();
                let dt_us = (show.now_us - then_us).min(FRAME_US_MAX);
                let allowed = 0.8 * dt_us as f32 * 1e-6 + 1e-6;
                for (&now, &then) in show.controls.weights().iter().zip(&before) {
                    assert!(
                        (now - then).abs() <= allowed,
                        "{takeover:?}: {then} -> {now} in {dt_us} us"
                    );
                }
            }
        });
    }
}

#[test]
fn the_same_hand_gives_the_same_weights_at_any_frame_rate() {
    let hand = |t: f32| 0.5 + 0.45 * libm::sinf(3.0 * t);
    let weights_at = |fps: u64| -> Vec<f32> {
        let mut weights = Vec::new();
        with_surface(
            &knobs(1),
            &[binding(0, 0)],
            &[],
            None,
            SurfaceSettings::default(),
            |show| {
                let mut next_us = 0;
                for tenth in 1..=30_u64 {
                    for frame in 1..=fps / 10 {
                        let frame_us = (tenth - 1) * 100_000 + frame * 1_000_000 / fps;
                        while next_us <= frame_us {
                            show.surface.event(next_us, at(0, hand(next_us as f32 * 1e-6)));
                            next_us += 2_000;
                        }
                        show.surface.advance(frame_us, &mut show.controls).unwrap();
                    }
                    weights.push(show.weight(0));
                }
            },
        );
        weights
    };
    let yardstick = weights_at(240);
    for fps in [30, 60] {
        let pairs = weights_at(fps).into_iter().zip(&yardstick);
        let largest = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // Half a frame of the fastest hand here, 1.35 travels of 2.5 a second.
        assert!(largest < 0.5 / fps as f32 * 1.35 * 2.6, "{fps}: {largest}");
    }
}

#[test]
fn a_resting_noisy_pot_moves_not_a_bit() {
    let calibration = Some(KnobCalibration {
        full_scale: 1023,
        lowest: 5,
        highest: 1010,
        centre: None,
        noise: 3,
    });
    let knob = Knob {
        calibration,
        ..Knob::new(0, "")
    };
    with_surface(
        &[knob],
        &[binding(0, 0)],
        &[],
        None,
        SurfaceSettings::default(),
        |show| {
            let mut noise = Noise::new(4);
            let mut pot = |show: &mut Show<'_, '_>, value: f32| {
                let value = libm::roundf(value + 3.0 * noise.next()) as u16;
                let reading = Reading::Position {
                    value,
                    full_scale: 1023,
                };
                show.event(KnobEvent { knob: 0, reading });
                show.frame();
                show.weight(0)
            };
            for n in 0..100 {
                pot(show, 507.0 + 2.0 * n as f32);
            }
            for _ in 0..300 {
                pot(show, 707.0);
            }
            let still = show.weight(0);
            assert!(still > 0.4);
            for _ in 0..5000 {
                assert_eq!(pot(show, 707.0).to_bits(), still.to_bits());
            }
            for _ in 0..300 {
                pot(show, 1008.0);
            }
            assert_eq!(show.weight(0), 1.5, "and the stop is the maximum");
        },
    );
}
