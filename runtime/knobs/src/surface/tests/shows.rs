//! What goes wrong on a stage, one scenario a test.

use super::*;

fn lines() -> SurfaceSettings {
    SurfaceSettings {
        spike_guard: true,
        ..SurfaceSettings::default()
    }
}

/// A box whose knob stands at the lower stop and has taken its control there.
fn with_a_knob_in_hand(settings: SurfaceSettings, body: impl FnOnce(&mut Show<'_, '_>)) {
    with_surface(&knobs(1), &[binding(0, 1)], &[], None, settings, |show| {
        for share in [0.5, 0.52, 0.5, 0.45, 0.5] {
            show.event(at(0, share));
            show.seconds(0.1);
        }
        assert_eq!(show.surface.takeover(0), TakeoverState::Engaged);
        body(show);
    });
}

#[test]
fn a_box_that_is_gone_lets_others_play_what_it_moved() {
    with_a_knob_in_hand(SurfaceSettings::default(), |show| {
        show.event(at(0, 0.8));
        show.seconds(0.5);
        assert!(show.weight(1) > 0.5);
        show.surface.unplugged(show.now_us);
        show.seconds(8.0);
        assert_eq!(show.weight(1), 0.0, "eased to rest");
        // An operator types, or a tablet takes over.
        show.controls.set(1, 0.5).unwrap();
        show.controls.set(0, 0.25).unwrap();
        show.seconds(3.0);
        assert_eq!((show.weight(1), show.weight(0)), (0.5, 0.25));
    });
}

#[test]
fn a_weight_that_somebody_takes_on_the_way_to_rest_stays() {
    with_a_knob_in_hand(SurfaceSettings::default(), |show| {
        show.event(at(0, 0.8));
        show.seconds(0.5);
        show.surface.unplugged(show.now_us);
        show.seconds(6.0);
        let on_the_way = show.weight(1);
        assert!(on_the_way > 0.0 && on_the_way < 0.8);
        show.controls.set(1, 1.25).unwrap();
        show.seconds(4.0);
        assert_eq!(show.weight(1), 1.25);
    });
}

#[test]
fn a_lost_byte_of_a_line_moves_nothing() {
    with_a_knob_in_hand(lines(), |show| {
        show.seconds(0.5);
        let before = show.weight(1);
        // `512|...` arrives as `12|...`, then as it should.
        show.event(at(0, 0.5));
        show.frame();
        show.event(at(0, 0.012));
        show.frame();
        show.event(at(0, 0.5));
        show.seconds(0.2);
        assert_eq!(show.weight(1), before);
        assert_eq!(show.surface.status().spikes, 1);
    });
}

#[test]
fn a_fast_turn_and_a_single_far_reading_are_believed() {
    with_a_knob_in_hand(lines(), |show| {
        // A turn from one report to the next waits for the second one only.
        for share in [0.62, 0.75, 0.88, 1.0] {
            show.event(at(0, share));
            show.frame();
        }
        show.seconds(0.3);
        assert_eq!(show.weight(1), 1.5);
        // A box that speaks only when turned says nothing more.
        show.event(at(0, 0.0));
        show.seconds(0.03);
        assert_eq!(show.weight(1), 1.5, "not yet");
        show.seconds(0.5);
        assert_eq!(show.weight(1), -2.0);
        assert_eq!(show.surface.status().spikes, 0);
    });
}

#[test]
fn a_spike_as_the_first_reading_is_no_place_to_come_from() {
    with_surface(&knobs(1), &[binding(0, 1)], &[], None, lines(), |show| {
        show.event(at(0, 0.012));
        show.frame();
        for _ in 0..20 {
            show.event(at(0, 0.9));
            show.frame();
        }
        assert_eq!(
            show.weight(1),
            0.0,
            "it did not pass the control on its way from nowhere"
        );
    });
}

#[test]
fn two_coarse_knobs_turned_together_leave_the_fine_ones_alone() {
    let tree = TreePages {
        coarse_knobs: 2,
        fine_knobs: 2,
        ..TreePages::default()
    };
    with_surface(&knobs(4), &[], &[], Some(tree), SurfaceSettings::default(), |show| {
        for knob in 0..4 {
            show.event(at(knob, 0.5));
        }
        show.event(at(1, 0.6));
        show.seconds(0.1);
        assert_eq!(show.surface.view().focus, Some(1));
        for n in 1..100 {
            show.event(at(0, 0.5 + 0.004 * n as f32));
            show.event(at(1, 0.6 - 0.004 * n as f32));
            show.seconds(0.02);
            assert_eq!(show.surface.view().focus, Some(1), "{n}");
        }
        show.seconds(2.0);
        assert_eq!(show.surface.view().focus, Some(1));
        show.event(at(0, 0.5));
        show.seconds(0.1);
        assert_eq!(show.surface.view().focus, Some(0), "a turn of its own");
    });
}

#[test]
fn a_fine_knob_in_the_hand_is_not_dealt_away() {
    let tree = TreePages {
        coarse_knobs: 2,
        fine_knobs: 2,
        ..TreePages::default()
    };
    with_surface(&knobs(4), &[], &[], Some(tree), SurfaceSettings::default(), |show| {
        for knob in 0..4 {
            show.event(at(knob, 0.5));
        }
        show.event(at(1, 0.6));
        show.seconds(1.0);
        for n in 1..100 {
            show.event(at(2, 0.5 + 0.004 * n as f32));
            show.event(at(0, 0.5 + 0.001 * n as f32));
            show.seconds(0.02);
        }
        assert_eq!(show.surface.view().focus, Some(1));
        assert!(show.weight(3) > 0.5, "it moved all the while");
    });
}

#[test]
fn an_encoder_that_is_spun_goes_further() {
    let knob = Knob {
        acceleration: 4.0,
        ..Knob::new(0, "")
    };
    let travel = |every_us: u64| {
        let mut weight = 0.0;
        with_surface(
            &[knob],
            &[binding(0, 0)],
            &[],
            None,
            SurfaceSettings::default(),
            |show| {
                for n in 1..=10 {
                    show.surface.event(n * every_us, steps(0, 1));
                }
                show.now_us = 10 * every_us;
                show.frame();
                show.seconds(1.0);
                weight = show.weight(0);
            },
        );
        weight
    };
    let (slow, fast) = (travel(200_000), travel(5_000));
    assert!((slow - 0.3).abs() < 1e-3, "{slow}");
    assert!(fast > 3.0 * slow && fast < 4.01 * slow, "{fast}");
}
