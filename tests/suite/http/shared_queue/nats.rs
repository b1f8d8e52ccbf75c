//! A NATS server on this machine, which can be killed and started again.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // clippy knows tests, but not their helpers

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::support::server::PATIENCE;
use crate::support::skip::{Need, skip};

/// The name of the queue of tests.
pub const NAME: &str = "farm";

/// A running NATS server with JetStream.
pub struct Nats {
    program: PathBuf,
    options: Vec<String>,
    folder: TempDir,
    port: u16,
    child: Child,
}

/// The versions that are tried: that of the system, and that of `target/python`.
pub fn programs() -> Vec<PathBuf> {
    let installed = [PathBuf::from("nats-server"), PathBuf::from("/usr/sbin/nats-server")].into_iter().find(runs);
    let later = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/python/bin/nats-server");
    installed.into_iter().chain(Some(later).filter(runs)).collect()
}

fn runs(program: &PathBuf) -> bool {
    let answer = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    answer.is_ok_and(|status| status.success())
}

impl Nats {
    /// The oldest version that is there. None, and the test counts as skipped, where there is none.
    pub fn start() -> Option<Self> {
        Self::start_with(&["-js"])
    }

    /// As [`Nats::start`], with these options.
    pub fn start_with(options: &[&str]) -> Option<Self> {
        match programs().into_iter().next() {
            Some(program) => Some(Self::of(program, options)),
            None => {
                skip(Need::Nats, "nats-server");
                None
            }
        }
    }

    /// A server of this program.
    pub fn of(program: PathBuf, options: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        // A port that is free now: the server gets it again when it is started again.
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let options: Vec<String> = options.iter().map(|&option| option.to_owned()).collect();
        let child = run(&program, &options, &folder, port);
        let nats = Self { program, options, folder, port, child };
        nats.wait();
        nats
    }

    /// The address for `--queue`.
    pub fn address(&self) -> String {
        format!("nats://127.0.0.1:{}/{NAME}", self.port)
    }

    /// Ends it at once.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Starts it again, with what it has stored.
    pub fn start_again(&mut self) {
        self.child = run(&self.program, &self.options, &self.folder, self.port);
        self.wait();
    }

    /// Deletes a stream with all its messages.
    pub fn delete_stream(&self, name: &str) {
        let mut stream = BufReader::new(self.connect().unwrap());
        let request = format!("$JS.API.STREAM.DELETE.{name}");
        let commands = format!("CONNECT {{\"verbose\":false}}\r\nSUB answers 1\r\nPUB {request} answers 0\r\n\r\n");
        stream.get_mut().write_all(commands.as_bytes()).unwrap();
        let mut lines = stream.lines().map(Result::unwrap);
        let answer = lines.find(|line| line.starts_with('{')).unwrap();
        assert!(answer.contains("\"success\":true"), "{answer}");
    }

    /// Sends a message of this text.
    pub fn publish(&self, subject: &str, text: &[u8]) {
        let mut stream = BufReader::new(self.connect().unwrap());
        let head = format!("CONNECT {{\"verbose\":false}}\r\nPUB {subject} {}\r\n", text.len());
        stream.get_mut().write_all(&[head.as_bytes(), text, b"\r\nPING\r\n"].concat()).unwrap();
        assert!(stream.lines().map(Result::unwrap).any(|line| line == "PONG"));
    }

    fn connect(&self) -> std::io::Result<TcpStream> {
        let stream = TcpStream::connect(SocketAddr::from(([127, 0, 0, 1], self.port)))?;
        stream.set_read_timeout(Some(PATIENCE))?;
        Ok(stream)
    }

    fn wait(&self) {
        let began = Instant::now();
        while self.connect().is_err() {
            assert!(began.elapsed() < PATIENCE, "nats-server does not start");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Nats {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn run(program: &PathBuf, options: &[String], folder: &TempDir, port: u16) -> Child {
    let mut command = Command::new(program);
    command.args(["-a", "127.0.0.1", "-p", &port.to_string(), "-sd"]).arg(folder.path()).args(options);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}
