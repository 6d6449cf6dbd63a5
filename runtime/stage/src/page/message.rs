//! What stage and page say to each other.
//!
//! To the page, text: `hello` once, `state` when something changed, at most ten times a second; binary: a frame, when a weight or a knob
//! moved. From the page, text: an [`Ask`]. Little-endian, as [`encode_frame`] says.

use serde::Deserialize;
use serde_json::{Value, json};
use sinew_knobs::{Command, Direction, TakeoverState};

use crate::config::COMMANDS;
use crate::snapshot::{Labels, Request, Snapshot};
use crate::view::words;

/// First number of a frame, and of the `hello`: a page of another version says so instead of showing nonsense.
pub const FRAME_VERSION: u32 = 1;

/// A frame: `u32` version, frame, K, N knobs, A assignments; `f32` weights `[K]`; `f32` places of the knobs in `[0, 1]`, NaN where
/// unknown, `[N]`; then for each assignment `u16` knob, `u16` component, `u32` state (0 engaged, 1 turn left, 2 turn right, 3 held, 4
/// not heard), `f32` the weight at which the knob stands, NaN where unknown, `f32` how far it has to turn.
pub fn encode_frame(snapshot: &Snapshot) -> Vec<u8> {
    let (weights, knobs, assignments) = (&snapshot.weights, &snapshot.positions, &snapshot.assignments);
    let mut bytes = Vec::with_capacity(20 + 4 * (weights.len() + knobs.len()) + 16 * assignments.len());
    let counts = [weights.len(), knobs.len(), assignments.len()].map(|count| count as u32);
    // A page looks only whether the number of the frame changed.
    for number in [FRAME_VERSION, snapshot.frames as u32].into_iter().chain(counts) {
        bytes.extend(number.to_le_bytes());
    }
    for weight in weights {
        bytes.extend(weight.to_le_bytes());
    }
    for knob in knobs {
        bytes.extend(knob.unwrap_or(f32::NAN).to_le_bytes());
    }
    for assignment in assignments {
        let (state, distance) = match assignment.state {
            TakeoverState::Engaged => (0_u32, 0.0),
            TakeoverState::Waiting { direction, distance } => match direction {
                Direction::Left => (1, distance),
                Direction::Right => (2, distance),
            },
            TakeoverState::Unheard | TakeoverState::Unassigned => (4, 0.0),
            TakeoverState::Held => (3, 0.0),
        };
        bytes.extend((assignment.knob as u16).to_le_bytes());
        bytes.extend((assignment.control as u16).to_le_bytes());
        bytes.extend(state.to_le_bytes());
        bytes.extend(assignment.knob_weight.unwrap_or(f32::NAN).to_le_bytes());
        bytes.extend(f32::to_le_bytes(distance));
    }
    bytes
}

/// What does not change.
pub fn hello(labels: &Labels, is_replay: bool) -> Value {
    json!({
        "type": "hello",
        "version": FRAME_VERSION,
        "title": labels.title,
        "components": labels.components.iter().map(|component| &component.name).collect::<Vec<_>>(),
        "knobs": labels.knobs,
        "pages": labels.page_count,
        "tree": labels.tree.is_some(),
        "replay": is_replay,
    })
}

/// What changes now and then, in words where people read it.
pub fn state(labels: &Labels, snapshot: &Snapshot, screens: usize) -> Value {
    json!({
        "type": "state",
        "device": snapshot.device.as_ref().map(words::device),
        "warnings": words::warnings(snapshot),
        "where": words::page(labels, snapshot),
        "page": snapshot.page,
        "stopped": snapshot.stopped,
        "recording": snapshot.recording.as_ref().map(|recording| &recording.file),
        "fps": snapshot.fps.round(),
        "missed": snapshot.missed,
        "screens": screens,
    })
}

/// What a page may ask. Not the end of the show: a telephone in a pocket must not have it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Ask {
    /// Weights by component, past the knobs.
    Set {
        /// Pairs of component and weight.
        weights: Vec<(u16, f32)>,
    },
    /// A command to the surface, by its name in `knobs.toml`.
    Command {
        /// Its name.
        name: String,
    },
    /// The knobs of the tree show this component's children.
    Focus {
        /// Its index.
        component: u16,
    },
    /// A page of the bindings, from 0.
    Page {
        /// Its number.
        page: u16,
    },
    /// Stop, or release if stopped.
    StopOrRelease {},
    /// All weights to rest.
    Rest {},
    /// Begin to record, or end it.
    Record {},
}

/// Reads an ask and turns it into requests.
///
/// # Errors
/// What is wrong with it, for the one who wrote the page. Nothing of it is then done.
pub fn read_ask(text: &str, component_count: usize, requests: &mut Vec<Request>) -> Result<(), String> {
    requests.clear();
    let component = |index: u16| {
        if usize::from(index) < component_count {
            Ok(index)
        } else {
            Err(format!("there is no component {index}"))
        }
    };
    match serde_json::from_str(text).map_err(|error| error.to_string())? {
        Ask::Set { weights } => {
            for (index, weight) in weights {
                let control = component(index)?;
                if !weight.is_finite() {
                    return Err(format!("the weight of component {index} must be a finite number"));
                }
                requests.push(Request::Weight { control, weight });
            }
        }
        Ask::Command { name } => {
            let found = COMMANDS.iter().find(|(known, _)| *known == name);
            let (_, command) = found.ok_or_else(|| format!("there is no command `{name}`"))?;
            requests.push(Request::Command(*command));
        }
        Ask::Focus { component: index } => requests.push(Request::Command(Command::Focus(component(index)?))),
        Ask::Page { page } => requests.push(Request::Command(Command::Page(page))),
        Ask::StopOrRelease {} => requests.push(Request::StopOrRelease),
        Ask::Rest {} => requests.push(Request::Rest),
        Ask::Record {} => requests.push(Request::Record),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use sinew_knobs::Assignment;

    use super::*;

    #[test]
    fn asks_become_requests_or_are_refused_whole() {
        let mut requests = Vec::new();
        let mut read = |text: &str| read_ask(text, 3, &mut requests).map(|()| requests.clone());
        let weight = |control, weight| Request::Weight { control, weight };
        assert_eq!(
            read(r#"{"ask":"set","weights":[[0,0.5],[2,-1]]}"#),
            Ok(vec![weight(0, 0.5), weight(2, -1.0)])
        );
        assert_eq!(
            read(r#"{"ask":"command","name":"into"}"#),
            Ok(vec![Request::Command(Command::Into)])
        );
        assert_eq!(
            read(r#"{"ask":"focus","component":1}"#),
            Ok(vec![Request::Command(Command::Focus(1))])
        );
        assert_eq!(read(r#"{"ask":"stop-or-release"}"#), Ok(vec![Request::StopOrRelease]));
        for wrong in [
            "",
            "{}",
            "[",
            r#"{"ask":"quit"}"#,
            r#"{"ask":"rest","now":true}"#,
            r#"{"ask":"set","weights":[[0,0.5],[3,0]]}"#,
            r#"{"ask":"set","weights":[[0,1e39]]}"#,
            r#"{"ask":"set","weights":[[-1,0]]}"#,
            r#"{"ask":"command","name":"explode"}"#,
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_frame_holds_weights_knobs_and_what_waits() {
        let snapshot = Snapshot {
            frames: 7,
            weights: vec![0.5, -1.0],
            positions: vec![Some(0.25), None],
            assignments: vec![Assignment {
                knob: 0,
                control: 1,
                state: TakeoverState::Waiting {
                    direction: Direction::Right,
                    distance: 0.5,
                },
                knob_weight: Some(0.75),
            }],
            ..Snapshot::default()
        };
        let bytes = encode_frame(&snapshot);
        let number = |n: usize| u32::from_le_bytes(bytes[4 * n..][..4].try_into().unwrap());
        let float = |n: usize| f32::from_bits(number(n));
        assert_eq!([0, 1, 2, 3, 4].map(number), [FRAME_VERSION, 7, 2, 2, 1]);
        assert_eq!([5, 6, 7].map(float), [0.5, -1.0, 0.25]);
        assert!(float(8).is_nan());
        assert_eq!([9, 10].map(number), [1 << 16, 2]);
        assert_eq!([11, 12].map(float), [0.75, 0.5]);
        assert_eq!(bytes.len(), 13 * 4);
    }
}
