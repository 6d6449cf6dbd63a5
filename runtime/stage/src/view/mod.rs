//! What a performance looks like: a view in a terminal, or a status line a second. Both read snapshots on a thread of their
//! own.

mod draw;
mod terminal;
pub mod words;

use core::time::Duration;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

pub use draw::draw;
pub use terminal::start_terminal;

use crate::snapshot::{Board, Labels};

/// Prints a line a second on standard error, and one whenever something goes wrong or comes right.
///
/// # Errors
/// The system has no thread left.
pub fn start_status_lines(board: Arc<Board>, labels: Labels, quiet: bool) -> std::io::Result<JoinHandle<()>> {
    thread::Builder::new().name("sinew-status".to_owned()).spawn(move || {
        let mut warned: Vec<String> = Vec::new();
        let mut ticks = 0_u32;
        while !board.is_closed() {
            thread::sleep(Duration::from_millis(50));
            ticks += 1;
            let snapshot = board.read();
            let warnings = words::warnings(&snapshot);
            let kinds: Vec<String> = warnings.iter().map(|warning| kind(warning)).collect();
            for (warning, _) in warnings.iter().zip(&kinds).filter(|(_, kind)| !warned.contains(kind)) {
                eprintln!("warning: {warning}");
            }
            if !quiet && warned.iter().any(|old| !kinds.contains(old)) {
                eprintln!("better: {}", words::status_line(&labels, &snapshot).trim_start());
            }
            warned = kinds;
            if !quiet && ticks.is_multiple_of(20) && snapshot.frames > 0 {
                eprintln!("{}", words::status_line(&labels, &snapshot));
            }
        }
    })
}

/// A warning without its numbers: one that only counts on is said once.
fn kind(warning: &str) -> String {
    warning.chars().filter(|c| !c.is_ascii_digit()).collect()
}
