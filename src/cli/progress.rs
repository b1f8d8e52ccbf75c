//! A spinner for long work, on a terminal only.

use std::io::IsTerminal as _;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use indicatif::ProgressBar;

/// Work that takes less shows nothing.
const PATIENCE: Duration = Duration::from_millis(500);
const TICK: Duration = Duration::from_millis(100);

/// Shows what is being done until it is dropped.
pub struct Progress {
    shown: Option<(Sender<&'static str>, JoinHandle<()>)>,
}

impl Progress {
    /// Starts to wait; nothing is shown yet.
    pub fn start(first: &'static str) -> Self {
        if !std::io::stderr().is_terminal() {
            return Self { shown: None };
        }
        let (tell, news) = channel::<&'static str>();
        let thread = std::thread::spawn(move || {
            let mut doing = first;
            let mut bar: Option<ProgressBar> = None;
            loop {
                match news.recv_timeout(if bar.is_some() { TICK } else { PATIENCE }) {
                    Ok(next) => doing = next,
                    Err(RecvTimeoutError::Timeout) => bar.get_or_insert_with(ProgressBar::new_spinner).tick(),
                    Err(RecvTimeoutError::Disconnected) => break,
                }
                if let Some(bar) = &bar {
                    bar.set_message(doing);
                }
            }
            if let Some(bar) = bar {
                bar.finish_and_clear();
            }
        });
        Self { shown: Some((tell, thread)) }
    }

    /// The next thing that is being done.
    pub fn next(&self, doing: &'static str) {
        if let Some((tell, _)) = &self.shown {
            // The thread only ends when we do.
            let _ = tell.send(doing);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some((tell, thread)) = self.shown.take() {
            drop(tell);
            let _ = thread.join();
        }
    }
}
