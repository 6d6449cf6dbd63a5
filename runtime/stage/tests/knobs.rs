//! Performances with a simulated box on a pseudo-terminal: it moves the mesh, is recorded, unplugged, watched, measured and
//! assigned.
#![cfg(all(unix, feature = "serial"))]

mod common;

use core::time::Duration;
use std::io::Write;

use common::{Ran, Stage, table};
use sinew_simulator::{BoxSettings, Dialect, KnobBox, Port, Running, Script, Simulator};

fn simulate(stage: &Stage, dialect: Dialect, script: &str) -> Running {
    let settings = BoxSettings {
        dialect,
        ..BoxSettings::default()
    };
    let port = Port::open(stage.path("box")).unwrap();
    let mut simulator = Simulator::new(KnobBox::new(settings).unwrap(), port);
    simulator.run_script(Script::parse(script).unwrap());
    simulator.spawn()
}

/// A hand that turns the first two knobs to and fro, for ever, through the places where their components rest: whenever a program begins
/// to listen, they are soon picked up.
const HANDS: &str = "turn 0 0.3 1.0 300ms\nturn 1 0.7 0.2 300ms\nwait 350ms\nturn 0 1.0 0.3 300ms\nturn 1 0.2 0.7 300ms\nwait 350ms\nrepeat";

/// Weights of a component in a replayed take.
fn replayed(stage: &Stage, live: &Ran, component: usize) -> Vec<f32> {
    let replay = stage
        .run("play model.sinew --headless --replay show.take --export w.csv", "")
        .expect(0);
    assert_eq!(replay.after("replayed "), live.after("take show.take: "));
    table(&stage.path("w.csv"))
        .iter()
        .map(|row| row[1 + component])
        .collect()
}

#[test]
fn a_box_plugged_in_moves_the_coarse_components_and_is_recorded_to_the_bit() {
    for dialect in [Dialect::Deej, Dialect::Packets] {
        let stage = Stage::new();
        let _box = simulate(&stage, dialect, HANDS);
        let line = "play model.sinew --serial box --headless --for 3s --record show.take";
        let live = stage.run(line, "").expect(0).says(&["box: 8 knobs heard"]);
        for component in [0, 1] {
            let weights = replayed(&stage, &live, component);
            let (low, high) = weights
                .iter()
                .fold((0.0_f32, 0.0_f32), |(low, high), &w| (low.min(w), high.max(w)));
            assert!(
                high - low > 0.1,
                "{}: c{component} went from {low} to {high}",
                dialect.name()
            );
        }
        let weights = replayed(&stage, &live, 2);
        assert!(weights.iter().all(|&w| w == 0.0), "nobody turned the third");
    }
}

#[test]
fn a_cable_that_is_pulled_is_said_and_the_show_goes_on() {
    let stage = Stage::new();
    let knobs = "[device]\nserial = \"box\"\n[failsafe]\nease_after_s = 0.2\nease_s = 0.3\n";
    stage.write("knobs.toml", knobs);
    // A process of its own: commands started from this one would hold the box's end of the cable open as well.
    stage.write("hands.txt", HANDS);
    let mut simulator = stage.start("knobs simulate --path box --script hands.txt --for 6s");
    std::thread::sleep(Duration::from_millis(200));
    let child = stage.start("play model.sinew --knobs knobs.toml --headless --for 3s --record show.take");
    // Somewhere in the performance; listening takes half a second.
    std::thread::sleep(Duration::from_millis(1700));
    let mut commands = simulator.stdin.take().unwrap();
    writeln!(commands, "unplug 1s").unwrap();
    let live = Ran::new("play", child.wait_with_output().unwrap()).expect(0);
    let live = live.says(&[
        "warning: unplugged: holding, then easing to rest",
        "unplugged 1 time, back 1 time",
    ]);
    simulator.kill().unwrap();
    simulator.wait().unwrap();
    let weights = replayed(&stage, &live, 0);
    let largest = weights.iter().fold(0.0_f32, |largest, w| largest.max(w.abs()));
    let jump = weights
        .windows(2)
        .fold(0.0_f32, |jump, pair| jump.max((pair[1] - pair[0]).abs()));
    assert!(largest > 0.1, "it moved: {largest}");
    assert!(jump < 0.5 * largest, "and never jumped: {jump} of {largest}");
    assert!(
        weights.windows(6).any(|frames| frames == [0.0; 6]),
        "it came to rest while the cable was out"
    );
}

#[test]
fn what_is_calibrated_is_found_again_and_used() {
    let stage = Stage::new();
    // A converter that the knob uses only the middle of.
    let turn = "turn 0 0.5 0.1 400ms\nwait 900ms\nturn 0 0.1 0.9 500ms\nwait 1s\nturn 0 0.9 0.3 300ms";
    let simulated = simulate(&stage, Dialect::Deej, turn);
    let ran = stage.run("knobs calibrate --serial box --for 4s", "").expect(0);
    let ran = ran.says(&[
        "knob 1: it was not turned; turn it from stop to stop",
        "1 knob of serial box measured",
    ]);
    assert!(ran.err.contains(".config/sinew/calibration.toml") || cfg!(target_os = "macos"));
    let text = std::fs::read_to_string(ran.after("written to ")).unwrap();
    let number = |key: &str| -> u32 {
        let line = text.lines().find_map(|line| line.strip_prefix(&format!("{key} = ")));
        line.unwrap().parse().unwrap()
    };
    assert!(
        (90..=120).contains(&number("lowest")) && (900..=940).contains(&number("highest")),
        "{text}"
    );
    simulated.run_script(Script::parse("turn 0 0.5 0.9 400ms").unwrap());
    let line = "play model.sinew --serial box --headless --for 1s --record show.take";
    stage
        .run(line, "")
        .expect(0)
        .says(&["serial box: 8 knobs heard, calibrated"]);
}

#[test]
fn knobs_turned_in_order_are_assigned_in_order() {
    let stage = Stage::new();
    let turns = "wait 1200ms\nturn 3 0.5 0.9 300ms\nwait 500ms\nturn 1 0.5 0.1 300ms\nwait 500ms\nturn 3 0.9 0.5 300ms";
    let _box = simulate(&stage, Dialect::Labels, turns);
    let ran = stage
        .run(
            "knobs learn model.sinew --serial box --auto --for 3500ms -o knobs.toml",
            "",
        )
        .expect(0);
    ran.says(&["knob3 moves c0", "knob1 moves c1", "2 knobs written to knobs.toml"]);
    let text = std::fs::read_to_string(stage.path("knobs.toml")).unwrap();
    assert!(text.contains("[device]\nserial = \"box\"\n"), "{text}");
    assert!(
        text.ends_with(
            "[[knob]]\nknob = \"knob3\"\ncomponent = \"c0\"\n\n[[knob]]\nknob = \"knob1\"\ncomponent = \"c1\"\n"
        ),
        "{text}"
    );
    stage
        .run("knobs learn model.sinew --serial box --auto -o knobs.toml", "")
        .expect(2)
        .says(&["is there already"]);
    // And what was learned plays.
    let _box = simulate(
        &stage,
        Dialect::Labels,
        "turn 3 0.3 1.0 300ms\nwait 350ms\nturn 3 1.0 0.3 300ms\nwait 350ms\nrepeat",
    );
    let live = stage
        .run(
            "play model.sinew --knobs knobs.toml --headless --for 3s --record show.take",
            "",
        )
        .expect(0);
    let weights = replayed(&stage, &live, 0);
    assert!(weights.iter().any(|w| w.abs() > 0.1), "knob3 moves c0");
}

#[test]
fn the_monitor_says_what_comes_and_how_much_of_it_is_bad() {
    let stage = Stage::new();
    let _box = simulate(&stage, Dialect::Packets, "wait 500ms\ngarbage 300\nwait 100ms\nrepeat");
    let ran = stage.run("knobs monitor --serial box --for 2500ms", "").expect(0);
    let text = String::from_utf8(ran.out).unwrap();
    assert!(text.contains("framed packets, ") && text.contains("% sure"), "{text}");
    assert!(
        text.contains("the last fault: a frame") || text.contains("the last fault: the "),
        "{text}"
    );
    assert!(text.contains(" of 4095 "), "{text}");
}

#[test]
fn the_simulator_is_a_command_too() {
    let stage = Stage::new();
    let mut child = stage.start("knobs simulate --path box --for 2500ms --speak csv --count 3");
    writeln!(child.stdin.take().unwrap(), "noise 1\nfly\n").unwrap();
    std::thread::sleep(Duration::from_millis(300));
    let monitor = stage.run("knobs monitor --serial box --for 1200ms", "").expect(0);
    assert!(String::from_utf8(monitor.out).unwrap().contains("knob 2 "));
    let ran = Ran::new("knobs simulate", child.wait_with_output().unwrap()).expect(0);
    ran.says(&[
        "a box with 3 knobs that speaks csv is at box",
        "there is no command fly",
        "bytes sent",
    ]);
    stage
        .run("knobs simulate --count 99", "")
        .expect(2)
        .says(&["1 to 64 knobs, not 99"]);
    stage.write("bad.txt", "noise 1\njump 4\n");
    stage
        .run("knobs simulate --script bad.txt", "")
        .expect(2)
        .says(&["bad.txt: line 2, column 1: there is no command jump"]);
    let list = stage.run("knobs list", "").expect(0);
    assert!(String::from_utf8(list.out).unwrap().contains("OSC: --osc PORT"));
}
