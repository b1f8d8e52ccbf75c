//! A request's body, lent to its handler and taken back afterwards.
//!
//! A handler that refuses early (a full queue, a bad key) leaves the body unread. What a client has sent must then be
//! read and thrown away before the connection can carry its next request; and where that is too much, the client must be
//! told that the connection closes, or its next request would fail for no fault of its own.

use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::{Body, BodyDataStream, Bytes};
use axum::http::{HeaderMap, header};
use futures_util::{Stream, StreamExt as _};

/// What is read and thrown away for the sake of keeping a connection: as much as fits the sockets' buffers or so.
const DISCARD_BYTES_MAX: usize = 1 << 20;
const DISCARD_TIME_MAX: Duration = Duration::from_millis(250);

/// A handle to a body that others hold too.
#[derive(Clone)]
pub struct Lent(Arc<Mutex<Inner>>);

struct Inner {
    body: BodyDataStream,
    /// Whether the end was seen, or an error, after which there is nothing to read either.
    ended: bool,
    /// Whether a byte was asked for; from then on the client has been told to go on sending.
    begun: bool,
}

impl Lent {
    /// Takes a body, and makes one that reads from it.
    pub fn new(body: Body) -> (Self, Body) {
        let inner = Inner { body: body.into_data_stream(), ended: false, begun: false };
        let lent = Self(Arc::new(Mutex::new(inner)));
        (lent.clone(), Body::from_stream(lent))
    }

    /// Reads and drops what is left, if that is little. Whether the connection can carry another request.
    pub async fn discard(mut self, headers: &HeaderMap) -> bool {
        let (ended, begun) = {
            let inner = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            (inner.ended, inner.begun)
        };
        if ended {
            return true;
        }
        // This client waits for a word before it sends: reading would be the word.
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

impl Stream for Lent {
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
