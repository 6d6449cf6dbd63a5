//! A hand on a box, the box on a show, and a cable that is pulled while the hand goes on turning: the weight never moves
//! further than its knob did, nor faster than its limit.

use sinew_bake::{bake_bytes, fixture};
use sinew_knobs::{
    Binding, Centre, ControlMap, ControlSurface, Knob, Response, SurfaceBuffers, SurfaceSettings, TakeoverState,
};
use sinew_runtime::{Basis, Controls};

use super::*;

const FRAME: Duration = Duration::from_millis(4);
/// Weight a second.
const SLEW: f32 = 3.0;
/// The knob's stops are reached a little before its ends, so the weight moves a little more than the knob.
const STOPS: f32 = 1.02;
/// Half a step of ten bits at each end of a way.
const ROUNDING: f32 = 2.0 / 1023.0;

#[test]
fn a_cable_pulled_while_the_hand_turns_moves_nothing_by_itself() {
    thread::scope(|scope| {
        for (seed, pull_ms) in [(1, 90), (2, 170), (3, 310), (4, 420)] {
            scope.spawn(move || turn_and_pull(seed, pull_ms));
        }
    });
}

fn turn_and_pull(seed: u64, pull_ms: u32) {
    let bytes = bake_bytes(&fixture::compact(seed, false)).unwrap();
    let basis = Basis::open(&bytes).unwrap();
    let knobs = [Knob::new(0, "jaw")];
    let response = Response {
        centre: Centre::Even,
        slew: Some(SLEW),
        ..Response::default()
    };
    let bindings = [Binding {
        response,
        ..Binding::default()
    }];
    let map = ControlMap::new(basis, &knobs, &bindings, &[], None).unwrap();
    let mut buffers = SurfaceBuffers::for_map(&map);
    let mut weights = vec![0.0; basis.component_count()];
    let mut surface = ControlSurface::new(map, SurfaceSettings::default(), buffers.memory()).unwrap();
    let mut controls = Controls::new(&basis, &mut weights).unwrap();
    let component = basis.component(0);
    let span = component.maximum - component.minimum;

    let mut bench = Bench::new(Dialect::Deej, 1, named(Protocol::Lines));
    // From one end to the other, so that the control is picked up on the way; then the cable, while the hand goes back.
    bench.script(&format!(
        "turn 0 0 1 500ms\nwait 550ms\nturn 0 1 0.1 500ms\nwait {pull_ms}ms\nunplug 120ms\nwait 700ms\nturn 0 0.1 1 500ms"
    ));
    let begun = Instant::now();
    let mut before_us = None;
    // Ways since the knob was last heard of for the first time.
    let (mut knob_way, mut weight_way, mut last_reading) = (0.0f32, 0.0f32, None::<f32>);
    let (mut was_engaged, mut engaged_again) = (false, false);
    while !engaged_again || controls.weights()[0] < component.maximum {
        assert!(
            begun.elapsed() < PATIENCE,
            "{:?} at {:?}: {} of {} to {}",
            surface.takeover(0),
            surface.position(0),
            controls.weights()[0],
            component.minimum,
            component.maximum
        );
        let known = bench.heard.len();
        bench.frame(FRAME);
        let now_us = bench.clock.now_us();
        for event in &bench.heard[known..] {
            surface.source_event(now_us, *event);
            match event {
                SourceEvent::Knob(KnobEvent {
                    reading: Reading::Position { value, full_scale },
                    ..
                }) => {
                    let reading = f32::from(*value) / f32::from(*full_scale);
                    knob_way += last_reading.map_or(0.0, |last| (reading - last).abs());
                    last_reading = Some(reading);
                }
                _ => (knob_way, weight_way, last_reading) = (0.0, 0.0, None),
            }
        }
        let before = controls.weights()[0];
        surface.advance(now_us, &mut controls).unwrap();
        let moved = (controls.weights()[0] - before).abs();
        let dt_s = before_us.map_or(0.0, |before_us| (now_us - before_us) as f32 * 1e-6);
        before_us = Some(now_us);
        assert!(moved <= SLEW * dt_s + 1e-5, "{moved} in {dt_s} s");
        weight_way += moved;
        let most = (knob_way * STOPS + ROUNDING) * span;
        assert!(
            weight_way <= most,
            "the weight went {weight_way} and the knob let it go {most}"
        );
        let state = surface.takeover(0);
        let gone = bench.source.device_status().unplugs > 0;
        if !matches!(state, TakeoverState::Engaged) && gone {
            assert_eq!(moved, 0.0, "{state:?}");
        }
        was_engaged |= state == TakeoverState::Engaged && !gone;
        engaged_again |= state == TakeoverState::Engaged && bench.source.device_status().replugs > 0;
    }
    assert!(was_engaged);
    assert_eq!(bench.links(), [SourceEvent::Unplugged, SourceEvent::Replugged]);
    assert_eq!(surface.status().losses, 1);
}
