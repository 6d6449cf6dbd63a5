//! A show recorded, replayed, cut, damaged and played on another package.

mod hostile;

use std::string::String;
use std::vec;
use std::vec::Vec;

use super::*;
use crate::fixture::Noise;
use crate::fixture::{Package, open};
use crate::surface::SurfaceBuffers;
use crate::*;
use sinew_runtime::Controls;

/// Whole numbers from noise.
struct Dice(Noise);

impl Dice {
    fn throw(&mut self, sides: u32) -> u32 {
        (((self.0.next() + 1.0) / 2.0 * sides as f32) as u32).min(sides - 1)
    }
}

/// Records of a map that uses everything a map can say.
struct Rig {
    knobs: Vec<Knob<'static>>,
    bindings: Vec<Binding>,
    buttons: Vec<Button>,
    tree: TreePages,
    settings: SurfaceSettings,
}

impl Rig {
    fn new() -> Self {
        let mut knobs: Vec<Knob<'static>> = (0..7)
            .map(|n| Knob::new(20 * n, ["left", "right", ""][n as usize % 3]))
            .collect();
        knobs[0].calibration = Some(KnobCalibration {
            full_scale: 1023,
            lowest: 4,
            highest: 1000,
            centre: Some(480),
            noise: 2,
        });
        knobs[1].smoothing.speed_gain = 3.0;
        knobs[2].step = 0.05;
        let response = Response {
            minimum: Some(-0.5),
            maximum: Some(1.25),
            inverted: true,
            centre: Centre::Even,
            curve: Curve::SCurve { steepness: 2.0 },
            slew: Some(2.0),
        };
        let first = Binding {
            knob: 0,
            page: OnPage::Only(1),
            control: 0,
            response,
            takeover: Takeover::Scale,
        };
        let second = Binding {
            knob: 1,
            control: 4,
            takeover: Takeover::Relative,
            ..Binding::default()
        };
        let button = |address, command| Button { address, command };
        let buttons = vec![
            button(1000, Command::Stop),
            button(1001, Command::Next),
            button(1002, Command::Focus(1)),
            button(1003, Command::Page(1)),
            button(1004, Command::Into),
            button(1005, Command::Out),
        ];
        Self {
            knobs,
            bindings: vec![first, second],
            buttons,
            tree: TreePages {
                first_knob: 2,
                coarse_knobs: 2,
                fine_knobs: 3,
                takeover: Takeover::Jump,
                ..TreePages::default()
            },
            settings: SurfaceSettings {
                failsafe: Failsafe {
                    ease_after_us: Some(200_000),
                    ease_us: 400_000,
                    silence_us: Some(900_000),
                    ..Failsafe::default()
                },
                spike_guard: true,
            },
        }
    }

    fn map<'m>(&'m self, basis: sinew_runtime::Basis<'m>) -> ControlMap<'m> {
        ControlMap::new(basis, &self.knobs, &self.bindings, &self.buttons, Some(self.tree)).unwrap()
    }
}

/// Runs a new surface of a map with new controls.
fn with_surface<T>(
    map: ControlMap<'_>,
    settings: SurfaceSettings,
    body: impl FnOnce(&mut ControlSurface<'_>, &mut Controls<'_>) -> T,
) -> T {
    let mut buffers = SurfaceBuffers::for_map(&map);
    let mut weights = [0.0; Package::COMPONENTS];
    let basis = *map.basis();
    let mut surface = ControlSurface::new(map, settings, buffers.memory()).unwrap();
    let mut controls = Controls::new(&basis, &mut weights).unwrap();
    body(&mut surface, &mut controls)
}

fn any_source_event(dice: &mut Dice) -> SourceEvent {
    let knob = match dice.throw(12) {
        0 => 1000 + dice.throw(7) as u16,
        1 => dice.throw(65_536) as u16,
        _ => 20 * dice.throw(7) as u16,
    };
    let reading = match dice.throw(8) {
        0 => Reading::Steps(dice.throw(9) as i16 - 4),
        1 => Reading::Position {
            value: dice.throw(128) as u16,
            full_scale: 127,
        },
        _ => Reading::Position {
            value: dice.throw(1024) as u16,
            full_scale: 1023,
        },
    };
    match dice.throw(60) {
        0 => SourceEvent::Unplugged,
        1 => SourceEvent::Replugged,
        _ => SourceEvent::Knob(KnobEvent { knob, reading }),
    }
}

fn any_command(dice: &mut Dice) -> Command {
    let argument = dice.throw(6) as u16;
    let commands = [
        Command::Stop,
        Command::Release,
        Command::Next,
        Command::Previous,
        Command::Into,
        Command::Out,
        Command::NextFine,
        Command::Focus(argument),
        Command::Page(argument),
    ];
    commands[dice.throw(9) as usize]
}

/// Bits of every frame's weights.
type Frames = Vec<(u64, [u32; Package::COMPONENTS])>;

fn bits(weights: &[f32]) -> [u32; Package::COMPONENTS] {
    core::array::from_fn(|k| weights[k].to_bits())
}

/// Plays a random show and records it. Returns the take, what every frame looked like, and every record.
fn show(rig: &Rig, seed: u64, frames: usize, buffer_bytes: usize, finish: bool) -> (Vec<u8>, Frames, Vec<Stamped>) {
    let package = Package::small(1);
    let map = rig.map(open(&package));
    let mut dice = Dice(Noise::new(seed));
    let (mut bytes, mut live, mut records) = (Vec::new(), Vec::new(), Vec::new());
    let mut buffer = vec![0; buffer_bytes];
    let mut writer = TakeWriter::new("box 7", &map, &rig.settings, &mut buffer, |chunk| {
        bytes.extend_from_slice(chunk)
    })
    .unwrap();
    with_surface(map, rig.settings, |surface, controls| {
        controls.set(3, 0.5).unwrap();
        writer.weights(1_000_000, controls.weights());
        let (at_us, control, weight) = (1_000_000, 3, 0.5);
        records.push(Stamped {
            at_us,
            record: Record::Weight { control, weight },
        });
        let mut now_us = 1_000_000;
        for _ in 0..frames {
            now_us += 10_000 + u64::from(dice.throw(10_000));
            let mut note = |at_us, record| {
                writer.record(at_us, record);
                records.push(Stamped { at_us, record });
            };
            for _ in 0..dice.throw(5) {
                // Sources stamp events up to a frame back, and not in order.
                let at_us = now_us - u64::from(dice.throw(12_000));
                let event = any_source_event(&mut dice);
                note(at_us, Record::Source(event));
                surface.source_event(at_us, event);
            }
            if dice.throw(9) == 0 {
                let command = any_command(&mut dice);
                note(now_us, Record::Command(command));
                surface.command(command);
            }
            if dice.throw(30) == 0 {
                let (control, weight) = (dice.throw(5) as u16, dice.0.next());
                note(now_us, Record::Weight { control, weight });
                controls.set_unclamped(control.into(), weight).unwrap();
            }
            note(now_us, Record::Frame);
            surface.advance(now_us, controls).unwrap();
            live.push((now_us, bits(controls.weights())));
        }
    });
    if finish {
        writer.finish();
    }
    (bytes, live, records)
}

#[test]
fn a_replay_gives_the_live_weights_to_the_bit() {
    let rig = Rig::new();
    let mut moved = 0;
    for seed in 0..12 {
        let (bytes, live, records) = show(&rig, seed, 500, [WRITER_BYTES_MIN, 300, 4096][seed as usize % 3], true);
        let take = Take::open(&bytes).unwrap();
        assert!(take.is_closed() && take.lost_bytes() == 0);
        assert!(take.records().eq(records.iter().copied()));
        assert_eq!(take.record_count(), records.len());

        // From nothing but the take and the package.
        let package = Package::small(1);
        let basis = open(&package);
        let knobs: Vec<Knob<'_>> = take.knobs().collect();
        let bindings: Vec<Binding> = take.bindings(&basis).map(Result::unwrap).collect();
        let buttons: Vec<Button> = take.buttons(&basis).map(Result::unwrap).collect();
        let map = ControlMap::new(basis, &knobs, &bindings, &buttons, take.tree()).unwrap();
        let mut again = Frames::new();
        let replayed = with_surface(map, take.settings(), |surface, controls| {
            replay(&take, surface, controls, |at_us, weights| {
                again.push((at_us, bits(weights)))
            })
            .unwrap()
        });
        assert!(again == live, "seed {seed}");
        assert_eq!(replayed.frames, live.len());
        let outside = |r: &&Stamped| matches!(r.record, Record::Command(Command::Focus(k)) if k > 4);
        assert_eq!(replayed.skipped, records.iter().filter(outside).count());
        moved += live.windows(2).filter(|pair| pair[0].1 != pair[1].1).count();
    }
    assert!(moved > 2000, "the shows move the mesh: {moved}");
}

#[test]
fn the_header_comes_back_whole() {
    let rig = Rig::new();
    let (bytes, ..) = show(&rig, 1, 3, 256, true);
    let take = Take::open(&bytes).unwrap();
    let package = Package::small(1);
    let basis = open(&package);
    assert_eq!((take.device(), take.compact_id()), ("box 7", [1; 16]));
    assert_eq!(take.settings(), rig.settings);
    assert!(take.component_names().eq(["c0", "c1", "c2", "c3", "c4"]));
    assert!(take.knobs().eq(rig.knobs.iter().copied()));
    assert!(take.bindings(&basis).eq(rig.bindings.iter().copied().map(Ok)));
    assert!(take.buttons(&basis).eq(rig.buttons.iter().copied().map(Ok)));
    assert_eq!(take.tree(), Some(rig.tree));
}

#[test]
fn a_take_goes_to_a_retrained_package_by_name() {
    let rig = Rig::new();
    let (bytes, _, records) = show(&rig, 5, 300, 1024, true);
    let take = Take::open(&bytes).unwrap();
    let package = Package::retrained(2);
    let basis = open(&package);
    let bindings: Vec<_> = take.bindings(&basis).collect();
    assert_eq!(bindings[0], Err(MissingControl { name: "c0" }));
    assert_eq!(
        bindings[1],
        Ok(Binding {
            control: 1,
            ..rig.bindings[1]
        }),
        "c4 is the second here"
    );
    assert_eq!(take.control_in(&basis, 1), Ok(3));
    assert_eq!(take.control_in(&basis, 77), Err(MissingControl { name: "" }));
    let buttons: Vec<Button> = take.buttons(&basis).map(Result::unwrap).collect();
    assert_eq!(buttons[2].command, Command::Focus(3));

    let bindings: Vec<Binding> = bindings.into_iter().filter_map(Result::ok).collect();
    // The only binding of page 1 is the one that has no component any more.
    let of_page = |button: &Button| matches!(button.command, Command::Page(_));
    let buttons: Vec<Button> = buttons.into_iter().filter(|button| !of_page(button)).collect();
    let knobs: Vec<Knob<'_>> = take.knobs().collect();
    let map = ControlMap::new(basis, &knobs, &bindings, &buttons, take.tree()).unwrap();
    let replayed = with_surface(map, take.settings(), |surface, controls| {
        replay(&take, surface, controls, |_, _| {}).unwrap()
    });
    let lost = |r: &&Stamped| {
        let focus = matches!(r.record, Record::Command(Command::Focus(k)) if k == 0 || k > 4);
        focus || matches!(r.record, Record::Weight { control: 0, .. })
    };
    assert_eq!(replayed.skipped, records.iter().filter(lost).count());
}

#[test]
fn limits_wider_than_a_retrained_component_are_tightened() {
    let mut rig = Rig::new();
    // c4 had [-5, 1.5] and has [-2, 1.5] now.
    rig.bindings[1].response = Response {
        minimum: Some(-4.0),
        maximum: Some(1.0),
        ..Response::default()
    };
    let (bytes, ..) = show(&rig, 1, 3, 256, true);
    let take = Take::open(&bytes).unwrap();
    let package = Package::retrained(2);
    let basis = open(&package);
    let response = take.bindings(&basis).nth(1).unwrap().unwrap().response;
    assert_eq!((response.minimum, response.maximum), (None, Some(1.0)));
    assert!(
        response
            .resolve(basis.component(1).minimum, basis.component(1).maximum)
            .is_ok()
    );
}

#[test]
fn other_frame_times_give_nearly_the_same_weights() {
    let package = Package::small(1);
    let basis = open(&package);
    let knobs = [Knob::new(0, "")];
    let bindings = [Binding::default()];
    let map = ControlMap::new(basis, &knobs, &bindings, &[], None).unwrap();
    let settings = SurfaceSettings::default();
    let mut bytes = Vec::new();
    let mut buffer = [0; 1024];
    let mut writer = TakeWriter::new("", &map, &settings, &mut buffer, |chunk| bytes.extend_from_slice(chunk)).unwrap();
    let mut live = Frames::new();
    with_surface(map, settings, |surface, controls| {
        for n in 0..240_u64 {
            let now_us = n * 12_500;
            let value = (512.0 + 400.0 * libm::sinf(n as f32 / 40.0)) as u16;
            let reading = Reading::Position {
                value,
                full_scale: 1023,
            };
            let event = SourceEvent::Knob(KnobEvent { knob: 0, reading });
            writer.record(now_us, Record::Source(event));
            surface.source_event(now_us, event);
            writer.record(now_us, Record::Frame);
            surface.advance(now_us, controls).unwrap();
            live.push((now_us, bits(controls.weights())));
        }
    });
    writer.finish();
    let take = Take::open(&bytes).unwrap();
    let exported = |frame_us| {
        let mut frames = TakeFrames::new(&take, frame_us);
        with_surface(map, settings, |surface, controls| {
            let mut times = Frames::new();
            while let Some(at_us) = frames.next_frame(surface, controls).unwrap() {
                times.push((at_us, bits(controls.weights())));
            }
            assert_eq!(frames.skipped(), 0);
            times
        })
    };
    assert!(exported(12_500) == live, "at the frames that were played, to the bit");
    let coarse = exported(25_000);
    assert_eq!((coarse.len(), coarse.last().unwrap().0), (121, 3_000_000));
    let weight = |frame: &(u64, [u32; Package::COMPONENTS])| f32::from_bits(frame.1[0]);
    let pairs = coarse.iter().zip(live.iter().step_by(2));
    let largest = pairs.map(|(a, b)| (weight(a) - weight(b)).abs()).fold(0.0, f32::max);
    assert!(largest < 0.05, "{largest}");
    assert!(live.iter().any(|frame| weight(frame) > 1.0));
}

#[test]
fn a_take_is_small() {
    let rig = Rig::new();
    let package = Package::small(1);
    let map = rig.map(open(&package));
    let mut bytes = 0_usize;
    let mut buffer = [0; 4096];
    let mut writer = TakeWriter::new("", &map, &rig.settings, &mut buffer, |chunk| bytes += chunk.len()).unwrap();
    let header = 900;
    // A box of eight ten-bit knobs at 100 lines a second, ten seconds at 60 frames a second.
    for line in 0..1000_u64 {
        for knob in 0..8 {
            let value = 500 + 40 * knob;
            let reading = Reading::Position {
                value,
                full_scale: 1023,
            };
            writer.record(
                line * 10_000 + 37,
                Record::Source(SourceEvent::Knob(KnobEvent { knob, reading })),
            );
        }
        if line % 5 < 3 {
            writer.record(line * 10_000 + 6_000, Record::Frame);
        }
    }
    writer.finish();
    assert!(bytes < header + 1000 * (8 * 3 + 3) + 600 * 4 + 800, "{bytes}");
}

#[test]
fn a_writer_refuses_what_it_cannot_write() {
    let rig = Rig::new();
    let package = Package::small(1);
    let map = rig.map(open(&package));
    let mut small = [0; WRITER_BYTES_MIN - 1];
    let refused = TakeWriter::new("", &map, &rig.settings, &mut small, |_: &[u8]| {
        panic!("nothing is written")
    });
    let expected = TakeError::BufferTooSmall {
        required_bytes: WRITER_BYTES_MIN,
        actual_bytes: WRITER_BYTES_MIN - 1,
    };
    assert_eq!(refused.err(), Some(expected));
    let long: String = "x".repeat(65_536);
    let mut buffer = [0; 64];
    let refused = TakeWriter::new(&long, &map, &rig.settings, &mut buffer, |_: &[u8]| {
        panic!("nothing is written")
    });
    assert_eq!(refused.err(), Some(TakeError::NameTooLong));
}

#[test]
fn the_example_of_the_format_description_is_what_is_written() {
    let rig = Rig::new();
    let package = Package::small(1);
    let map = rig.map(open(&package));
    let mut chunks: Vec<Vec<u8>> = Vec::new();
    let mut buffer = [0; 256];
    let mut writer = TakeWriter::new("", &map, &rig.settings, &mut buffer, |chunk| {
        chunks.push(chunk.to_vec())
    })
    .unwrap();
    let knob = |knob, value| {
        let reading = Reading::Position {
            value,
            full_scale: 1023,
        };
        Record::Source(SourceEvent::Knob(KnobEvent { knob, reading }))
    };
    writer.record(1_000_000, knob(0, 240));
    writer.record(1_000_000, knob(20, 1023));
    writer.record(1_016_667, Record::Frame);
    writer.finish();
    let text: String = chunks
        .last()
        .unwrap()
        .iter()
        .map(|byte| std::format!("{byte:02x} "))
        .collect();
    let description = include_str!("../../../../../docs/take-format.md");
    assert!(description.contains(text.trim_end()), "{text}");
}
