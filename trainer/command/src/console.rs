//! What the user sees while a command works: bars with time left, notices, and Ctrl-C.

use core::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sinew_trainer::learn::Reporter;

/// One bar at a time on standard error; nothing when quiet.
pub struct Console {
    quiet: bool,
    bar: Mutex<ProgressBar>,
    stop: Arc<AtomicBool>,
}

impl Console {
    /// A console that draws only if it may.
    pub fn new(quiet: bool) -> Self {
        Self {
            quiet,
            bar: Mutex::new(ProgressBar::hidden()),
            stop: Arc::new(AtomicBool::new(false)),
        }
    }

    /// From now on the first Ctrl-C (or SIGTERM) asks the running stage to stop; a second one ends the program at once.
    pub fn catch_interrupts(&self) {
        let stop = Arc::clone(&self.stop);
        // A handler can be set once in a process, and this is the only place that does.
        let _ = ctrlc::set_handler(move || {
            if stop.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
    }

    /// One line that stays, on standard error.
    pub fn say(&self, text: &str) {
        if !self.quiet {
            self.bar().suspend(|| eprintln!("{text}"));
        }
    }

    /// Takes the last bar away.
    pub fn finish(&self) {
        self.bar().finish_and_clear();
    }

    fn bar(&self) -> std::sync::MutexGuard<'_, ProgressBar> {
        self.bar.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Reporter for Console {
    fn stage(&self, name: &str, total: u64) {
        let mut bar = self.bar();
        bar.finish_and_clear();
        if !self.quiet {
            let next = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
            let style = ProgressStyle::with_template(
                "{prefix:<26} {bar:28} {pos}/{len}  {elapsed} gone, {eta} left  {wide_msg}",
            );
            next.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            next.set_prefix(name.to_owned());
            *bar = next;
        }
    }

    fn advance(&self, done: u64, note: &str) {
        let bar = self.bar();
        bar.set_position(done);
        if !note.is_empty() {
            bar.set_message(note.to_owned());
        }
    }

    fn notice(&self, text: &str) {
        self.say(text);
    }

    fn stop_requested(&self) -> bool {
        self.stop.load(Ordering::SeqCst)
    }
}
