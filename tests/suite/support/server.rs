//! Starts the real binary and talks HTTP to it over a plain socket, so that tests can also say what
//! no client library would.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// A guard against hanging: nothing that a test waits for takes longer, even on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A cube of quads.
pub const CUBE_OBJ: &[u8] = b"v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// The binary under test.
pub fn meshsnap() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_meshsnap"));
    // The developer's own settings must not reach a test.
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("MESHSNAP_")) {
        command.env_remove(name);
    }
    // No test writes to the developer's own data folder: one that is to store something names its own.
    command.env("MESHSNAP_EPHEMERAL", "true").env("XDG_DATA_HOME", "/nonexistent").env("HOME", "/nonexistent");
    command
}

/// A running daemon; killed when dropped.
pub struct Server {
    child: Child,
    /// Its address.
    pub address: SocketAddr,
    /// The curl line that it printed.
    pub curl_line: String,
}

impl Server {
    /// Starts `meshsnap serve` on a free port of loopback.
    pub fn start(arguments: &[&str]) -> Self {
        Self::start_with(meshsnap().args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).args(arguments))
    }

    /// Starts a prepared command.
    pub fn start_with(command: &mut Command) -> Self {
        Self::spawn(command.stderr(Stdio::null()))
    }

    /// Starts a prepared command whose log goes to a file.
    pub fn start_logging(command: &mut Command, log: &std::path::Path) -> Self {
        Self::spawn(command.stderr(std::fs::File::create(log).unwrap()))
    }

    fn spawn(command: &mut Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let line = lines.next().expect("the server says where it listens").unwrap();
        let address = line.strip_prefix("listening on http://").expect(&line).parse().unwrap();
        let curl_line = lines.next().expect("the server shows a curl line").unwrap();
        Self { child, address, curl_line }
    }

    /// Sends a request and reads the whole answer.
    pub fn send(&self, head: &str, body: &[u8]) -> Answer {
        let mut stream = self.connect();
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(body).unwrap();
        Answer::read(&mut stream)
    }

    pub fn get(&self, path: &str) -> Answer {
        self.request("GET", path, &[], b"")
    }

    pub fn post(&self, path: &str, body: &[u8]) -> Answer {
        self.request("POST", path, &[], body)
    }

    pub fn request(&self, method: &str, path: &str, headers: &[&str], body: &[u8]) -> Answer {
        let mut head = format!("{method} {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n");
        if !body.is_empty() || method == "POST" {
            head += &format!("Content-Length: {}\r\n", body.len());
        }
        for header in headers {
            head += header;
            head += "\r\n";
        }
        head += "\r\n";
        if method == "HEAD" {
            let mut stream = self.connect();
            stream.write_all(head.as_bytes()).unwrap();
            return Answer::read_header(&mut stream);
        }
        self.send(&head, body)
    }

    /// An open connection.
    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_nodelay(true).unwrap();
        stream
    }

    /// Asks it to end, as a container runtime does.
    pub fn terminate(&self) {
        let status = Command::new("sh").arg("-c").arg(format!("kill -TERM {}", self.child.id())).status().unwrap();
        assert!(status.success());
    }

    /// Ends it at once, as a power cut or the kernel does.
    pub fn kill_9(&self) {
        let status = Command::new("sh").arg("-c").arg(format!("kill -KILL {}", self.child.id())).status().unwrap();
        assert!(status.success());
        let began = Instant::now();
        // Its data folder is free when its last thread is gone. The process stays a zombie until it is waited for, and is
        // one as soon as its first thread has ended.
        let of_process = |name: &str| format!("/proc/{}/{name}", self.child.id());
        let is_zombie = || std::fs::read_to_string(of_process("stat")).is_ok_and(|stat| stat.contains(") Z"));
        let has_one_thread = || std::fs::read_dir(of_process("task")).is_ok_and(|threads| threads.count() == 1);
        while !(is_zombie() && has_one_thread()) {
            assert!(began.elapsed() < PATIENCE, "the server does not die");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Waits for its end.
    pub fn wait(&mut self) -> ExitStatus {
        let began = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(began.elapsed() < PATIENCE, "the server does not end");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Its process id.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Memory that is resident now, bytes.
    pub fn resident_bytes(&self) -> u64 {
        self.status_bytes("VmRSS:")
    }

    /// The most that ever was.
    pub fn peak_bytes(&self) -> u64 {
        self.status_bytes("VmHWM:")
    }

    fn status_bytes(&self, name: &str) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find(|l| l.starts_with(name)).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 1024
    }

    /// Waits until `/v1/capabilities` shows what is wanted.
    pub fn wait_for_load(&self, wanted: impl Fn(&serde_json::Value) -> bool) {
        let began = Instant::now();
        loop {
            let load = self.get("/v1/capabilities").json()["load"].take();
            if wanted(&load) {
                return;
            }
            assert!(began.elapsed() < PATIENCE, "still {load}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// An HTTP answer.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Answer {
    /// Reads one answer; the connection stays open if the server leaves it so.
    pub fn read(stream: &mut TcpStream) -> Self {
        let mut answer = Self::read_header(stream);
        if let Some(length) = answer.header("content-length") {
            let mut body = vec![0; length.parse().unwrap()];
            stream.read_exact(&mut body).unwrap();
            answer.body = body;
        }
        answer
    }

    /// Reads the header alone, which is all that there is of an answer to HEAD.
    pub fn read_header(stream: &mut TcpStream) -> Self {
        let mut bytes = Vec::new();
        let mut byte = [0];
        while !bytes.ends_with(b"\r\n\r\n") {
            // Where a signal interrupts it, this goes on.
            match stream.read_exact(&mut byte) {
                Ok(()) => bytes.push(byte[0]),
                other => panic!("no whole answer, but {:?} and then {other:?}", String::from_utf8_lossy(&bytes)),
            }
        }
        let head = String::from_utf8(bytes).unwrap();
        let mut lines = head.trim_end().lines();
        let status = lines.next().unwrap().split(' ').nth(1).unwrap().parse().unwrap();
        let pair = |line: &str| line.split_once(':').map(|(k, v)| (k.to_ascii_lowercase(), v.trim().to_owned()));
        let headers: Vec<_> = lines.map(|line| pair(line).unwrap()).collect();
        Self { status, headers, body: Vec::new() }
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    pub fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&self.body)))
    }

    /// Checks that this is a problem document with this status and code, and returns its detail.
    #[track_caller]
    pub fn problem(&self, status: u16, code: &str) -> String {
        assert_eq!(self.status, status, "{}", String::from_utf8_lossy(&self.body));
        assert_eq!(self.header("content-type"), Some("application/problem+json"));
        assert_eq!(self.header("cache-control"), Some("no-store"));
        let problem = self.json();
        assert_eq!(problem["code"], code, "{problem}");
        assert_eq!(problem["status"], status);
        assert_eq!(problem["type"], format!("urn:meshsnap:error:{code}"));
        assert!(problem["title"].as_str().is_some_and(|t| !t.is_empty()), "{problem}");
        assert_eq!(problem["request_id"].as_str(), self.header("x-request-id"), "{problem}");
        problem["detail"].as_str().expect("a detail").to_owned()
    }

    /// Checks that this is a picture of this size that is not of one colour, and returns it.
    #[track_caller]
    pub fn picture(&self, width: u32, height: u32) -> image::RgbaImage {
        assert_eq!(self.status, 200, "{}", String::from_utf8_lossy(&self.body));
        let picture = image::load_from_memory(&self.body).unwrap().to_rgba8();
        assert_eq!(picture.dimensions(), (width, height));
        let first = *picture.get_pixel(0, 0);
        assert!(picture.pixels().any(|p| *p != first), "the picture is blank");
        picture
    }
}
