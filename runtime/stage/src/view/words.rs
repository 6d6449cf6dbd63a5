//! A snapshot in words: what a knob waits for, what the device is and what is wrong. The same for the terminal view and the
//! status lines.

use sinew_knobs::device::{DeviceStatus, Link};
use sinew_knobs::protocol::Recognition;
use sinew_knobs::{Direction, TakeoverState};

use crate::count::count;
use crate::snapshot::{Labels, Snapshot};

/// What a knob must do, or why it moves nothing; empty while it moves its component.
pub fn state(state: TakeoverState) -> String {
    match state {
        TakeoverState::Engaged => String::new(),
        TakeoverState::Unassigned => "moves nothing here".to_owned(),
        TakeoverState::Unheard => "not heard yet".to_owned(),
        TakeoverState::Held => "held".to_owned(),
        TakeoverState::Waiting { direction, distance } => {
            let way = match direction {
                Direction::Left => "left",
                Direction::Right => "right",
            };
            format!("turn {way} {:.0} % to pick up", (distance * 100.0).max(1.0))
        }
    }
}

/// The device in one line.
pub fn device(status: &DeviceStatus) -> String {
    let mut text = match status.link {
        Link::Waiting => format!("waiting for {}", status.port),
        Link::Open => status.port.clone(),
        Link::Lost => format!("{} is gone", status.port),
    };
    if let (Some(baud), Link::Open) = (status.baud, status.link) {
        text.push_str(&format!(" at {baud} baud"));
    }
    text.push_str(&match status.recognition {
        // How sure it is by all that came, not by the first bytes alone.
        Recognition::Found(finding) => format!(", {}, {} % sure", finding.protocol.words(), status.confidence),
        other => format!(", {other}"),
    });
    if let Some(firmware) = &status.firmware {
        text.push_str(&format!(", firmware {firmware}"));
    }
    text
}

/// Where the knobs are in the pages or the tree.
pub fn page(labels: &Labels, snapshot: &Snapshot) -> String {
    let name = |k: u16| {
        labels
            .components
            .get(usize::from(k))
            .map_or("?", |component| component.name.as_str())
    };
    let mut parts = Vec::new();
    if labels.page_count > 1 {
        parts.push(format!("page {} of {}", snapshot.page + 1, labels.page_count));
    }
    if labels.tree.is_some() {
        let view = snapshot.view;
        parts.push(match view.parent {
            None => "tree: coarse components".to_owned(),
            Some(parent) => format!("tree: children of {}", name(parent)),
        });
        if view.first > 0 {
            parts.push(format!("from number {}", view.first + 1));
        }
        if let Some(focus) = view.focus {
            parts.push(format!("fine knobs: children of {}", name(focus)));
        }
    }
    parts.join(", ")
}

/// Everything that is wrong, most urgent first.
pub fn warnings(snapshot: &Snapshot) -> Vec<String> {
    let mut warnings = Vec::new();
    if snapshot.stopped {
        warnings.push("stopped: everything eases to rest; release to go on".to_owned());
    }
    let health = snapshot.surface.health;
    if health.silent {
        warnings.push("the device is silent: holding, then easing to rest".to_owned());
    } else if health.lost {
        warnings.push("unplugged: holding, then easing to rest".to_owned());
    }
    if health.frozen {
        warnings.push("the device sends, but nothing trembles any more: frozen?".to_owned());
    }
    if health.flooding {
        warnings.push("the device sends more than it should".to_owned());
    }
    if let Some(device) = &snapshot.device {
        if let (Some(error), Link::Waiting | Link::Lost) = (&device.last_error, device.link) {
            // A list of ports has lines of its own; a warning has one.
            warnings.push(error.split_whitespace().collect::<Vec<_>>().join(" "));
        }
        let counters = &device.counters;
        if counters.bad > 0 {
            let reason = counters
                .last_fault
                .map_or(String::new(), |fault| format!("; the last: {fault}"));
            warnings.push(format!(
                "{} of {} messages refused{reason}",
                counters.bad,
                counters.bad + counters.good
            ));
        }
        if counters.clamped > 0 {
            warnings.push(format!(
                "{} beyond their scale: set full_scale",
                count(counters.clamped, "reading")
            ));
        }
    }
    if snapshot.surface.unlisted > 0 {
        warnings.push(format!(
            "{} of knobs that the map has not",
            count(snapshot.surface.unlisted, "reading")
        ));
    }
    if snapshot.stream_dropped > 0 {
        warnings.push(format!(
            "a stream is behind: {} left out",
            count(snapshot.stream_dropped, "frame")
        ));
    }
    warnings.extend(snapshot.trouble.clone());
    warnings
}

/// A moment in one line, without warnings.
pub fn status_line(labels: &Labels, snapshot: &Snapshot) -> String {
    let mut text = format!(
        "{:7.1} s  {:5.1} fps  frame {:.2} ms",
        snapshot.now_us as f64 * 1e-6,
        snapshot.fps,
        snapshot.frame_us * 1e-3
    );
    if let Some(age_us) = snapshot.age_us() {
        text.push_str(&format!("  {:.0} events/s, age {}", snapshot.event_rate, age(age_us)));
    }
    if let Some(recording) = &snapshot.recording {
        text.push_str(&format!("  rec {}", recording.frames));
    }
    let moved = labels
        .components
        .iter()
        .zip(&snapshot.weights)
        .filter(|(_, weight)| **weight != 0.0);
    let shown: Vec<String> = moved
        .clone()
        .take(6)
        .map(|(component, weight)| format!("{}={weight:.3}", component.name))
        .collect();
    if !shown.is_empty() {
        text.push_str(&format!("  {}", shown.join(" ")));
    }
    let more = moved.count().saturating_sub(shown.len());
    if more > 0 {
        text.push_str(&format!(" and {more} more"));
    }
    text
}

/// A time for people.
pub fn age(us: u64) -> String {
    match us {
        0..10_000 => format!("{:.1} ms", us as f64 * 1e-3),
        10_000..1_000_000 => format!("{} ms", us / 1000),
        _ => format!("{:.0} s", us as f64 * 1e-6),
    }
}
