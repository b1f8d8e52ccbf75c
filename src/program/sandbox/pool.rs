//! The pool of sandboxed processes for decoders written in C or C++. On a server, they are started ahead and
//! wait for a file; on a command line, one is started when a file needs it. Each decodes one file and ends, and on
//! a server another takes its place.

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::os::fd::{AsFd as _, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, memfd_create};

use super::ARGUMENT;
use super::confine::Layers;
use super::message::{OrderHeader, receive_ready, send_order};
use meshsnap_render::import::isolate::{Isolation, IsolationError, Order};
use meshsnap_render::limits::Deadline;

/// Time between two looks at the job's deadline while a process decodes.
const POLL: Duration = Duration::from_millis(10);
/// Most time for a process to start. It takes a few milliseconds.
const START_TIME_MAX: Duration = Duration::from_secs(10);
/// Most time without a byte of the answer, for a command line, whose jobs have no deadline. The processor time that a
/// process may take is less.
const WALL_TIME_MAX: Duration = Duration::from_secs(600);
/// Bytes that an answer may have at least: errors are short, whatever memory is left.
const ANSWER_BYTES_MIN: u64 = 1 << 20;

/// Processes that wait for files.
pub struct Pool {
    spares: Arc<Mutex<Vec<Process>>>,
    /// Ends processes that are done with and starts others; None: they are started when needed.
    keeper: Option<Sender<Process>>,
}

/// A process that is ready.
struct Process {
    child: Child,
    socket: UnixStream,
    layers: Layers,
    meter: Meter,
}

/// The memory of a process that is its own, as the kernel counts it.
struct Meter {
    process: u32,
    /// Bytes of the program, before it knows a file.
    begins_with: u64,
}

impl Meter {
    fn new(process: u32) -> Self {
        let mut meter = Self { process, begins_with: 0 };
        meter.begins_with = meter.bytes();
        meter
    }

    /// Bytes now, beside those of the program. What cannot be read counts as nothing.
    fn bytes(&self) -> u64 {
        let text = std::fs::read_to_string(format!("/proc/{}/statm", self.process)).unwrap_or_default();
        // All of it, what is resident, and what of that belongs to files and is shared.
        let pages: Vec<u64> = text.split_whitespace().take(3).filter_map(|pages| pages.parse().ok()).collect();
        let own = if let [_, resident, shared] = pages[..] { resident.saturating_sub(shared) } else { 0 };
        (own * rustix::param::page_size() as u64).saturating_sub(self.begins_with)
    }

    /// Has the job borrow what the process takes now, and `beside` bytes for it in this one.
    fn hold(&self, order: &Order<'_>, beside: u64) -> Result<(), IsolationError> {
        (order.lend)(self.bytes().saturating_add(beside)).map_err(IsolationError::TooLarge)
    }
}

impl Pool {
    /// A pool that starts a process for each file, when it comes.
    pub fn cold() -> Self {
        Self { spares: Arc::default(), keeper: None }
    }

    /// A pool in which `count` processes are ready ahead. Returns what the kernel refuses them.
    pub fn warm(count: usize) -> io::Result<(Self, Layers)> {
        let first = Process::start()?;
        let layers = first.layers;
        let spares = Arc::new(Mutex::new(vec![first]));
        let (keeper, done) = channel::<Process>();
        let kept = spares.clone();
        std::thread::Builder::new().name("sandbox".into()).spawn(move || {
            let fill = || {
                while lock(&kept).len() < count {
                    // A machine without room for a process may have some later: the next job tries again.
                    let Ok(process) = Process::start() else { break };
                    lock(&kept).push(process);
                }
            };
            fill();
            for mut process in done {
                process.end();
                fill();
            }
        })?;
        Ok((Self { spares, keeper: Some(keeper) }, layers))
    }

    fn take(&self) -> io::Result<Process> {
        let spare = lock(&self.spares).pop();
        spare.map_or_else(Process::start, Ok)
    }

    /// Gets rid of a process and has another started, away from the job if there is a thread for it.
    fn discard(&self, mut process: Process) {
        match &self.keeper {
            Some(keeper) => drop(keeper.send(process)),
            None => drop(process.end()),
        }
    }
}

impl Isolation for Pool {
    fn decode(&self, order: &Order<'_>, deadline: &Deadline) -> Result<Vec<u8>, IsolationError> {
        deadline.check()?;
        let ours = |error: io::Error| {
            tracing::error!(%error, "no process for a decoder");
            IsolationError::Crashed("the process that reads files of this format could not be started".into())
        };
        let mut process = self.take().map_err(ours)?;
        let answer = process.ask(order, deadline);
        if let Err(IsolationError::TooLarge(_)) = &answer {
            let _ = process.child.kill();
        }
        if let Err(IsolationError::Crashed(_)) = &answer {
            // Its end says more than the silence on the socket.
            let why = reason(process.end());
            tracing::warn!(why, "a decoder crashed");
            self.discard(process);
            let detail = format!("the decoder of this format {why}, on data that is most likely broken");
            return Err(IsolationError::Crashed(detail));
        }
        self.discard(process);
        answer
    }
}

impl Process {
    /// Starts one and waits until it is confined.
    fn start() -> io::Result<Self> {
        let (mut socket, theirs) = UnixStream::pair()?;
        let mut command = Command::new("/proc/self/exe");
        command.arg0("meshsnap").arg(ARGUMENT).env_clear();
        // Tests make decoders fail there, too.
        #[cfg(debug_assertions)]
        command.envs(std::env::vars_os().filter(|(name, _)| name == "MESHSNAP_TEST_PANIC_IN"));
        command.stdin(OwnedFd::from(theirs)).stdout(Stdio::null()).stderr(Stdio::null());
        let child = command.current_dir("/").spawn()?;
        socket.set_read_timeout(Some(START_TIME_MAX))?;
        let (meter, layers) = (Meter::new(child.id()), Layers { has_landlock: false, has_seccomp: false });
        let mut process = Self { child, socket: socket.try_clone()?, layers, meter };
        match receive_ready(&mut socket) {
            Ok(layers) => {
                process.layers = layers;
                process.meter = Meter::new(process.child.id());
            }
            Err(error) => {
                process.end();
                return Err(error);
            }
        }
        Ok(process)
    }

    /// Hands it an order and waits for the answer.
    fn ask(&mut self, order: &Order<'_>, deadline: &Deadline) -> Result<Vec<u8>, IsolationError> {
        let silent = |_: io::Error| IsolationError::Crashed(String::new());
        // The file is there twice from now on: here, and where it is read.
        let file_bytes = order.file.len() as u64;
        self.meter.hold(order, file_bytes)?;
        let file = sealed(order.file).map_err(silent)?;
        let header = OrderHeader { head_bytes: order.head.len() as u64, file_bytes, memory_bytes: order.memory_bytes };
        send_order(&self.socket, header, file.as_fd()).map_err(silent)?;
        self.socket.write_all(order.head).map_err(silent)?;
        self.socket.set_read_timeout(Some(POLL)).map_err(silent)?;
        let length: [u8; 8] =
            self.read(8, order, deadline)?.try_into().map_err(|_| IsolationError::Crashed(String::new()))?;
        let length = u64::from_le_bytes(length);
        if length > order.memory_bytes.max(ANSWER_BYTES_MIN) {
            return Err(IsolationError::Crashed(String::new()));
        }
        self.read(length, order, deadline)
    }

    /// Reads so many bytes. What a process says of its length is not believed: memory grows with what has come.
    fn read(&mut self, length: u64, order: &Order<'_>, deadline: &Deadline) -> Result<Vec<u8>, IsolationError> {
        let (mut all, mut chunk) = (Vec::new(), vec![0; 256 << 10]);
        let began = std::time::Instant::now();
        while (all.len() as u64) < length {
            let left = (length - all.len() as u64).min(chunk.len() as u64) as usize;
            match self.socket.read(&mut chunk[..left]) {
                Ok(0) => return Err(IsolationError::Crashed(String::new())),
                Ok(count) => all.extend_from_slice(&chunk[..count]),
                Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => {
                    self.meter.hold(order, (order.file.len() + all.len()) as u64)?;
                    if began.elapsed() > WALL_TIME_MAX {
                        return Err(IsolationError::Crashed(String::new()));
                    }
                }
                Err(_) => return Err(IsolationError::Crashed(String::new())),
            }
            if let Err(stopped) = deadline.check() {
                return Err(stopped.into());
            }
        }
        Ok(all)
    }

    /// Ends it, if it has not ended by itself.
    fn end(&mut self) -> Option<ExitStatus> {
        if let Ok(Some(status)) = self.child.try_wait() {
            return Some(status);
        }
        // A process that crashed closes its socket a moment before it has ended.
        let _ = self.socket.shutdown(std::net::Shutdown::Both);
        for _ in 0..20 {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let _ = self.child.kill();
        self.child.wait().ok()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A file in memory that nobody can change any more.
fn sealed(bytes: &[u8]) -> io::Result<OwnedFd> {
    let file = memfd_create("mesh", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
    let mut file = File::from(file);
    file.write_all(bytes)?;
    io::Seek::rewind(&mut file)?;
    fcntl_add_seals(&file, SealFlags::SEAL | SealFlags::SHRINK | SealFlags::GROW | SealFlags::WRITE)?;
    Ok(file.into())
}

/// What the end of a process says about it.
fn reason(status: Option<ExitStatus>) -> &'static str {
    match status.and_then(|status| status.signal()) {
        Some(libc::SIGXCPU) => "took too long",
        Some(libc::SIGKILL) => "took too long, or too much memory",
        Some(libc::SIGSYS) => "tried what it may not do",
        _ => "crashed, or took too much memory",
    }
}

fn lock(spares: &Mutex<Vec<Process>>) -> std::sync::MutexGuard<'_, Vec<Process>> {
    spares.lock().unwrap_or_else(PoisonError::into_inner)
}
