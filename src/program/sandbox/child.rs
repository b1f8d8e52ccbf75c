//! The code that a process of the sandbox runs: it gives up its rights, decodes one file, sends the result back, and
//! ends. A process of the sandbox is one in which a decoder written in C or C++ reads a file that may be hostile.

use std::fs::File;
use std::io::{self, Read as _};
use std::os::fd::{AsFd as _, OwnedFd};
use std::os::unix::net::UnixStream;
use std::process::ExitCode;

use super::confine;
use super::message::{receive_order, send_answer, send_ready};

/// Decodes a file, given what to know beside it. Never fails: errors are answers too.
pub type Decoder = fn(&[u8], &[u8]) -> Vec<u8>;

/// Runs the process. Its socket is standard input.
pub fn run(decode: Decoder) -> ExitCode {
    match serve_once(decode) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::from(3),
    }
}

fn serve_once(decode: Decoder) -> io::Result<()> {
    let socket: OwnedFd = io::stdin().as_fd().try_clone_to_owned()?;
    let mut socket = UnixStream::from(socket);
    let mapped_bytes = confine::mapped_bytes();
    let layers = confine::confine()?;
    send_ready(&mut socket, layers)?;
    let Some((header, file)) = receive_order(socket.as_fd())? else { return Ok(()) };
    let all = header.head_bytes.saturating_add(header.file_bytes);
    confine::bound(header.file_bytes, mapped_bytes, header.memory_bytes.saturating_add(all))?;

    let mut head = vec![0; usize::try_from(header.head_bytes).map_err(io::Error::other)?];
    socket.read_exact(&mut head)?;
    let mut bytes = vec![0; usize::try_from(header.file_bytes).map_err(io::Error::other)?];
    File::from(file).read_exact(&mut bytes)?;
    #[cfg(debug_assertions)]
    misbehave::if_asked(&bytes);
    send_answer(&mut socket, &decode(&head, &bytes))
}

/// Stands in for exploits, in tests: a file asks for what an attacker would try.
#[cfg(debug_assertions)]
mod misbehave {
    use std::hint::black_box;

    pub(super) fn if_asked(bytes: &[u8]) {
        let Some(at) = bytes.windows(MARK.len()).position(|part| part == MARK) else { return };
        let asked = &bytes[at + MARK.len()..];
        let is = |what: &[u8]| asked.starts_with(what);
        if is(b"abort") {
            std::process::abort();
        } else if is(b"loop") {
            loop {
                black_box(());
            }
        } else if is(b"allocate") {
            let mut all = Vec::new();
            loop {
                all.push(black_box(vec![1_u8; 1 << 20]));
            }
        } else if is(b"open") {
            let _ = black_box(std::fs::File::open("/etc/hostname"));
        } else if is(b"write") {
            let _ = black_box(std::fs::write("/tmp/meshsnap-was-here", "x"));
        } else if is(b"connect") {
            let _ = black_box(std::net::TcpStream::connect("127.0.0.1:9"));
        } else if is(b"run") {
            let _ = black_box(std::process::Command::new("true").status());
        }
    }

    /// What such a file has in it.
    const MARK: &[u8] = b"meshsnap-test-misbehave:";
}
