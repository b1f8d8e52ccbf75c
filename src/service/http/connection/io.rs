//! A client's socket, with two timeouts that the HTTP libraries lack.
//!
//! 1. A client that stops reading its answer is disconnected after a while.
//! 2. After an answer that came before the upload ended (413), the rest of the upload is read and
//!    thrown away for a moment. Closing at once would reset the connection, and the client would
//!    never see the answer.

use std::future::Future as _;
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Instant, Sleep, sleep};

use super::activity::Activity;

/// Longest time for which a client may read nothing of its answer.
const WRITE_STALL: Duration = Duration::from_secs(30);

/// Time that a closing connection waits for the first byte of a rest.
const LINGER_QUIET: Duration = Duration::from_millis(100);

/// Time that a closing connection reads a rest once it has begun.
const LINGER_BUSY: Duration = Duration::from_secs(2);

/// A client's socket with timeouts.
pub struct ClientStream {
    inner: TcpStream,
    activity: Arc<Activity>,
    timer: Pin<Box<Sleep>>,
    phase: Phase,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Open,
    /// A write waits, and the timer runs.
    Stalled,
    /// The server's side is closed, and the timer runs.
    Lingering {
        has_received: bool,
    },
}

impl ClientStream {
    /// Wraps a socket.
    pub fn new(inner: TcpStream, activity: Arc<Activity>) -> Self {
        Self { inner, activity, timer: Box::pin(sleep(WRITE_STALL)), phase: Phase::Open }
    }

    fn start_timer(&mut self, phase: Phase, wait: Duration) {
        self.phase = phase;
        self.timer.as_mut().reset(Instant::now() + wait);
    }

    fn note(&self, written: &Poll<io::Result<usize>>) {
        if let Poll::Ready(Ok(bytes)) = written {
            self.activity.sent(*bytes);
        }
    }

    /// Passes a write's outcome on, and fails when the client has read nothing for too long.
    fn with_stall_timeout<T>(&mut self, cx: &mut Context<'_>, written: Poll<io::Result<T>>) -> Poll<io::Result<T>> {
        if written.is_ready() {
            self.phase = Phase::Open;
            return written;
        }
        if self.phase != Phase::Stalled {
            self.start_timer(Phase::Stalled, WRITE_STALL);
        }
        ready!(self.timer.as_mut().poll(cx));
        Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, "the client stopped reading")))
    }
}

impl AsyncRead for ClientStream {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_read(cx, buf)
    }
}

impl AsyncWrite for ClientStream {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.inner).poll_write(cx, buf);
        self.note(&written);
        self.with_stall_timeout(cx, written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bufs: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.inner).poll_write_vectored(cx, bufs);
        self.note(&written);
        self.with_stall_timeout(cx, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.inner.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        if !matches!(self.phase, Phase::Lingering { .. }) {
            ready!(Pin::new(&mut self.inner).poll_shutdown(cx))?;
            self.start_timer(Phase::Lingering { has_received: false }, LINGER_QUIET);
        }
        let mut scratch = [0; 16 * 1024];
        // A client that sends without pause must not occupy the thread: a few reads, then a turn
        // for other connections.
        for _ in 0..16 {
            if self.timer.as_mut().poll(cx).is_ready() {
                return Poll::Ready(Ok(()));
            }
            let mut buf = ReadBuf::new(&mut scratch);
            match ready!(Pin::new(&mut self.inner).poll_read(cx, &mut buf)) {
                Ok(()) if !buf.filled().is_empty() => {
                    if self.phase == (Phase::Lingering { has_received: false }) {
                        self.start_timer(Phase::Lingering { has_received: true }, LINGER_BUSY);
                    }
                }
                _ => return Poll::Ready(Ok(())),
            }
        }
        cx.waker().wake_by_ref();
        Poll::Pending
    }
}
