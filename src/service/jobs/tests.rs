use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bytes::Bytes;

use super::*;
use crate::backend::BackendKind;
use crate::image::ImageFormat;
use crate::import::Bundle;
use crate::limits::{Deadline, Stopped};
use crate::pipeline::{Output, RenderError, Stage};
use crate::spec::BackendChoice;
use crate::spec::color::Rgba;
use crate::spec::{CameraSpec, ImageSpec, Layers, Light, LightPreset, NamedView, ProjectionKind, Spec};

const SOON: Duration = Duration::from_secs(10);

fn settings() -> Settings {
    Settings {
        workers: 1,
        queue: 2,
        job_time: Duration::from_secs(30),
        result_ttl: Duration::from_secs(60),
        result_bytes: 1000,
        result_count: 100,
    }
}

fn work(bodies: &Arc<UploadBudget>, mesh: &'static [u8]) -> Work {
    let mut reservation = bodies.reserve();
    reservation.grow(mesh.len() as u64).unwrap();
    let (bundle, task) = (Bundle::of_one(Bytes::from_static(mesh)), Task::Draw(Box::new(spec())));
    Work { bundle, format_in: None, task, memory: Arc::new(reservation) }
}

/// What is drawn does not matter here.
fn spec() -> Spec {
    let camera = CameraSpec {
        view: NamedView::Iso,
        azimuth_deg: None,
        elevation_deg: None,
        projection: ProjectionKind::Perspective,
        fov_deg: 35.0,
        height: None,
        up: None,
        margin: 0.0,
        eye: None,
        target: None,
        from_file: false,
    };
    let image = ImageSpec { width_px: 8, height_px: 8, format: None, samples: 1, background: Rgba::WHITE };
    let light = Light { preset: LightPreset::Headlight, direction: None, intensity: 1.0, ambient: 0.3 };
    Spec {
        layers: Layers::default(),
        materials: Vec::new(),
        topology: None,
        time_s: None,
        camera,
        light,
        image,
        backend: BackendChoice::Cpu,
        quality_target: None,
    }
}

fn output(bytes: usize) -> Output {
    let (skips, warnings) = (Vec::new(), Vec::new());
    Output {
        bytes: vec![7; bytes],
        format: ImageFormat::Png,
        backend: BackendKind::Cpu,
        skips,
        warnings,
        selection: None,
    }
}

/// What the mesh bytes make the fake renderer do.
fn act(work: &Work, deadline: &Deadline, gate: &Mutex<Receiver<()>>) -> Result<Output, RenderError> {
    match &work.bundle.files()[0].bytes[..] {
        b"panic" => panic!("asked to"),
        b"wait" => {
            gate.lock().unwrap().recv_timeout(SOON).map_or(Err(RenderError::Stopped(Stopped)), |()| Ok(output(1)))
        }
        b"spin" => loop {
            deadline.check()?;
            std::thread::sleep(Duration::from_millis(1));
        },
        b"deaf" => {
            std::thread::sleep(Duration::from_millis(400));
            Ok(output(1))
        }
        other => Ok(output(other.len())),
    }
}

struct Bench {
    jobs: Jobs,
    bodies: Arc<UploadBudget>,
    open: Sender<()>,
    renderers: Arc<AtomicUsize>,
}

fn bench(settings: Settings) -> Bench {
    let (open, gate) = channel();
    let gate = Arc::new(Mutex::new(gate));
    let renderers = Arc::new(AtomicUsize::new(0));
    let made = renderers.clone();
    let engine: Engine = Arc::new(move || {
        made.fetch_add(1, Ordering::Relaxed);
        let gate = gate.clone();
        Box::new(move |work, deadline, ended| {
            ended(Stage::Parse);
            let output = act(work, deadline, &gate)?;
            ended(Stage::Encode);
            Ok(Product::Picture(output))
        })
    });
    Bench { jobs: Jobs::start(settings, engine).unwrap(), bodies: UploadBudget::new(1 << 20), open, renderers }
}

impl Bench {
    fn submit(&self, mesh: &'static [u8], keep: bool) -> Result<Arc<Job>, Refusal> {
        self.jobs.submit(work(&self.bodies, mesh), keep)
    }

    /// Fills the one worker with a job that waits for the gate.
    fn occupy(&self) -> Arc<Job> {
        let job = self.submit(b"wait", false).unwrap();
        let began = Instant::now();
        while self.jobs.load().running == 0 {
            assert!(began.elapsed() < SOON, "the worker did not start");
            std::thread::sleep(Duration::from_millis(1));
        }
        job
    }
}

fn wait(job: &Job) -> State {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    runtime.block_on(async { tokio::time::timeout(SOON, job.ended()).await.expect("the job ended") })
}

#[test]
fn a_job_ends_with_its_picture_and_gives_its_memory_back() {
    let bench = bench(settings());
    let job = bench.submit(b"12345", false).unwrap();
    let State::Done(finished) = wait(&job) else { panic!("{:?}", job.state()) };
    assert_eq!(finished.picture.len(), 5);
    assert_eq!(bench.bodies.used_bytes(), 0);
    assert!(bench.jobs.find(job.id).is_none(), "not kept");
}

#[test]
fn a_full_queue_refuses_at_once_and_takes_jobs_again_later() {
    let bench = bench(settings());
    let first = bench.occupy();
    let waiting = [bench.submit(b"1", false).unwrap(), bench.submit(b"1", false).unwrap()];
    let began = Instant::now();
    let refusal = bench.submit(b"1", false).unwrap_err();
    assert!(matches!(refusal, Refusal::QueueFull { queue: 2, retry_after_s: 1.. }), "{refusal:?}");
    assert_eq!(bench.jobs.would_accept(), Err(refusal));
    assert!(began.elapsed() < Duration::from_millis(100), "a refusal does not wait");
    bench.open.send(()).unwrap();
    for job in waiting.iter().chain([&first]) {
        assert!(matches!(wait(job), State::Done(_)));
    }
    assert!(matches!(wait(&bench.submit(b"1", false).unwrap()), State::Done(_)));
}

#[test]
fn an_idle_worker_takes_a_job_even_without_a_queue() {
    let bench = bench(Settings { queue: 0, ..settings() });
    for _ in 0..200 {
        assert!(matches!(wait(&bench.submit(b"1", false).unwrap()), State::Done(_)));
    }
    bench.occupy();
    assert!(bench.submit(b"1", false).is_err());
    bench.open.send(()).unwrap();
}

#[test]
fn a_panic_costs_its_job_alone() {
    let bench = bench(settings());
    assert!(matches!(wait(&bench.submit(b"1", false).unwrap()), State::Done(_)));
    assert_eq!(bench.renderers.load(Ordering::Relaxed), 1);
    for round in 2..5 {
        let job = bench.submit(b"panic", true).unwrap();
        let State::Failed(failure) = wait(&job) else { panic!("{:?}", job.state()) };
        assert!(matches!(*failure, Failure::Panicked));
        assert!(matches!(wait(&bench.submit(b"1", false).unwrap()), State::Done(_)));
        assert_eq!(bench.renderers.load(Ordering::Relaxed), round, "a fresh renderer");
    }
    assert_eq!(bench.bodies.used_bytes(), 0);
}

#[test]
fn a_job_out_of_time_stops_wherever_it_is() {
    let bench = bench(Settings { job_time: Duration::from_millis(150), ..settings() });
    let (running, queued) = (bench.submit(b"spin", true).unwrap(), bench.submit(b"spin", true).unwrap());
    for job in [&running, &queued] {
        let State::Failed(failure) = wait(job) else { panic!("{:?}", job.state()) };
        assert!(matches!(*failure, Failure::TimeUp { limit_ms: 150 }), "{failure:?}");
        assert!(job.accepted.elapsed() >= Duration::from_millis(150));
    }
    assert!(matches!(wait(&bench.submit(b"1", false).unwrap()), State::Done(_)), "the worker is free again");
    assert_eq!(bench.bodies.used_bytes(), 0);
}

#[test]
fn a_late_answer_comes_in_time_even_if_the_renderer_does_not_listen() {
    let bench = bench(Settings { job_time: Duration::from_millis(50), ..settings() });
    let job = bench.submit(b"deaf", true).unwrap();
    assert!(matches!(wait(&job), State::Failed(_)));
    assert!(job.accepted.elapsed() < Duration::from_millis(350), "{:?}", job.accepted.elapsed());
    std::thread::sleep(Duration::from_millis(450));
    assert!(matches!(job.state(), State::Failed(_)), "the first end counts");
    assert_eq!(bench.jobs.load().running, 0);
}

#[test]
fn a_cancelled_job_frees_its_place_and_its_memory_at_once() {
    let bench = bench(settings());
    let first = bench.occupy();
    let waiting = [bench.submit(b"22", true).unwrap(), bench.submit(b"333", true).unwrap()];
    assert_eq!(bench.bodies.used_bytes(), 4 + 2 + 3);
    bench.jobs.cancel(&waiting[0]);
    assert!(matches!(waiting[0].state(), State::Cancelled));
    assert_eq!((bench.bodies.used_bytes(), bench.jobs.load().queued), (4 + 3, 1));
    bench.submit(b"1", false).unwrap();
    bench.open.send(()).unwrap();
    assert!(matches!(wait(&waiting[1]), State::Done(_)));
    bench.jobs.cancel(&waiting[1]);
    assert!(matches!(waiting[1].state(), State::Done(_)), "what has ended stays as it is");
    assert!(matches!(wait(&first), State::Done(_)));
}

#[test]
fn results_are_kept_for_a_while_and_within_their_memory() {
    let bench = bench(settings());
    let large: &'static [u8] = &[b'x'; 600];
    let first = bench.submit(large, true).unwrap();
    wait(&first);
    assert!(bench.jobs.find(first.id).is_some());
    let second = bench.submit(large, true).unwrap();
    wait(&second);
    assert!(bench.jobs.find(first.id).is_none(), "the oldest goes first");
    assert!(bench.jobs.find(second.id).is_some());
    assert_eq!(bench.jobs.load().kept_bytes, 600);

    let brief = self::bench(Settings { result_ttl: Duration::from_millis(30), ..settings() });
    let job = brief.submit(b"1", true).unwrap();
    wait(&job);
    let began = Instant::now();
    while brief.jobs.find(job.id).is_some() {
        assert!(began.elapsed() < SOON, "the result did not expire");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(brief.jobs.load(), Load::default());
}

#[test]
fn draining_finishes_what_was_accepted_and_takes_nothing_new() {
    let bench = bench(settings());
    let jobs = [bench.occupy(), bench.submit(b"1", true).unwrap()];
    bench.jobs.drain();
    assert_eq!(bench.submit(b"1", false).unwrap_err(), Refusal::Draining);
    bench.open.send(()).unwrap();
    for job in &jobs {
        assert!(matches!(wait(job), State::Done(_)));
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    runtime.block_on(async { tokio::time::timeout(SOON, bench.jobs.idle()).await.expect("idle") });
}

#[test]
fn many_threads_lose_no_job() {
    let bench = bench(Settings { workers: 3, queue: 8, ..settings() });
    let (done, refused) = (AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for round in 0..200 {
                    match bench.submit(if round % 50 == 7 { b"panic" } else { b"1" }, round % 2 == 0) {
                        Ok(job) if round % 10 == 3 => bench.jobs.cancel(&job),
                        Ok(job) => assert!(wait(&job).is_final()),
                        Err(_) => _ = refused.fetch_add(1, Ordering::Relaxed),
                    }
                    done.fetch_add(1, Ordering::Relaxed);
                }
            });
        }
    });
    assert_eq!(done.load(Ordering::Relaxed), 1600);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    runtime.block_on(async { tokio::time::timeout(SOON, bench.jobs.idle()).await.expect("idle") });
    assert_eq!((bench.bodies.used_bytes(), bench.jobs.load().queued, bench.jobs.load().running), (0, 0, 0));
}
