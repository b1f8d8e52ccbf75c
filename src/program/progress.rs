//! A spinner for long work, and a bar for the work on many files, shown on terminals only.

use std::io::IsTerminal as _;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget};

/// Time until the spinner appears.
const DELAY: Duration = Duration::from_millis(500);
/// Time between two frames of the spinner.
const TICK: Duration = Duration::from_millis(100);

/// Shows the current step until it is dropped.
pub struct Progress {
    shown: Option<(Sender<&'static str>, JoinHandle<()>)>,
}

impl Progress {
    /// Starts with the first step; nothing is shown yet.
    pub fn start(first: &'static str) -> Self {
        if !std::io::stderr().is_terminal() {
            return Self { shown: None };
        }
        let (steps, received) = channel::<&'static str>();
        let thread = std::thread::spawn(move || {
            let mut step = first;
            let mut bar: Option<ProgressBar> = None;
            loop {
                match received.recv_timeout(if bar.is_some() { TICK } else { DELAY }) {
                    Ok(next) => step = next,
                    Err(RecvTimeoutError::Timeout) => bar.get_or_insert_with(ProgressBar::new_spinner).tick(),
                    Err(RecvTimeoutError::Disconnected) => break,
                }
                if let Some(bar) = &bar {
                    bar.set_message(step);
                }
            }
            if let Some(bar) = bar {
                bar.finish_and_clear();
            }
        });
        Self { shown: Some((steps, thread)) }
    }

    /// Begins the next step.
    pub fn next(&self, step: &'static str) {
        if let Some((steps, _)) = &self.shown {
            // Cannot fail: the thread receives until `steps` is dropped.
            let _ = steps.send(step);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some((steps, thread)) = self.shown.take() {
            drop(steps);
            let _ = thread.join();
        }
    }
}

/// A bar that fills as files are done. It hides while lines are printed.
pub struct Bar(ProgressBar);

impl Bar {
    /// Starts it for so many files; nothing is shown for one alone, and nothing where standard error is no terminal.
    pub fn start(count: u64) -> Self {
        let is_shown = count > 1 && std::io::stderr().is_terminal();
        let target = if is_shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        Self(ProgressBar::with_draw_target(Some(count), target))
    }

    /// A file is done.
    pub fn advance(&self) {
        self.0.inc(1);
    }

    /// Hides it while `print` runs.
    pub fn suspend<R>(&self, print: impl FnOnce() -> R) -> R {
        if self.0.is_hidden() { print() } else { self.0.suspend(print) }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
