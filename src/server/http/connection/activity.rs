//! The use of a connection: counts its requests that are being answered, and notes the time of the last answer.
//! `accept.rs` closes a connection that is idle for too long. Otherwise a client that answers pings and sends nothing
//! else could keep an HTTP/2 connection until `--connection-age-ms` ends it. It would count towards the limit on open
//! connections, so that others might find none free.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::extract::connect_info::Connected;

/// Fewer bytes than this in one write are no part of an answer: pings, windows, good-byes.
const ANSWER_BYTES_MIN: usize = 64;

/// A connection, as its requests see it.
#[derive(Clone)]
pub struct Client {
    /// The client's address.
    pub address: SocketAddr,
    /// The use of the connection.
    pub activity: Arc<Activity>,
}

/// The use of a connection.
pub struct Activity(Mutex<State>);

struct State {
    requests: usize,
    last: Instant,
}

/// A request that is being answered.
pub struct Busy(Arc<Activity>);

impl Connected<Self> for Client {
    fn connect_info(client: Self) -> Self {
        client
    }
}

impl Activity {
    /// A connection that was opened now.
    pub fn new() -> Arc<Self> {
        Arc::new(Self(Mutex::new(State { requests: 0, last: Instant::now() })))
    }

    /// A request has arrived.
    pub fn begin(self: &Arc<Self>) -> Busy {
        self.lock().requests += 1;
        Busy(self.clone())
    }

    /// So many bytes were sent.
    pub fn sent(&self, bytes: usize) {
        if bytes >= ANSWER_BYTES_MIN {
            self.lock().last = Instant::now();
        }
    }

    /// Returns once the connection was not used for so long.
    pub async fn idle(&self, time: Duration) {
        loop {
            let left = {
                let state = self.lock();
                if state.requests > 0 { time } else { time.saturating_sub(state.last.elapsed()) }
            };
            if left.is_zero() {
                return;
            }
            tokio::time::sleep(left).await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        let mut state = self.0.lock();
        state.requests = state.requests.saturating_sub(1);
        state.last = Instant::now();
    }
}
