//! A simulated box on a simulated show: what moves, what waits, and that nothing jumps.

mod promises;
mod shows;

use std::vec;
use std::vec::Vec;

use super::*;
use crate::fixture::{Package, open};
use crate::map::{Binding, Button, Knob, OnPage, TreePages};
use crate::response::{Centre, Response};
use crate::takeover::{Direction, Takeover, TakeoverState};
use crate::{Health, KnobCalibration};
use sinew_runtime::Controls;

const FRAME_US: u64 = 10_000;

/// Knob `knob` reads `share` of sixteen bits.
fn at(knob: u16, share: f32) -> KnobEvent {
    KnobEvent {
        knob,
        reading: Reading::Position {
            value: (share * 65_535.0) as u16,
            full_scale: 65_535,
        },
    }
}

fn steps(knob: u16, steps: i16) -> KnobEvent {
    KnobEvent {
        knob,
        reading: Reading::Steps(steps),
    }
}

/// Knobs without end margins or noise, so that a reading is a position.
fn knobs(count: u16) -> Vec<Knob<'static>> {
    (0..count).map(|n| Knob::new(n, "")).collect()
}

fn binding(knob: u16, control: u16) -> Binding {
    Binding {
        knob,
        control,
        ..Binding::default()
    }
}

/// Runs `body` with a surface, its controls and a function that lets frames pass.
fn with_surface(
    knobs: &[Knob<'_>],
    bindings: &[Binding],
    buttons: &[Button],
    tree: Option<TreePages>,
    settings: SurfaceSettings,
    body: impl FnOnce(&mut Show<'_, '_>),
) {
    let package = Package::small(1);
    let basis = open(&package);
    let map = ControlMap::new(basis, knobs, bindings, buttons, tree).unwrap();
    let mut buffers = SurfaceBuffers::for_map(&map);
    let mut weights = [0.0; Package::COMPONENTS];
    let surface = ControlSurface::new(map, settings, buffers.memory()).unwrap();
    let controls = Controls::new(&basis, &mut weights).unwrap();
    body(&mut Show {
        surface,
        controls,
        now_us: 0,
    });
}

struct Show<'m, 'c> {
    surface: ControlSurface<'m>,
    controls: Controls<'c>,
    now_us: u64,
}

impl Show<'_, '_> {
    fn event(&mut self, event: KnobEvent) {
        self.surface.event(self.now_us, event);
    }

    fn frame(&mut self) {
        self.now_us += FRAME_US;
        self.surface.advance(self.now_us, &mut self.controls).unwrap();
    }

    fn seconds(&mut self, seconds: f32) {
        for _ in 0..(seconds * 1e6) as u64 / FRAME_US {
            self.frame();
        }
    }

    fn weight(&self, control: usize) -> f32 {
        self.controls.weights()[control]
    }
}

#[test]
fn a_knob_picks_its_control_up_and_moves_it_from_end_to_end() {
    let settings = SurfaceSettings::default();
    with_surface(&knobs(1), &[binding(0, 1)], &[], None, settings, |show| {
        assert_eq!(show.surface.takeover(0), TakeoverState::Unheard);
        show.event(at(0, 0.2));
        show.seconds(0.5);
        assert_eq!(show.weight(1), 0.0);
        let TakeoverState::Waiting { direction, distance } = show.surface.takeover(0) else {
            panic!("waits")
        };
        assert_eq!(direction, Direction::Right);
        assert!((0.28..0.32).contains(&distance), "{distance}");
        show.event(at(0, 1.0));
        show.seconds(1.0);
        assert_eq!(show.weight(1), 1.5, "the maximum, exactly");
        assert_eq!(show.surface.takeover(0), TakeoverState::Engaged);
        show.event(at(0, 0.0));
        show.seconds(1.0);
        assert_eq!(show.weight(1), -2.0, "the minimum, exactly");
        show.event(at(0, 0.51));
        show.seconds(1.0);
        assert_eq!(show.weight(1), 0.0, "rest, exactly, in the detent");
    });
}

#[test]
fn a_group_moves_each_control_on_its_own_scale() {
    let half = Response {
        maximum: Some(0.5),
        inverted: true,
        ..Response::default()
    };
    let second = Binding {
        response: half,
        ..binding(0, 1)
    };
    with_surface(
        &knobs(1),
        &[binding(0, 0), second],
        &[],
        None,
        SurfaceSettings::default(),
        |show| {
            show.event(at(0, 0.5));
            show.frame();
            show.event(at(0, 0.0));
            show.seconds(1.0);
            assert_eq!((show.weight(0), show.weight(1)), (-1.0, 0.5));
            assert_eq!(show.surface.assignments().count(), 2);
        },
    );
}

#[test]
fn an_encoder_moves_by_steps() {
    with_surface(
        &knobs(1),
        &[binding(0, 0)],
        &[],
        None,
        SurfaceSettings::default(),
        |show| {
            show.event(steps(0, 25));
            show.seconds(1.0);
            assert!(
                (show.weight(0) - 0.75).abs() < 1e-3,
                "a quarter of the travel up: {}",
                show.weight(0)
            );
            show.event(steps(0, 500));
            show.seconds(1.0);
            assert_eq!(show.weight(0), 1.5);
            show.event(steps(0, -25));
            show.seconds(1.0);
            assert!((show.weight(0) - 0.75).abs() < 1e-3, "a stop swallows what goes beyond");
            assert_eq!(show.surface.takeover(0), TakeoverState::Engaged);
            assert_eq!(show.surface.position(0), None);
        },
    );
}

#[test]
fn a_coarse_knob_brings_its_children_and_they_wait() {
    let tree = TreePages {
        coarse_knobs: 2,
        fine_knobs: 2,
        ..TreePages::default()
    };
    with_surface(&knobs(4), &[], &[], Some(tree), SurfaceSettings::default(), |show| {
        for knob in 0..4 {
            show.event(at(knob, 0.5));
        }
        show.frame();
        assert_eq!(show.surface.takeover(2), TakeoverState::Unassigned);
        show.event(at(1, 0.8));
        show.seconds(0.5);
        assert_eq!(show.surface.view().focus, Some(1));
        assert!(show.weight(1) > 0.5, "and moves while it does");
        let controls: Vec<usize> = show.surface.assignments().map(|a| a.control).collect();
        assert_eq!(controls, [0, 1, 3, 4]);
        show.event(at(2, 0.9));
        show.seconds(0.5);
        let played = show.weight(3);
        assert!(played > 1.0);
        // Not while the hand is on it, but soon after: the other coarse knob brings its child onto the same knob, which then waits.
        show.event(at(0, 0.3));
        show.seconds(0.1);
        assert_eq!(show.surface.view().focus, Some(1));
        show.seconds(0.7);
        assert_eq!((show.weight(2), show.weight(3)), (0.0, played));
        assert!(matches!(
            show.surface.takeover(2),
            TakeoverState::Waiting {
                direction: Direction::Left,
                ..
            }
        ));
        // And back: the unmoved knob has its control again at once.
        show.seconds(0.5);
        show.event(at(1, 0.7));
        show.seconds(0.5);
        assert_eq!(
            (show.weight(3), show.surface.takeover(2)),
            (played, TakeoverState::Engaged)
        );
    });
}

#[test]
fn pages_of_bindings_turn_by_button_and_keep_what_is_on_both() {
    let on = |page, knob, control| Binding {
        page: OnPage::Only(page),
        ..binding(knob, control)
    };
    let bindings = [on(0, 0, 0), on(1, 0, 1), binding(1, 2)];
    let buttons = [Button {
        address: 9,
        command: Command::Next,
    }];
    with_surface(
        &knobs(2),
        &bindings,
        &buttons,
        None,
        SurfaceSettings::default(),
        |show| {
            for knob in 0..2 {
                show.event(at(knob, 0.5));
            }
            show.frame();
            show.event(at(0, 0.9));
            show.event(at(1, 0.9));
            show.seconds(0.5);
            show.event(at(9, 1.0));
            show.event(at(9, 1.0));
            show.event(at(9, 0.0));
            show.frame();
            assert_eq!(show.surface.page(), 1, "a press counts once");
            assert!(matches!(show.surface.takeover(0), TakeoverState::Waiting { .. }));
            assert_eq!(show.surface.takeover(1), TakeoverState::Engaged);
            assert_eq!(show.weight(1), 0.0);
            show.surface.command(Command::Previous);
            show.frame();
            assert_eq!(
                (show.surface.page(), show.surface.takeover(0)),
                (0, TakeoverState::Engaged)
            );
            show.surface.command(Command::Page(7));
            assert_eq!(show.surface.page(), 0, "no such page");
        },
    );
}

#[test]
fn unplugged_it_holds_then_eases_to_rest_and_resumes_by_pickup() {
    let jump = Binding {
        takeover: Takeover::Jump,
        ..binding(0, 0)
    };
    with_surface(&knobs(1), &[jump], &[], None, SurfaceSettings::default(), |show| {
        show.event(at(0, 0.5));
        show.frame();
        show.event(at(0, 0.9));
        show.seconds(0.5);
        let played = show.weight(0);
        show.surface.unplugged(show.now_us);
        show.seconds(4.9);
        assert_eq!(
            (show.weight(0), show.surface.takeover(0)),
            (played, TakeoverState::Held)
        );
        show.seconds(1.1);
        assert!(show.weight(0) < 0.6 * played && show.weight(0) > 0.4 * played);
        show.seconds(1.1);
        assert_eq!(show.weight(0), 0.0);
        show.surface.replugged(show.now_us);
        show.event(at(0, 0.9));
        show.seconds(0.2);
        show.event(at(0, 0.8));
        show.seconds(0.2);
        assert_eq!(show.weight(0), 0.0, "even where the takeover is jump");
        show.event(at(0, 0.3));
        show.seconds(0.5);
        assert!(show.weight(0) < 0.0);
        assert_eq!(show.surface.status().losses, 1);
    });
}

#[test]
fn replugged_in_time_the_pose_stays_and_an_unmoved_knob_goes_on() {
    with_surface(
        &knobs(1),
        &[binding(0, 0)],
        &[],
        None,
        SurfaceSettings::default(),
        |show| {
            show.event(at(0, 0.5));
            show.frame();
            show.event(at(0, 0.9));
            show.seconds(0.5);
            let played = show.weight(0);
            show.surface.unplugged(show.now_us);
            show.seconds(1.0);
            show.event(at(0, 0.9));
            show.seconds(0.5);
            assert_eq!(show.weight(0), played, "whoever speaks is back");
            assert_eq!(show.surface.takeover(0), TakeoverState::Engaged);
        },
    );
}

#[test]
fn a_stop_eases_everything_to_rest_and_holds_it() {
    let buttons = [Button {
        address: 50,
        command: Command::Stop,
    }];
    with_surface(
        &knobs(1),
        &[binding(0, 0)],
        &buttons,
        None,
        SurfaceSettings::default(),
        |show| {
            show.controls.set(4, 1.0).unwrap();
            show.event(at(0, 0.5));
            show.frame();
            show.event(at(0, 1.0));
            show.seconds(0.5);
            show.event(at(50, 1.0));
            show.seconds(2.5);
            assert_eq!(
                show.controls.weights(),
                [0.0; Package::COMPONENTS],
                "what no knob has as well"
            );
            show.event(at(0, 0.2));
            show.seconds(0.5);
            assert_eq!((show.weight(0), show.surface.takeover(0)), (0.0, TakeoverState::Held));
            show.event(at(50, 0.0));
            show.frame();
            show.event(at(0, 0.3));
            show.seconds(0.5);
            assert_eq!(show.weight(0), 0.0, "released, it waits");
            assert!(matches!(show.surface.takeover(0), TakeoverState::Waiting { .. }));
            show.event(at(0, 0.7));
            show.seconds(0.5);
            assert!(show.weight(0) > 0.0);
            // A short press runs to its end.
            show.event(at(50, 1.0));
            show.event(at(50, 0.0));
            show.seconds(1.0);
            assert!(show.surface.is_stopped() && show.weight(0) > 0.0);
            show.seconds(1.5);
            assert_eq!((show.weight(0), show.surface.is_stopped()), (0.0, false));
            show.surface.command(Command::Stop);
            show.seconds(5.0);
            assert!(show.surface.is_stopped(), "a program's stop holds until its release");
            show.surface.command(Command::Release);
            show.seconds(0.1);
            assert!(!show.surface.is_stopped());
        },
    );
}

#[test]
fn faults_of_a_device_are_seen() {
    let trembling = Knob {
        calibration: Some(KnobCalibration {
            noise: 3,
            ..KnobCalibration::assumed(1023)
        }),
        ..Knob::new(0, "")
    };
    let settings = SurfaceSettings {
        failsafe: Failsafe {
            silence_us: Some(500_000),
            flood_per_second: 1000,
            ..Failsafe::default()
        },
        ..SurfaceSettings::default()
    };
    with_surface(&[trembling], &[binding(0, 0)], &[], None, settings, |show| {
        for _ in 0..3100 {
            show.event(at(0, 0.5));
            show.frame();
        }
        assert_eq!(
            show.surface.status().health,
            Health {
                frozen: true,
                ..Health::default()
            }
        );
        show.event(at(0, 0.501));
        show.frame();
        assert_eq!(show.surface.status().health, Health::default());
        show.seconds(0.6);
        let health = show.surface.status().health;
        assert!(health.lost && health.silent);
        show.event(at(0, 0.5));
        assert_eq!(show.surface.status().health, Health::default());
        for _ in 0..1001 {
            show.event(at(0, 0.5));
        }
        show.frame();
        assert!(show.surface.status().health.flooding);
        show.event(at(77, 0.5));
        let impossible = Reading::Position {
            value: 9,
            full_scale: 8,
        };
        show.event(KnobEvent {
            knob: 0,
            reading: impossible,
        });
        let status = show.surface.status();
        assert_eq!((status.unlisted, status.invalid, status.losses), (1, 1, 1));
        assert_eq!(status.events, 3100 + 2 + 1001 + 2);
    });
}

#[test]
fn a_weight_that_somebody_else_moved_is_taken_up_where_it_is() {
    let even = Response {
        centre: Centre::Even,
        ..Response::default()
    };
    let own = Binding {
        response: even,
        ..binding(0, 0)
    };
    with_surface(&knobs(1), &[own], &[], None, SurfaceSettings::default(), |show| {
        show.event(at(0, 0.4));
        show.frame();
        show.event(at(0, 0.9));
        show.seconds(0.5);
        show.controls.set(0, -0.5).unwrap();
        show.event(at(0, 0.8));
        show.seconds(0.5);
        assert_eq!(show.weight(0), -0.5);
        show.event(at(0, 0.1));
        show.seconds(0.5);
        assert!(show.weight(0) < -0.7);
    });
}

#[test]
fn validity() {
    let (package, other) = (Package::small(1), Package::small(2));
    let (basis, foreign) = (open(&package), open(&other));
    let (knobs, bindings) = (knobs(2), [binding(0, 0)]);
    let map = ControlMap::new(basis, &knobs, &bindings, &[], None).unwrap();
    let required = SurfaceLayout {
        knob_count: 2,
        slot_count: 1,
        control_count: 5,
    };
    for (knob_count, slot_count, control_count) in [(1, 1, 5), (2, 0, 5), (2, 1, 4)] {
        let actual = SurfaceLayout {
            knob_count,
            slot_count,
            control_count,
        };
        let memory = SurfaceMemory {
            knobs: &mut vec![KnobState::default(); knob_count],
            slots: &mut vec![SlotState::default(); slot_count],
            left: &mut vec![0.0; control_count],
        };
        let made = ControlSurface::new(map, SurfaceSettings::default(), memory);
        assert_eq!(made.unwrap_err(), SurfaceError::TooSmall { required, actual });
    }
    let mut buffers = SurfaceBuffers::for_map(&map);
    let mut surface = ControlSurface::new(map, SurfaceSettings::default(), buffers.memory()).unwrap();
    let mut weights = [0.0; Package::COMPONENTS];
    let mut controls = Controls::new(&foreign, &mut weights).unwrap();
    assert_eq!(surface.advance(0, &mut controls), Err(SurfaceError::ForeignControls));
}
