//! One picture of a performance: a line a knob, then pages, rates, warnings and keys.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use sinew_knobs::TakeoverState;

use super::words;
use crate::count::count;
use crate::snapshot::{Labels, Snapshot};

const NAME: usize = 14;
const BAR: usize = 20;
const COMPONENT: usize = 14;

const KEYS: &str =
    "q quit   space stop/release   \u{2190} \u{2192} pages   \u{2193} into   \u{2191} out   f fine   r record   0 rest";

/// Draws a moment.
pub fn draw(frame: &mut Frame<'_>, labels: &Labels, snapshot: &Snapshot) {
    let area = frame.area();
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let dim = Style::new().fg(Color::DarkGray);
    let mut lines = vec![Line::styled(labels.title.clone(), bold)];
    lines.push(match &snapshot.device {
        Some(device) => Line::raw(words::device(device)),
        None => Line::raw("no device"),
    });
    lines.push(Line::raw(""));
    let heading = format!(
        "{:NAME$} {:BAR$} {:COMPONENT$} {:>8}",
        "knob", "", "component", "weight"
    );
    lines.push(Line::styled(heading, dim));
    knobs(&mut lines, labels, snapshot);

    let mut foot = vec![Line::raw("")];
    let page = words::page(labels, snapshot);
    if !page.is_empty() {
        foot.push(Line::raw(page));
    }
    foot.push(Line::raw(rates(snapshot)));
    if let Some(recording) = &snapshot.recording {
        let text = format!("recording {}, {}", recording.file, count(recording.frames, "frame"));
        foot.push(Line::styled(text, Style::new().fg(Color::Red)));
    }
    for warning in words::warnings(snapshot) {
        foot.push(Line::styled(warning, Style::new().fg(Color::Yellow)));
    }
    foot.push(Line::styled(KEYS, dim));

    // In a low terminal knobs go first: what is wrong must be seen.
    let foot_height = (foot.len() as u16).min(area.height);
    let head_height = (lines.len() as u16).min(area.height - foot_height);
    let head = Rect {
        height: head_height,
        ..area
    };
    frame.render_widget(Paragraph::new(lines), head);
    let below = Rect {
        y: area.y + head_height,
        height: foot_height,
        ..area
    };
    frame.render_widget(Paragraph::new(foot), below);
}

fn knobs(lines: &mut Vec<Line<'static>>, labels: &Labels, snapshot: &Snapshot) {
    for (knob, name) in labels.knobs.iter().enumerate() {
        let position = snapshot.positions.get(knob).copied().flatten();
        let mut own = snapshot
            .assignments
            .iter()
            .filter(|assignment| assignment.knob == knob)
            .peekable();
        let left = |first: bool| {
            let (name, bar) = if first {
                (fit(name, NAME), bar(position))
            } else {
                (fit("", NAME), " ".repeat(BAR))
            };
            format!("{name} {bar} ")
        };
        if own.peek().is_none() {
            let state = words::state(TakeoverState::Unassigned);
            lines.push(Line::raw(format!("{}{state}", left(true))));
        }
        for (n, assignment) in own.enumerate() {
            let component = labels
                .components
                .get(assignment.control)
                .map_or("?", |component| component.name.as_str());
            let weight = snapshot.weights.get(assignment.control).copied().unwrap_or(0.0);
            let color = match assignment.state {
                TakeoverState::Engaged => Color::Green,
                TakeoverState::Waiting { .. } => Color::Cyan,
                _ => Color::DarkGray,
            };
            let text = format!("{}{} {weight:>8.3}  ", left(n == 0), fit(component, COMPONENT));
            lines.push(Line::from(vec![
                Span::raw(text),
                Span::styled(words::state(assignment.state), Style::new().fg(color)),
            ]));
        }
    }
}

fn rates(snapshot: &Snapshot) -> String {
    let mut text = format!(
        "{:.1} frames/s, frame {:.2} ms (longest {:.2})",
        snapshot.fps,
        snapshot.frame_us * 1e-3,
        snapshot.frame_us_max as f64 * 1e-3
    );
    if snapshot.missed > 0 {
        text.push_str(&format!(", {} left out", snapshot.missed));
    }
    if let Some(age_us) = snapshot.age_us() {
        text.push_str(&format!(
            ", {:.0} readings/s, newest {} old",
            snapshot.event_rate,
            words::age(age_us)
        ));
    }
    text
}

/// A text cut or padded to a width.
fn fit(text: &str, width: usize) -> String {
    let cut: String = text.chars().take(width).collect();
    format!("{cut:width$}")
}

fn bar(position: Option<f32>) -> String {
    let Some(position) = position else {
        return format!("{:BAR$}", "-");
    };
    let cells = BAR - 2;
    let full = (position.clamp(0.0, 1.0) * cells as f32).round() as usize;
    format!("[{}{}]", "=".repeat(full), " ".repeat(cells - full))
}

#[cfg(test)]
mod tests;
