//! What the benchmarks of the server share: they start a server, and send it requests.

// A tool for developers: giving up loudly is fine. Not every benchmark uses all of it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, dead_code)]

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// An answer to a request.
pub struct Answer {
    pub status: u16,
    /// The status line and the headers, in lower case.
    head: String,
    pub body: Vec<u8>,
}

impl Answer {
    /// A header, whose name is given in lower case.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.head.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": ")).map(str::trim)
    }
}

/// Starts a server on the CPU with more arguments. Its address.
pub fn start(more: &[String]) -> (Child, String) {
    start_on("cpu", more)
}

/// Starts a server on a back-end with more arguments. Its address.
pub fn start_on(backend: &str, more: &[String]) -> (Child, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_meshsnap"));
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", backend, "--log", "warn", "--ephemeral"]).args(more);
    let mut child = command.stdout(Stdio::piped()).spawn().expect("the server starts");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("a pipe")).read_line(&mut line).expect("the server says where it is");
    let address = line.trim().rsplit('/').next().unwrap_or_default().to_owned();
    (child, address)
}

/// Sends a request, on the open connection if there is one. The answer's status and body.
pub fn exchange(stream: &mut Option<TcpStream>, address: &str, request: &[u8]) -> std::io::Result<(u16, Vec<u8>)> {
    ask(stream, address, request).map(|answer| (answer.status, answer.body))
}

/// Sends a request, on the open connection if there is one.
pub fn ask(stream: &mut Option<TcpStream>, address: &str, request: &[u8]) -> std::io::Result<Answer> {
    let stream = match stream {
        Some(stream) => stream,
        None => {
            let fresh = TcpStream::connect(address)?;
            fresh.set_nodelay(true)?;
            fresh.set_read_timeout(Some(Duration::from_secs(60)))?;
            stream.insert(fresh)
        }
    };
    stream.write_all(request)?;
    let mut answer = Vec::new();
    let mut chunk = [0; 16 * 1024];
    let (end, head, length) = loop {
        let count = stream.read(&mut chunk)?;
        if count == 0 {
            return Err(std::io::ErrorKind::UnexpectedEof.into());
        }
        answer.extend_from_slice(&chunk[..count]);
        if let Some(end) = answer.windows(4).position(|w| w == b"\r\n\r\n") {
            let head = String::from_utf8_lossy(&answer[..end]).to_ascii_lowercase();
            let length = head.lines().find_map(|l| l.strip_prefix("content-length: ")?.trim().parse::<usize>().ok());
            break (end + 4, head, length.unwrap_or(0));
        }
    };
    let mut rest = vec![0; (end + length).saturating_sub(answer.len())];
    stream.read_exact(&mut rest)?;
    let status = head.split(' ').nth(1).and_then(|status| status.parse().ok());
    let body = [&answer[end..], &rest].concat();
    Ok(Answer { status: status.ok_or(std::io::ErrorKind::InvalidData)?, head, body })
}

/// Resident memory of a process.
pub fn resident_bytes(child: &Child) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = status.lines().find(|l| l.starts_with("VmRSS:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}
