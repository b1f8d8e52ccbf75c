//! A bucket of S3 on this machine: moto's server, from `target/python`, behind a proxy that can be cut.
#![allow(clippy::unwrap_used, clippy::expect_used)] // clippy knows tests, but not their helpers

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::support::skip::{Need, skip};

/// The name of the bucket.
const NAME: &str = "models";

/// Starts a server of S3 with one bucket, says on which port, and serves until its standard input ends.
const SERVER: &str = "
import sys, boto3
from moto.server import ThreadedMotoServer
server = ThreadedMotoServer(ip_address='127.0.0.1', port=0, verbose=False)
server.start()
host, port = server.get_host_and_port()
client = boto3.client('s3', endpoint_url=f'http://{host}:{port}', region_name='us-east-1',
                      aws_access_key_id='key', aws_secret_access_key='secret')
client.create_bucket(Bucket=sys.argv[1])
print(port, flush=True)
sys.stdin.read()
";

/// A running server of S3.
pub struct Bucket {
    server: Child,
    proxy: Arc<Proxy>,
    proxy_address: SocketAddr,
}

/// What stands between the bucket and its clients.
#[derive(Default)]
struct Proxy {
    is_cut: AtomicBool,
    /// Connections that are to break yet, one of four.
    breaks: AtomicU32,
    /// Requests are taken, and no answer comes.
    is_mute: AtomicBool,
    ignores_conditions: AtomicBool,
    delay_ms: AtomicU32,
    connections: AtomicU32,
    streams: Mutex<Vec<TcpStream>>,
}

impl Bucket {
    /// A new bucket. None, and the test counts as skipped, where moto is missing.
    pub fn start() -> Option<Self> {
        Self::start_with(&[])
    }

    /// A new bucket that knows no client's key.
    pub fn start_locked() -> Option<Self> {
        // The bucket itself is made before that.
        Self::start_with(&[("INITIAL_NO_AUTH_ACTION_COUNT", "1")])
    }

    fn start_with(variables: &[(&str, &str)]) -> Option<Self> {
        let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/python/bin/python");
        let has_moto = Command::new(&python)
            .args(["-c", "import moto.server, boto3"])
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|s| s.success());
        if !has_moto {
            skip(Need::Python, "moto in target/python");
            return None;
        }
        let mut command = Command::new(python);
        command
            .args(["-c", SERVER, NAME])
            .envs(variables.iter().copied())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        let mut server = command.spawn().unwrap();
        let port = BufReader::new(server.stdout.take().unwrap()).lines().next().expect("moto starts").unwrap();
        let to = SocketAddr::from(([127, 0, 0, 1], port.parse().unwrap()));
        let proxy = Arc::new(Proxy::default());
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let proxy_address = listener.local_addr().unwrap();
        let shared = proxy.clone();
        std::thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let shared = shared.clone();
                std::thread::spawn(move || _ = shared.pass(&client, to));
            }
        });
        Some(Self { server, proxy, proxy_address })
    }

    /// The address for `--store`.
    pub fn address() -> String {
        format!("s3://{NAME}/team/a")
    }

    /// Gives a command the bucket's endpoint and credentials.
    pub fn introduce(&self, command: &mut Command) {
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("AWS_")) {
            command.env_remove(name);
        }
        command
            .env("AWS_ENDPOINT_URL", format!("http://{}", self.proxy_address))
            .env("AWS_ACCESS_KEY_ID", "key")
            .env("AWS_SECRET_ACCESS_KEY", "secret")
            .env("AWS_REGION", "us-east-1");
    }

    /// Breaks all connections, and each new one, until [`Bucket::mend`].
    pub fn cut(&self) {
        self.proxy.is_cut.store(true, Ordering::SeqCst);
        for stream in self.proxy.streams.lock().unwrap().drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }

    /// Lets connections through again.
    pub fn mend(&self) {
        self.proxy.is_cut.store(false, Ordering::SeqCst);
    }

    /// From now on each piece of an answer comes so much later, and of the next connections one of four breaks, until so many
    /// are broken.
    pub fn hamper(&self, delay: Duration, breaks: u32) {
        self.proxy.delay_ms.store(delay.as_millis() as u32, Ordering::SeqCst);
        self.proxy.breaks.store(breaks, Ordering::SeqCst);
    }

    /// Says nothing more, and keeps all connections open.
    pub fn mute(&self) {
        self.proxy.is_mute.store(true, Ordering::SeqCst);
    }

    /// From now on, writes have no conditions any more.
    pub fn ignore_conditions(&self) {
        self.proxy.ignores_conditions.store(true, Ordering::SeqCst);
    }

    /// Objects of which one byte is another now: those whose names begin with this.
    pub fn damage(&self, prefix: &str) -> usize {
        let names = self.names(prefix);
        for name in &names {
            let mut stream = TcpStream::connect(self.proxy_address).unwrap();
            // moto looks who it is, not at the signature.
            let scope = "Credential=key/20260101/us-east-1/s3/aws4_request, SignedHeaders=host, Signature=none";
            let head = format!("Host: localhost\r\nConnection: close\r\nAuthorization: AWS4-HMAC-SHA256 {scope}\r\n");
            write!(stream, "PUT /{NAME}/{name} HTTP/1.1\r\n{head}Content-Length: 7\r\n\r\ndamaged").unwrap();
            let mut answer = String::new();
            stream.read_to_string(&mut answer).unwrap();
            assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        }
        names.len()
    }

    /// The names of all objects that begin with this, below the bucket.
    pub fn names(&self, prefix: &str) -> Vec<String> {
        let mut stream = TcpStream::connect(self.proxy_address).unwrap();
        let path = format!("/{NAME}?list-type=2&prefix={prefix}");
        write!(stream, "GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        text.split("<Key>").skip(1).map(|part| part.split('<').next().unwrap().to_owned()).collect()
    }
}

impl Drop for Bucket {
    fn drop(&mut self) {
        self.cut();
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

impl Proxy {
    fn pass(&self, client: &TcpStream, to: SocketAddr) -> std::io::Result<()> {
        let number = self.connections.fetch_add(1, Ordering::SeqCst);
        let may_break = |left: u32| left.checked_sub(1);
        let breaks =
            number.is_multiple_of(4) && self.breaks.fetch_update(Ordering::SeqCst, Ordering::SeqCst, may_break).is_ok();
        if self.is_cut.load(Ordering::SeqCst) || breaks {
            return client.shutdown(Shutdown::Both);
        }
        let server = TcpStream::connect(to)?;
        {
            let mut streams = self.streams.lock().unwrap();
            streams.extend([client.try_clone()?, server.try_clone()?]);
        }
        if self.is_cut.load(Ordering::SeqCst) {
            client.shutdown(Shutdown::Both)?;
        }
        std::thread::scope(|scope| {
            scope.spawn(|| self.copy(client, &server, 0, true));
            self.copy(&server, client, self.delay_ms.load(Ordering::SeqCst), false);
        });
        Ok(())
    }

    /// Copies until one side ends, then ends the other. Each piece waits first.
    fn copy(&self, mut from: &TcpStream, mut to: &TcpStream, delay_ms: u32, is_request: bool) {
        let mut buffer = vec![0; 1 << 16];
        while let Ok(count) = from.read(&mut buffer) {
            std::thread::sleep(Duration::from_millis(delay_ms.into()));
            while self.is_mute.load(Ordering::SeqCst) && !self.is_cut.load(Ordering::SeqCst) {
                std::thread::sleep(Duration::from_millis(20));
            }
            if is_request && self.ignores_conditions.load(Ordering::SeqCst) {
                forget_conditions(&mut buffer[..count]);
            }
            if count == 0 || to.write_all(&buffer[..count]).is_err() {
                break;
            }
        }
        let _ = to.shutdown(Shutdown::Both);
        let _ = from.shutdown(Shutdown::Both);
    }
}

/// Gives the header of conditional writes another name.
fn forget_conditions(request: &mut [u8]) {
    let name = b"if-none-match";
    let is_header = |part: &[u8]| part.eq_ignore_ascii_case(name);
    if let Some(at) = request.windows(name.len()).position(is_header) {
        request[at..at + name.len()].copy_from_slice(b"x-nothing-ask");
    }
}
