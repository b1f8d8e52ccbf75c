//! Counts the open event streams (`GET /v1/jobs/{id}/events`) of each client, and refuses more than
//! 32 at a time. `close` ends all of them when the server ends, so that the server does not wait
//! for their clients.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::watch;

use super::error::{ApiError, ErrorKind};
use crate::jobs::Owner;

/// Most streams that one client has open.
pub const STREAMS_OF_OWNER_MAX: usize = 32;

/// The event streams that are open.
pub struct EventStreams {
    open: Arc<Mutex<HashMap<Owner, usize>>>,
    closing: watch::Sender<bool>,
}

/// One stream of a client, which counts until this is dropped.
pub struct OpenStream {
    owner: Owner,
    open: Arc<Mutex<HashMap<Owner, usize>>>,
    closing: watch::Receiver<bool>,
}

impl EventStreams {
    /// None is open.
    pub fn new() -> Self {
        Self { open: Arc::default(), closing: watch::Sender::new(false) }
    }

    /// Opens a stream for a client, if it may have one more.
    pub fn open(&self, owner: &Owner) -> Result<OpenStream, ApiError> {
        let mut open = lock(&self.open);
        let count = open.entry(owner.clone()).or_default();
        if *count >= STREAMS_OF_OWNER_MAX {
            let detail = format!(
                "this client has {STREAMS_OF_OWNER_MAX} event streams open, and no more are allowed; close one"
            );
            return Err(ApiError::new(ErrorKind::Busy, "streams_full", detail).retry_after(1));
        }
        *count += 1;
        Ok(OpenStream { owner: owner.clone(), open: self.open.clone(), closing: self.closing.subscribe() })
    }

    /// Ends all streams.
    pub fn close(&self) {
        self.closing.send_replace(true);
    }
}

impl OpenStream {
    /// Returns when all streams end.
    pub async fn closing(&mut self) {
        // An error says that the server is gone.
        let _ = self.closing.wait_for(|&closing| closing).await;
    }
}

impl Drop for OpenStream {
    fn drop(&mut self) {
        let mut open = lock(&self.open);
        if let Some(count) = open.get_mut(&self.owner) {
            *count -= 1;
            if *count == 0 {
                open.remove(&self.owner);
            }
        }
    }
}

fn lock(open: &Mutex<HashMap<Owner, usize>>) -> MutexGuard<'_, HashMap<Owner, usize>> {
    open.lock().unwrap_or_else(PoisonError::into_inner)
}
