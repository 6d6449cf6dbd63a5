//! The picture, as text.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use sinew_knobs::device::{DeviceStatus, Link};
use sinew_knobs::protocol::Recognition;
use sinew_knobs::{Assignment, Counters, Direction, Fault, Health, Protocol, SurfaceStatus, TreeView};

use super::*;
use crate::snapshot::{ComponentLabel, Recording};

fn labels() -> Labels {
    let component = |name: &str| ComponentLabel {
        name: name.to_owned(),
        minimum: -1.0,
        maximum: 1.0,
    };
    Labels {
        title: "walk.sinew: 2518 vertices, 3 components".to_owned(),
        knobs: vec!["jaw".to_owned(), "knob 1".to_owned(), "knob 2".to_owned()],
        components: ["c0", "c1", "c0.0"].map(component).to_vec(),
        page_count: 1,
        tree: Some((1, 1)),
    }
}

fn snapshot() -> Snapshot {
    let assignment = |knob, control, state| Assignment {
        knob,
        control,
        state,
        knob_weight: None,
    };
    let waiting = TakeoverState::Waiting {
        direction: Direction::Left,
        distance: 0.34,
    };
    let device = DeviceStatus {
        link: Link::Open,
        baud: Some(9600),
        confidence: 100,
        counters: Counters {
            good: 988,
            bad: 12,
            last_fault: Some(Fault::NotNumbers),
            ..Counters::default()
        },
        ..DeviceStatus::new("/dev/ttyACM0".to_owned(), Recognition::Named(Protocol::Lines))
    };
    Snapshot {
        now_us: 2_000_000,
        positions: vec![Some(0.5), Some(1.0), None],
        assignments: vec![
            assignment(0, 0, TakeoverState::Engaged),
            assignment(0, 1, waiting),
            assignment(1, 2, TakeoverState::Held),
        ],
        weights: vec![0.25, -1.0, 0.0],
        view: TreeView {
            focus: Some(0),
            ..TreeView::default()
        },
        surface: SurfaceStatus {
            last_event_us: Some(1_992_000),
            health: Health {
                lost: true,
                ..Health::default()
            },
            ..SurfaceStatus::default()
        },
        device: Some(device),
        frames: 120,
        fps: 59.9,
        frame_us: 210.0,
        frame_us_max: 480,
        event_rate: 300.0,
        recording: Some(Recording {
            file: "show.take".to_owned(),
            frames: 60,
        }),
        ..Snapshot::default()
    }
}

fn text(width: u16, height: u16, labels: &Labels, snapshot: &Snapshot) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, labels, snapshot)).unwrap();
    let buffer = terminal.backend().buffer();
    let row = |y| {
        (0..width)
            .map(|x| buffer[(x, y)].symbol())
            .collect::<String>()
            .trim_end()
            .to_owned()
    };
    (0..height).map(row).collect()
}

#[test]
fn a_line_a_knob_then_what_matters() {
    let lines = text(100, 16, &labels(), &snapshot());
    let expected = [
        "walk.sinew: 2518 vertices, 3 components",
        "/dev/ttyACM0 at 9600 baud, text lines, as told",
        "",
        "knob                                component        weight",
        "jaw            [=========         ] c0                0.250",
        "                                    c1               -1.000  turn left 34 % to pick up",
        "knob 1         [==================] c0.0              0.000  held",
        "knob 2         -                    moves nothing here",
        "",
        "tree: coarse components, fine knobs: children of c0",
        "59.9 frames/s, frame 0.21 ms (longest 0.48), 300 readings/s, newest 8.0 ms old",
        "recording show.take, 60 frames",
        "unplugged: holding, then easing to rest",
        "12 of 1000 messages refused; the last: a line is not a list of numbers (a debug print?)",
        "q quit   space stop/release   ← → pages   ↓ into   ↑ out   f fine   r record   0 rest",
        "",
    ];
    assert_eq!(lines, expected);
}

#[test]
fn a_low_terminal_keeps_warnings_and_nothing_breaks_in_a_tiny_one() {
    let lines = text(100, 8, &labels(), &snapshot());
    assert!(
        lines.contains(&"unplugged: holding, then easing to rest".to_owned()),
        "{lines:#?}"
    );
    for (width, height) in [(1, 1), (3, 2), (200, 1), (0, 0)] {
        text(width, height, &labels(), &snapshot());
    }
    text(80, 24, &Labels::default(), &Snapshot::default());
}
