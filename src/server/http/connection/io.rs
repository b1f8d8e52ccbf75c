//! A client's socket, with two timeouts that the HTTP libraries lack.
//!
//! 1. A client is disconnected if in 30 s it reads nothing of the answer that waits for it, or less than
//!    `--least-rate-bytes` asks. Otherwise a client that reads a byte now and then would keep its answer in memory.
//! 2. After an answer that came before the upload ended (such as a 413), the rest of the upload is read and thrown
//!    away for a moment. Closing at once would reset the connection, and the client would never see the answer.

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

/// Longest time for which a client may read nothing of its answer, or less than the least rate gives.
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
    /// The time over which the client's speed is measured.
    window: Duration,
    /// Least bytes that it reads in this time while an answer waits for it.
    least_bytes: u64,
    /// Bytes that it has read since the timer runs.
    window_bytes: u64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Open,
    /// A write waits, and the timer runs.
    Stalled,
    /// The write went on, and the timer runs: the next one may wait again.
    Resumed,
    /// The server's side is closed, and the timer runs.
    Lingering {
        has_received: bool,
    },
}

impl ClientStream {
    /// Wraps a socket.
    pub fn new(inner: TcpStream, activity: Arc<Activity>, least_rate: u64) -> Self {
        Self::with_window(inner, activity, least_rate, WRITE_STALL)
    }

    fn with_window(inner: TcpStream, activity: Arc<Activity>, least_rate: u64, window: Duration) -> Self {
        let least_bytes = (least_rate as f64 * window.as_secs_f64()) as u64;
        let timer = Box::pin(sleep(window));
        Self { inner, activity, timer, window, phase: Phase::Open, least_bytes, window_bytes: 0 }
    }

    fn start_timer(&mut self, phase: Phase, wait: Duration) {
        self.phase = phase;
        self.timer.as_mut().reset(Instant::now() + wait);
    }

    fn note(&mut self, written: &Poll<io::Result<usize>>) {
        if let Poll::Ready(Ok(bytes)) = written {
            self.activity.sent(*bytes);
            self.window_bytes = self.window_bytes.saturating_add(*bytes as u64);
        }
    }

    /// Passes a write's outcome on, and fails when the client has read too little for too long.
    fn with_stall_timeout<T>(&mut self, cx: &mut Context<'_>, written: Poll<io::Result<T>>) -> Poll<io::Result<T>> {
        if written.is_ready() {
            if self.phase == Phase::Stalled {
                self.phase = Phase::Resumed;
            }
            return written;
        }
        // After a time in which nothing waited, the count begins anew.
        let is_new = self.phase == Phase::Open || self.phase == Phase::Resumed && self.timer.is_elapsed();
        if is_new {
            self.begin_window();
        }
        self.phase = Phase::Stalled;
        while self.timer.as_mut().poll(cx).is_ready() {
            if self.window_bytes == 0 || self.window_bytes < self.least_bytes {
                return Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, "the client stopped reading")));
            }
            self.begin_window();
        }
        Poll::Pending
    }

    fn begin_window(&mut self) {
        self.window_bytes = 0;
        self.start_timer(Phase::Stalled, self.window);
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

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::net::TcpListener;

    use super::*;

    /// Sends 64 MiB to a client that reads 64 KiB every 20 ms, about 3 MiB a second, and stops after a while.
    async fn send_slowly(least_rate: u64) -> io::Result<()> {
        let listener = TcpListener::bind("127.0.0.1:0").await?;
        let mut client = TcpStream::connect(listener.local_addr()?).await?;
        let (server, _) = listener.accept().await?;
        let reading = tokio::spawn(async move {
            let mut scratch = vec![0; 64 << 10];
            // Four seconds, four windows; then the rest at once.
            for _ in 0..200 {
                if !client.read(&mut scratch).await.is_ok_and(|bytes| bytes > 0) {
                    return;
                }
                sleep(Duration::from_millis(20)).await;
            }
            while client.read(&mut scratch).await.is_ok_and(|bytes| bytes > 0) {}
        });
        let mut stream = ClientStream::with_window(server, Activity::new(), least_rate, Duration::from_secs(1));
        let chunk = vec![0; 1 << 20];
        for _ in 0..64 {
            stream.write_all(&chunk).await?;
        }
        drop(stream);
        reading.await.map_err(io::Error::other)
    }

    #[tokio::test]
    async fn a_client_that_reads_a_little_now_and_then_is_disconnected() {
        let error = send_slowly(1 << 30).await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
        send_slowly(1024).await.unwrap();
    }
}
