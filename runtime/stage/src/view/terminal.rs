//! The terminal: draws fifteen times a second, turns keys into requests, and leaves the terminal as it found it.

use core::time::Duration;
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use crossbeam::channel::Sender;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use sinew_knobs::Command;

use super::draw;
use crate::snapshot::{Board, Labels, Request};

const FRAME: Duration = Duration::from_millis(66);

/// Takes the terminal over, until the board is closed.
///
/// # Errors
/// Standard output is no terminal that can be drawn on, or the system has no thread left.
pub fn start_terminal(
    board: Arc<Board>,
    labels: Labels,
    requests: Sender<Request>,
) -> io::Result<JoinHandle<io::Result<()>>> {
    let mut terminal = ratatui::try_init()?;
    let spawned = thread::Builder::new().name("sinew-view".to_owned()).spawn(move || {
        let mut run = || -> io::Result<()> {
            while !board.is_closed() {
                let snapshot = board.read();
                terminal.draw(|frame| draw(frame, &labels, &snapshot))?;
                if event::poll(FRAME)?
                    && let Event::Key(key) = event::read()?
                    && let Some(request) = request(key)
                {
                    // The loop may have ended just now.
                    let _ = requests.send(request);
                }
            }
            Ok(())
        };
        let outcome = run();
        ratatui::restore();
        // A terminal that fails is no reason to end a show: Ctrl-C, its signals and the page are still there.
        outcome
    });
    if spawned.is_err() {
        ratatui::restore();
    }
    spawned
}

/// What a key asks for.
fn request(key: KeyEvent) -> Option<Request> {
    if key.kind == KeyEventKind::Release {
        return None;
    }
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    Some(match key.code {
        KeyCode::Char('c') if control => Request::Quit,
        // Not Esc: a slow line cuts the code of an arrow key into an Esc and the rest.
        KeyCode::Char('q') => Request::Quit,
        KeyCode::Char(' ') => Request::StopOrRelease,
        KeyCode::Char('r') => Request::Record,
        KeyCode::Char('0') => Request::Rest,
        KeyCode::Char('f') => Request::Command(Command::NextFine),
        KeyCode::Right => Request::Command(Command::Next),
        KeyCode::Left => Request::Command(Command::Previous),
        KeyCode::Down => Request::Command(Command::Into),
        KeyCode::Up => Request::Command(Command::Out),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_ask_for_what_the_view_says_they_do() {
        let press = |code| request(KeyEvent::new(code, KeyModifiers::NONE));
        assert_eq!(press(KeyCode::Char('q')), Some(Request::Quit));
        assert_eq!(press(KeyCode::Char(' ')), Some(Request::StopOrRelease));
        assert_eq!(press(KeyCode::Right), Some(Request::Command(Command::Next)));
        assert_eq!(press(KeyCode::Down), Some(Request::Command(Command::Into)));
        assert_eq!(press(KeyCode::Char('c')), None);
        assert_eq!(press(KeyCode::Esc), None);
        let interrupt = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(request(interrupt), Some(Request::Quit));
        let release = KeyEvent::new_with_kind(KeyCode::Char('q'), KeyModifiers::NONE, KeyEventKind::Release);
        assert_eq!(request(release), None);
    }
}
