//! A request body that can be read on after its handler has stopped reading.
//!
//! A handler that refuses early (a full queue, a bad query) leaves the body unread. The rest must be read and thrown
//! away before the connection can carry its next request. Where the rest is too long or too slow for that, or the
//! client waits for `100 Continue` before it sends anything, the answer must announce that the connection closes:
//! otherwise the client's next request would fail.

use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::{Body, BodyDataStream, Bytes};
use axum::http::{HeaderMap, header};
use futures_util::{Stream, StreamExt as _};

/// Most bytes that are thrown away to keep a connection: about what the sockets' buffers hold.
const DISCARD_BYTES_MAX: usize = 1 << 20;

/// Longest time for the same.
const DISCARD_TIME_MAX: Duration = Duration::from_millis(250);

/// A shared handle to a request body.
#[derive(Clone)]
pub struct DrainableBody(Arc<Mutex<Inner>>);

struct Inner {
    body: BodyDataStream,
    /// The end or an error was seen. Neither leaves anything to read.
    ended: bool,
    /// Reading has begun, so that a client that waits for `100 Continue` has got it.
    begun: bool,
}

impl DrainableBody {
    /// Wraps a body. The second value is the body that the handler reads.
    pub fn new(body: Body) -> (Self, Body) {
        let inner = Inner { body: body.into_data_stream(), ended: false, begun: false };
        let drainable = Self(Arc::new(Mutex::new(inner)));
        (drainable.clone(), Body::from_stream(drainable))
    }

    /// Reads the rest and throws it away, if it is short. True if the connection can carry another
    /// request.
    pub async fn drain(mut self, headers: &HeaderMap) -> bool {
        let (ended, begun) = {
            let inner = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            (inner.ended, inner.begun)
        };
        if ended {
            return true;
        }
        // The client waits for `100 Continue`, and reading would send it.
        if headers.contains_key(header::EXPECT) && !begun {
            return false;
        }
        let reading = async {
            let mut left = DISCARD_BYTES_MAX;
            while let Some(chunk) = self.next().await {
                let length = chunk.map_or(usize::MAX, |bytes| bytes.len());
                match left.checked_sub(length) {
                    Some(less) => left = less,
                    None => return false,
                }
            }
            true
        };
        tokio::time::timeout(DISCARD_TIME_MAX, reading).await.unwrap_or(false)
    }
}

impl Stream for DrainableBody {
    type Item = Result<Bytes, axum::Error>;

    fn poll_next(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let mut inner = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if inner.ended {
            return Poll::Ready(None);
        }
        inner.begun = true;
        let chunk = ready!(inner.body.poll_next_unpin(cx));
        inner.ended = !matches!(chunk, Some(Ok(_)));
        Poll::Ready(chunk)
    }
}
