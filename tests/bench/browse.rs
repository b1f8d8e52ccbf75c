//! The server under an asset browser: many clients look at stored meshes, some far more often than
//! others (Zipf), under caps that hold a part of them. Prints rates, hits and times. Unless the
//! back-end is `auto`, compares every picture with the one that was drawn first. The clients share
//! the cores with the server. Whether the caps are kept is read from the server's own figures
//! (`/v1/capabilities`); the process's memory is printed beside them.
//!
//!     cargo bench --bench browse                              # 200 meshes, 64 clients, 60 s, a quarter kept
//!     cargo bench --bench browse -- --seconds 10 --style wire --backend gpu
//!     cargo bench --bench browse -- --nodes 3 --seconds 20    # three servers with a shared store in a folder
//!     cargo bench --bench browse -- --nodes 3 --store s3://BUCKET/PREFIX
//!     cargo bench --bench browse -- --turning --mesh bunny.obj --seconds 5
//!     cargo bench --bench browse -- --turning --mesh bunny.obj --style auto,flat,wire --clients 1
//!
//! With `--nodes` several servers share a store. The meshes are stored at the first, and each request goes to any of them.
//!
//! With `--turning` each request has a camera of its own, so that each picture is drawn, and none
//! is compared. In turns with that, the PNG encoder alone is measured on all cores. `--style` takes
//! up to four styles, which the requests share; the encoder has a picture of the first. Ends with a
//! failure if an answer or a picture is wrong, or if a cap is not kept.

// A tool for developers: giving up loudly is fine.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod served;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::net::TcpStream;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use meshsnap_render::encode::encode;
use meshsnap_render::image::{Image, ImageFormat};
use meshsnap_render::limits::Deadline;
use served::{Answer, ask, resident_bytes, start_on};

/// Cameras of each mesh, unless each request has its own.
const CAMERAS: usize = 4;

/// Rounds in which the server and the encoder take turns.
const TURNS: u32 = 5;

struct Options {
    /// A file; None: tori that are made here.
    mesh: Option<String>,
    meshes: usize,
    clients: usize,
    seconds: f64,
    size_px: u32,
    /// One or more, with commas.
    style: String,
    backend: String,
    is_turning: bool,
    /// Servers that are asked.
    nodes: usize,
    /// The store that they share; None: a folder that is made here.
    store: Option<String>,
}

/// A request and the picture that it is to bring; None before it is known.
struct View {
    path: String,
    picture: Option<Vec<u8>>,
}

/// What the clients have seen.
#[derive(Default)]
struct Seen {
    times: Vec<Duration>,
    /// Of the pictures that were drawn, milliseconds by stage, as Server-Timing has them.
    stages: BTreeMap<String, Vec<f64>>,
    hits: usize,
    coalesced: usize,
    shared: usize,
    by_cpu: usize,
    wrong: usize,
    refused: usize,
}

fn main() -> ExitCode {
    let options = options();
    let meshes = match &options.mesh {
        Some(file) => vec![std::fs::read(file).unwrap_or_else(|error| panic!("{file}: {error}"))],
        None => (0..options.meshes).map(torus).collect(),
    };
    if options.is_turning { turning(&options, &meshes) } else { browsing(&options, &meshes) }
}

/// Draws every view once with room for all, then browses with a quarter of that room.
fn browsing(options: &Options, meshes: &[Vec<u8>]) -> ExitCode {
    let (mut child, address) = start_on(&options.backend, &["--mesh-bytes".into(), "4GiB".into()]);
    let mut views = views(options, &address, meshes);
    let mut stream = None;
    for view in &mut views {
        view.picture = Some(get(&mut stream, &address, &view.path).body);
    }
    let load = |address: &str, name: &str| capabilities(address)["load"][name].as_u64().expect("a number");
    let needed = ["resident_mesh_bytes", "kept_picture_bytes"].map(|name| load(&address, name));
    let kept = ["resident_meshes", "kept_pictures"].map(|name| load(&address, name));
    assert_eq!(kept, [meshes.len(), views.len()].map(|count| count as u64), "the first server holds all");
    stop(&mut child);
    println!("{} meshes of {} bytes in all", meshes.len(), meshes.iter().map(Vec::len).sum::<usize>());
    println!("needed: {} bytes of meshes, {} of pictures; a quarter of each is given", needed[0], needed[1]);

    let [resident, pictures] = needed.map(|bytes| (bytes / 4).to_string());
    let folder = tempfile::tempdir().expect("a folder");
    let store = options.store.clone().unwrap_or_else(|| format!("file://{}", folder.path().display()));
    let mut caps = vec!["--mesh-bytes", "4GiB", "--resident-bytes", &resident, "--picture-bytes", &pictures];
    if options.nodes > 1 {
        caps.extend(["--store", &store]);
    }
    let caps: Vec<String> = caps.into_iter().map(str::to_owned).collect();
    let (mut children, addresses): (Vec<_>, Vec<_>) =
        (0..options.nodes).map(|_| start_on(&options.backend, &caps)).unzip();
    assert_eq!(self::views(options, &addresses[0], meshes).len(), views.len());
    let (is_over, samples, broken) = (AtomicBool::new(false), AtomicU64::new(0), AtomicU64::new(0));
    let mut memory_max = 0;
    let seen = std::thread::scope(|scope| {
        let clients: Vec<_> = (0..options.clients)
            .map(|number| scope.spawn(client(options, &addresses, &views, number as u64, &is_over)))
            .collect();
        let began = Instant::now();
        while began.elapsed().as_secs_f64() < options.seconds {
            std::thread::sleep(Duration::from_millis(100));
            samples.fetch_add(1, Ordering::Relaxed);
            let is_kept = |address: &String| {
                load(address, "resident_mesh_bytes") <= needed[0] / 4
                    && load(address, "kept_picture_bytes") <= needed[1] / 4
            };
            broken.fetch_add(u64::from(!addresses.iter().all(is_kept)), Ordering::Relaxed);
            memory_max = children.iter().filter_map(resident_bytes).max().unwrap_or(0).max(memory_max);
        }
        is_over.store(true, Ordering::Relaxed);
        clients.into_iter().map(|client| client.join().expect("a client ends")).fold(Seen::default(), Seen::and)
    });
    children.iter_mut().for_each(stop);
    print(options, &seen, memory_max);
    println!("{:.0} answers a second", seen.times.len() as f64 / options.seconds);
    println!("caps: {} samples, {} above", samples.into_inner(), broken.load(Ordering::Relaxed));
    ExitCode::from(u8::from(seen.wrong + seen.refused > 0 || broken.into_inner() > 0 || seen.times.is_empty()))
}

/// Draws pictures from ever new sides, in turns with the PNG encoder.
fn turning(options: &Options, meshes: &[Vec<u8>]) -> ExitCode {
    let (mut child, address) = start_on(&options.backend, &["--picture-bytes".into(), "0".into()]);
    let addresses = [address.clone()];
    let views = views(options, &address, meshes);
    let picture = image::load_from_memory(&get(&mut None, &address, &views[0].path).body).expect("a picture");
    let (width_px, height_px) = (picture.width(), picture.height());
    let picture = Image { width_px, height_px, rgba: picture.into_rgba8().into_raw().into() };
    let (mut rates, mut encoded, mut all, mut memory_max) = (Vec::new(), Vec::new(), Seen::default(), 0);
    for turn in 0..TURNS {
        let is_over = AtomicBool::new(false);
        let began = Instant::now();
        let seen = std::thread::scope(|scope| {
            let clients: Vec<_> = (0..options.clients)
                .map(|number| {
                    let seed = u64::from(turn) << 32 | number as u64;
                    scope.spawn(client(options, &addresses, &views, seed, &is_over))
                })
                .collect();
            std::thread::sleep(Duration::from_secs_f64(options.seconds / f64::from(TURNS)));
            is_over.store(true, Ordering::Relaxed);
            clients.into_iter().map(|client| client.join().expect("a client ends")).fold(Seen::default(), Seen::and)
        });
        rates.push(seen.times.len() as f64 / began.elapsed().as_secs_f64());
        all = all.and(seen);
        memory_max = memory_max.max(resident_bytes(&child).unwrap_or(0));
        encoded.push(encoder_rate(&picture));
    }
    stop(&mut child);
    print(options, &all, memory_max);
    let median = |rates: &mut Vec<f64>| {
        rates.sort_by(f64::total_cmp);
        rates[rates.len() / 2]
    };
    let (rate, encoded) = (median(&mut rates), median(&mut encoded));
    println!("{rate:.0} pictures a second, the PNG encoder alone {encoded:.0}, ratio {:.2}", rate / encoded);
    ExitCode::from(u8::from(all.wrong + all.refused > 0 || all.times.is_empty()))
}

/// One client, until it is over.
fn client<'a>(
    options: &'a Options,
    addresses: &'a [String],
    views: &'a [View],
    seed: u64,
    is_over: &'a AtomicBool,
) -> impl FnOnce() -> Seen + 'a {
    move || {
        let (mut seen, mut random) = (Seen::default(), Random((seed + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15)));
        let mut streams: Vec<Option<TcpStream>> = addresses.iter().map(|_| None).collect();
        // The cumulative weights 1/1, 1/2, 1/3, ... of the meshes.
        let weights: Vec<f64> = (1..=views.len() / CAMERAS)
            .scan(0.0, |sum, rank| {
                *sum += 1.0 / rank as f64;
                Some(*sum)
            })
            .collect();
        while !is_over.load(Ordering::Relaxed) {
            let at = random.below_one() * weights.last().expect("a mesh");
            let mesh = weights.partition_point(|&sum| sum < at).min(weights.len() - 1);
            let view = &views[mesh * CAMERAS + (random.below_one() * CAMERAS as f64) as usize % CAMERAS];
            let mut path = view.path.clone();
            if options.is_turning {
                let _ = write!(path, "&camera.azimuth_deg={:.6}", random.below_one() * 360.0 - 180.0);
            }
            let node = (random.below_one() * addresses.len() as f64) as usize % addresses.len();
            let began = Instant::now();
            let answer = get(&mut streams[node], &addresses[node], &path);
            seen.times.push(began.elapsed());
            seen.add_stages(&answer);
            seen.hits += usize::from(answer.header("x-cache") == Some("hit"));
            seen.coalesced += usize::from(answer.header("x-cache") == Some("coalesced"));
            seen.shared += usize::from(answer.header("x-cache") == Some("shared"));
            seen.by_cpu += usize::from(answer.header("x-render-backend") == Some("cpu"));
            seen.refused += usize::from(answer.status != 200);
            // Two back-ends may draw a picture alike and not equal.
            let is_fixed = answer.status == 200 && options.backend != "auto" && !options.is_turning;
            seen.wrong += usize::from(is_fixed && view.picture.as_ref() != Some(&answer.body));
        }
        seen
    }
}

impl Seen {
    fn and(mut self, other: Self) -> Self {
        self.times.extend(other.times);
        for (name, times) in other.stages {
            self.stages.entry(name).or_default().extend(times);
        }
        self.hits += other.hits;
        self.coalesced += other.coalesced;
        self.shared += other.shared;
        self.by_cpu += other.by_cpu;
        self.wrong += other.wrong;
        self.refused += other.refused;
        self
    }

    /// Adds the stages of a picture that was drawn for this answer.
    fn add_stages(&mut self, answer: &Answer) {
        for entry in answer.header("server-timing").into_iter().flat_map(|timing| timing.split(',')) {
            let Some((name, rest)) = entry.trim().split_once(";dur=") else { continue };
            let duration = rest.split(';').next().and_then(|duration| duration.parse::<f64>().ok());
            self.stages.entry(name.to_owned()).or_default().extend(duration);
        }
    }
}

fn print(options: &Options, seen: &Seen, memory_max: u64) {
    let mut times = seen.times.clone();
    times.sort_unstable();
    let at = |part: f64| times.get((times.len() as f64 * part) as usize).map_or(0.0, |t| t.as_secs_f64() * 1e3);
    let share = |count: usize| count as f64 / times.len().max(1) as f64;
    println!(
        "{} px, {}, {}: {} answers, p50 {:.2} ms, p99 {:.2} ms, hits {:.3}, coalesced {:.3}, shared {:.3}, by the CPU {:.3}",
        options.size_px,
        options.style,
        options.backend,
        times.len(),
        at(0.5),
        at(0.99),
        share(seen.hits),
        share(seen.coalesced),
        share(seen.shared),
        share(seen.by_cpu),
    );
    let of_stage = |(name, times): (&String, &Vec<f64>)| {
        let mut times = times.clone();
        times.sort_unstable_by(f64::total_cmp);
        let at = |part: f64| times.get((times.len() as f64 * part) as usize).copied().unwrap_or(0.0);
        format!("{name} {:.2} ({:.2})", at(0.5), at(0.99))
    };
    let stages: Vec<String> = seen.stages.iter().map(of_stage).collect();
    println!("stages, p50 (p99), ms: {}", stages.join(", "));
    println!("refused {}, wrong {}, largest memory {} MiB", seen.refused, seen.wrong, memory_max >> 20);
}

/// Stores the meshes and returns the addresses of their pictures, mesh by mesh.
fn views(options: &Options, address: &str, meshes: &[Vec<u8>]) -> Vec<View> {
    let mut stream = None;
    let mut all = Vec::new();
    for mesh in meshes {
        let post = format!("POST /v1/meshes HTTP/1.1\r\nHost: {address}\r\nContent-Length: {}\r\n\r\n", mesh.len());
        let answer = ask(&mut stream, address, &[post.as_bytes(), mesh].concat()).expect("an answer");
        assert_eq!(answer.status, 201, "{}", String::from_utf8_lossy(&answer.body));
        let stored: serde_json::Value = serde_json::from_slice(&answer.body).expect("JSON");
        let url = stored["url"].as_str().expect("an address");
        let mut styles = options.style.split(',').cycle();
        assert!(options.style.split(',').count() <= CAMERAS, "at most {CAMERAS} styles, one for each camera");
        for camera in 0..CAMERAS {
            let turn = if options.is_turning { String::new() } else { format!("&camera.azimuth_deg={}", 20 * camera) };
            let path = format!(
                "{url}/render.png?size={}&samples=4&style={}{turn}",
                options.size_px,
                styles.next().expect("a style")
            );
            all.push(View { path, picture: None });
        }
    }
    all
}

fn get(stream: &mut Option<TcpStream>, address: &str, path: &str) -> Answer {
    ask(stream, address, format!("GET {path} HTTP/1.1\r\nHost: {address}\r\n\r\n").as_bytes()).expect("an answer")
}

fn capabilities(address: &str) -> serde_json::Value {
    serde_json::from_slice(&get(&mut None, address, "/v1/capabilities").body).expect("JSON")
}

fn stop(child: &mut std::process::Child) {
    let _ = child.kill();
    let _ = child.wait();
}

/// PNG files a second of this picture, on all cores.
fn encoder_rate(picture: &Image) -> f64 {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (began, turn) = (Instant::now(), Duration::from_millis(500));
    let count: u64 = std::thread::scope(|scope| {
        let encode_all = || {
            let mut count = 0;
            while began.elapsed() < turn {
                encode(picture, ImageFormat::Png, 3, &Deadline::default()).expect("a file");
                count += 1;
            }
            count
        };
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(encode_all)).collect();
        threads.into_iter().map(|thread| thread.join().expect("a thread ends")).sum()
    });
    count as f64 / began.elapsed().as_secs_f64()
}

/// A torus as OBJ: 200 to 20,000 faces, each torus another one.
fn torus(number: usize) -> Vec<u8> {
    let around = 10 + number * 37 % 90;
    let (mut text, tube) = (String::new(), 0.2 + number as f64 * 1e-3);
    for i in 0..2 * around {
        for j in 0..around {
            let (u, v) =
                (i as f64 * std::f64::consts::PI / around as f64, j as f64 * std::f64::consts::TAU / around as f64);
            let ring = 1.0 + tube * v.cos();
            let _ = writeln!(text, "v {} {} {}", ring * u.cos(), tube * v.sin(), ring * u.sin());
        }
    }
    for i in 0..2 * around {
        for j in 0..around {
            let at = |i: usize, j: usize| i % (2 * around) * around + j % around + 1;
            let _ = writeln!(text, "f {} {} {} {}", at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
        }
    }
    text.into_bytes()
}

fn options() -> Options {
    let mut options = Options {
        mesh: None,
        meshes: 200,
        clients: 64,
        seconds: 60.0,
        size_px: 256,
        style: "flat".into(),
        backend: "cpu".into(),
        is_turning: false,
        nodes: 1,
        store: None,
    };
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(name) = arguments.next() {
        if name == "--turning" {
            options.is_turning = true;
            continue;
        }
        let value = arguments.next().unwrap_or_else(|| panic!("{name} needs a value"));
        match name.as_str() {
            "--mesh" => options.mesh = Some(value),
            "--meshes" => options.meshes = value.parse().expect("a number"),
            "--clients" => options.clients = value.parse().expect("a number"),
            "--seconds" => options.seconds = value.parse().expect("seconds"),
            "--size" => options.size_px = value.parse().expect("pixels"),
            "--style" => options.style = value,
            "--nodes" => options.nodes = value.parse().expect("a number"),
            "--store" => options.store = Some(value),
            "--backend" => options.backend = value,
            other => panic!("there is no option {other}"),
        }
    }
    options
}

/// Numbers that look random: xorshift64*, Vigna 2016.
struct Random(u64);

impl Random {
    fn below_one(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
