//! The signals that the server obeys. SIGTERM and SIGINT (elsewhere than on Unix, Ctrl-C) ask it to end. SIGHUP asks it to
//! read the file of API keys again.

use std::io;

/// The signals, which are counted from the moment when this is made.
pub struct EndSignals {
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
    #[cfg(unix)]
    interrupt: tokio::signal::unix::Signal,
}

impl EndSignals {
    /// Catches SIGTERM and SIGINT; elsewhere than on Unix, Ctrl-C.
    pub fn new() -> io::Result<Self> {
        #[cfg(unix)]
        {
            use tokio::signal::unix::{SignalKind, signal};
            Ok(Self { terminate: signal(SignalKind::terminate())?, interrupt: signal(SignalKind::interrupt())? })
        }
        #[cfg(not(unix))]
        Ok(Self {})
    }

    /// Waits for the next of them.
    pub async fn next(&mut self) {
        #[cfg(unix)]
        tokio::select! {
            _ = self.terminate.recv() => {}
            _ = self.interrupt.recv() => {}
        }
        #[cfg(not(unix))]
        if tokio::signal::ctrl_c().await.is_err() {
            // Without the signal, the server ends when its process does.
            std::future::pending::<()>().await;
        }
    }
}

/// SIGHUP, which does not end the server: a terminal that is closed sends it, and tools that ask for new settings.
pub struct HangUps {
    #[cfg(unix)]
    hang_up: tokio::signal::unix::Signal,
}

impl HangUps {
    /// Catches it.
    pub fn new() -> io::Result<Self> {
        #[cfg(unix)]
        {
            use tokio::signal::unix::{SignalKind, signal};
            Ok(Self { hang_up: signal(SignalKind::hangup())? })
        }
        #[cfg(not(unix))]
        Ok(Self {})
    }

    /// Waits for the next one. False if there will be none.
    pub async fn next(&mut self) -> bool {
        #[cfg(unix)]
        return self.hang_up.recv().await.is_some();
        #[cfg(not(unix))]
        false
    }
}
