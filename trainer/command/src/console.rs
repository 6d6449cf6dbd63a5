//! What the user sees while a command works: bars with time left, notices, and Ctrl-C.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sinew_trainer::learn::Reporter;

/// How long a stage may take to stop by itself where what is kept stands on the disk already.
const PATIENCE: Duration = Duration::from_millis(800);

/// One bar at a time on standard error; nothing when quiet.
pub struct Console {
    quiet: bool,
    bar: Mutex<ProgressBar>,
    stop: Arc<AtomicBool>,
    /// Whether a stage runs: between stages files are written, and those are to be whole.
    runs: Arc<AtomicBool>,
}

impl Console {
    /// A console that draws only if it may.
    pub fn new(quiet: bool) -> Self {
        Self {
            quiet,
            bar: Mutex::new(ProgressBar::hidden()),
            stop: Arc::new(AtomicBool::new(false)),
            runs: Arc::new(AtomicBool::new(false)),
        }
    }

    /// From now on the first Ctrl-C (or SIGTERM) asks the running stage to stop; a second one ends the program at once.
    pub fn catch_interrupts(&self) {
        self.catch(None);
    }

    /// The same for work that keeps on the disk what is worth keeping: a stage that has not stopped within a second is left as it is, and
    /// the program ends with `farewell`.
    pub fn catch_interrupts_at_once(&self, farewell: &str) {
        self.catch(Some(farewell.to_owned()));
    }

    fn catch(&self, farewell: Option<String>) {
        let (stop, runs) = (Arc::clone(&self.stop), Arc::clone(&self.runs));
        // A handler can be set once in a process, and this is the only place that does.
        let _ = ctrlc::set_handler(move || {
            if stop.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            let (farewell, runs) = (farewell.clone(), Arc::clone(&runs));
            thread::spawn(move || {
                thread::sleep(PATIENCE);
                if let Some(farewell) = farewell
                    && runs.load(Ordering::SeqCst)
                {
                    eprintln!("\n{farewell}");
                    std::process::exit(130);
                }
            });
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
        self.runs.store(false, Ordering::SeqCst);
        self.bar().finish_and_clear();
    }

    fn bar(&self) -> std::sync::MutexGuard<'_, ProgressBar> {
        self.bar.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Reporter for Console {
    fn stage(&self, name: &str, total: u64) {
        self.runs.store(true, Ordering::SeqCst);
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
