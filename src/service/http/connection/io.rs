//! A client's socket, with the two patience limits that HTTP libraries leave out.
//!
//! A client that stops reading its answer is let go after a while. And after an answer that came before the upload ended
//! (413), the rest of the upload is read and thrown away for a moment: closing at once would reset the connection, and
//! the client would never see the answer.

use std::future::Future as _;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Instant, Sleep, sleep};

/// For how long a client may read nothing of its answer.
const WRITE_STALL: Duration = Duration::from_secs(30);
/// For how long a closing connection waits for the first stray byte, and how long it reads them after that.
const LINGER_QUIET: Duration = Duration::from_millis(100);
const LINGER_BUSY: Duration = Duration::from_secs(2);

/// The socket.
pub struct ClientStream {
    inner: TcpStream,
    timer: Pin<Box<Sleep>>,
    phase: Phase,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Open,
    /// A write waits; the timer runs.
    Stalled,
    /// Our side is closed; the timer runs.
    Lingering {
        heard: bool,
    },
}

impl ClientStream {
    /// Takes a socket.
    pub fn new(inner: TcpStream) -> Self {
        Self { inner, timer: Box::pin(sleep(WRITE_STALL)), phase: Phase::Open }
    }

    fn start_timer(&mut self, phase: Phase, wait: Duration) {
        self.phase = phase;
        self.timer.as_mut().reset(Instant::now() + wait);
    }

    /// Passes a write's outcome on, and watches how long it waits.
    fn patient<T>(&mut self, cx: &mut Context<'_>, written: Poll<io::Result<T>>) -> Poll<io::Result<T>> {
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
        self.patient(cx, written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bufs: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.inner).poll_write_vectored(cx, bufs);
        self.patient(cx, written)
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
            self.start_timer(Phase::Lingering { heard: false }, LINGER_QUIET);
        }
        let mut scratch = [0; 16 * 1024];
        // A client that sends without pause must not keep the thread from others: a few reads, then again later.
        for _ in 0..16 {
            if self.timer.as_mut().poll(cx).is_ready() {
                return Poll::Ready(Ok(()));
            }
            let mut buf = ReadBuf::new(&mut scratch);
            match ready!(Pin::new(&mut self.inner).poll_read(cx, &mut buf)) {
                Ok(()) if !buf.filled().is_empty() => {
                    if self.phase == (Phase::Lingering { heard: false }) {
                        self.start_timer(Phase::Lingering { heard: true }, LINGER_BUSY);
                    }
                }
                _ => return Poll::Ready(Ok(())),
            }
        }
        cx.waker().wake_by_ref();
        Poll::Pending
    }
}
