mod watchdog;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bytes::Bytes;

use super::dispatch::Next;
use super::estimates::Estimates;
use super::*;
use crate::memory::Account;
use meshsnap_render::backend::{BackendKind, DrawTimes};
use meshsnap_render::image::ImageFormat;
use meshsnap_render::import::Bundle;
use meshsnap_render::limits::{Deadline, Stopped};
use meshsnap_render::pipeline::{DrawReport, Output, RenderError, Stage};
use meshsnap_render::spec::color::Rgba;
use meshsnap_render::spec::{
    BackendChoice, CameraSpec, Ground, ImageSpec, Layers, Light, LightPreset, NamedView, Points, ProjectionKind,
    Samples, Sheet, SheetViews, Spec,
};

const SOON: Duration = Duration::from_secs(10);

fn settings() -> JobSettings {
    JobSettings {
        workers: 1,
        queue: 2,
        idle_time: SOON,
        job_time: Duration::from_secs(30),
        overdue_grace: SOON,
        interactive_wait: Duration::from_secs(30),
        batch_wait: Duration::from_secs(600),
        result_ttl: Duration::from_secs(60),
        unfetched_ttl: Duration::from_secs(60),
        result_bytes: 1000,
        result_count: 100,
        memory: Memory::unlimited(&[(Account::Uploads, 1 << 20)]),
        storage: None,
        metrics: None,
        code_of: |_| "failed",
        webhooks: None,
    }
}

fn work(budget: &Arc<Memory>, mesh: &'static [u8]) -> Work {
    let reservation = budget.share(Account::Uploads);
    reservation.grow(mesh.len() as u64).unwrap();
    let (bundle, task) = (Bundle::of_one(Bytes::from_static(mesh)), Task::Draw(Box::new(spec())));
    Work {
        bundle,
        format_in: None,
        mesh_key: None,
        task,
        memory: Arc::new(reservation),
        lender: None,
        recipe: None,
        owner: Owner::default(),
        request_id: "".into(),
        holds: [].into(),
        claim: None,
        webhook: None,
    }
}

/// Any specification: the fake renderer does not read it.
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
        fits_turn: false,
    };
    let image = ImageSpec {
        width_px: 8,
        height_px: 8,
        format: None,
        samples: Samples::Fixed(1),
        background: Rgba::WHITE.into(),
        effort: 3,
        legend: false,
    };
    let light =
        Light { preset: LightPreset::Headlight, direction: None, intensity: 1.0, ambient: 0.3, ambient_occlusion: 0.0 };
    Spec {
        layers: Layers::default(),
        materials: Vec::new(),
        topology: None,
        points: Points::default(),
        time_s: None,
        ground: Ground::None,
        camera,
        sheet: None,
        light,
        image,
        backend: BackendChoice::Cpu,
        quality_target: None,
    }
}

fn output(bytes: usize) -> Output {
    let report = DrawReport {
        backend: BackendKind::Cpu,
        is_substitute: false,
        draw_times: DrawTimes::default(),
        skips: Vec::new(),
        short_chains: 0,
        warnings: Vec::new(),
        selection: None,
    };
    Output { bytes: vec![7; bytes], format: ImageFormat::Png, report }
}

/// The fake renderer, whose behaviour the mesh's bytes name.
fn fake_render(work: &Work, deadline: &Deadline, gate: &Mutex<Receiver<()>>) -> Result<Output, RenderError> {
    match &work.bundle.files()[0].bytes[..] {
        b"panic" => panic!("asked to"),
        [b's', b't', b'u', b'c', b'k', _] | b"wait" => {
            gate.lock().unwrap().recv_timeout(SOON).map_or(Err(RenderError::Stopped(Stopped)), |()| Ok(output(1)))
        }
        b"spin" => loop {
            deadline.check()?;
            std::thread::sleep(Duration::from_millis(1));
        },
        other => Ok(output(other.len())),
    }
}

struct Fixture {
    jobs: Jobs,
    budget: Arc<Memory>,
    open: Sender<()>,
    /// Number of renderers that were made. Each holds it.
    renderers: Arc<AtomicUsize>,
}

fn fixture(settings: JobSettings) -> Fixture {
    let (open, gate) = channel();
    let gate = Arc::new(Mutex::new(gate));
    let renderers = Arc::new(AtomicUsize::new(0));
    let made = renderers.clone();
    let factory: RendererFactory = Arc::new(move || {
        made.fetch_add(1, Ordering::Relaxed);
        let (gate, made) = (gate.clone(), made.clone());
        Box::new(move |work, deadline, ended| {
            let _alive = &made;
            ended(Stage::Parse);
            let output = fake_render(work, deadline, &gate)?;
            ended(Stage::Encode);
            Ok(Product::Picture { output: Box::new(output), mesh_was_kept: false })
        })
    });
    Fixture {
        jobs: Jobs::start(settings, factory).unwrap(),
        budget: Memory::unlimited(&[(Account::Uploads, 1 << 20)]),
        open,
        renderers,
    }
}

impl Fixture {
    fn submit(&self, mesh: &'static [u8], keep: bool) -> Result<Arc<Job>, Refusal> {
        self.jobs.submit(work(&self.budget, mesh), keep)
    }

    /// Occupies the one worker with a job that waits for the gate.
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

fn wait(job: &Job) -> JobState {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    runtime.block_on(async { tokio::time::timeout(SOON, job.ended()).await.expect("the job ended") })
}

#[test]
fn a_job_ends_with_its_picture_and_gives_its_memory_back() {
    let fixture = fixture(settings());
    let job = fixture.submit(b"12345", false).unwrap();
    let JobState::Done(finished) = wait(&job) else { panic!("{:?}", job.state()) };
    assert_eq!(finished.content.len(), 5);
    assert_eq!(fixture.budget.used(Account::Uploads), 0);
    assert!(fixture.jobs.find(job.id).is_none(), "not kept");
}

#[test]
fn a_full_queue_refuses_at_once_and_takes_jobs_again_later() {
    let fixture = fixture(settings());
    let first = fixture.occupy();
    let waiting = [fixture.submit(b"1", false).unwrap(), fixture.submit(b"1", false).unwrap()];
    // The gate is shut: a refusal that waited for a place would wait for ever.
    let refusal = fixture.submit(b"1", false).unwrap_err();
    assert!(matches!(refusal, Refusal::QueueFull { queue: 2, retry_after_s: 1.. }), "{refusal:?}");
    assert_eq!(fixture.jobs.would_accept(Class::Interactive, &Owner::default()), Err(refusal));
    fixture.open.send(()).unwrap();
    for job in waiting.iter().chain([&first]) {
        assert!(matches!(wait(job), JobState::Done(_)));
    }
    assert!(matches!(wait(&fixture.submit(b"1", false).unwrap()), JobState::Done(_)));
}

#[test]
fn an_idle_worker_takes_a_job_even_without_a_queue() {
    let fixture = fixture(JobSettings { queue: 0, ..settings() });
    for _ in 0..200 {
        assert!(matches!(wait(&fixture.submit(b"1", false).unwrap()), JobState::Done(_)));
    }
    fixture.occupy();
    assert!(fixture.submit(b"1", false).is_err());
    fixture.open.send(()).unwrap();
}

#[test]
fn a_panic_costs_its_job_alone() {
    let fixture = fixture(settings());
    assert!(matches!(wait(&fixture.submit(b"1", false).unwrap()), JobState::Done(_)));
    assert_eq!(fixture.renderers.load(Ordering::Relaxed), 1);
    for round in 2..5 {
        let job = fixture.submit(b"panic", true).unwrap();
        let JobState::Failed(failure) = wait(&job) else { panic!("{:?}", job.state()) };
        assert!(matches!(*failure, Failure::Panicked));
        assert!(matches!(wait(&fixture.submit(b"1", false).unwrap()), JobState::Done(_)));
        assert_eq!(fixture.renderers.load(Ordering::Relaxed), round, "a fresh renderer");
    }
    assert_eq!(fixture.budget.used(Account::Uploads), 0);
}

#[test]
fn a_job_out_of_time_stops_wherever_it_is() {
    let fixture = fixture(JobSettings { job_time: Duration::from_millis(150), ..settings() });
    let (running, queued) = (fixture.submit(b"spin", true).unwrap(), fixture.submit(b"spin", true).unwrap());
    for job in [&running, &queued] {
        let JobState::Failed(failure) = wait(job) else { panic!("{:?}", job.state()) };
        assert!(matches!(*failure, Failure::TimeUp { limit_ms: 150 }), "{failure:?}");
        assert!(job.accepted.elapsed() >= Duration::from_millis(150));
    }
    assert!(matches!(wait(&fixture.submit(b"1", false).unwrap()), JobState::Done(_)), "the worker is free again");
    assert_eq!(fixture.budget.used(Account::Uploads), 0);
}

#[test]
fn an_overdue_job_ends_in_time_even_if_its_renderer_goes_on() {
    let fixture = fixture(JobSettings { job_time: Duration::from_millis(50), ..settings() });
    let job = fixture.submit(b"wait", true).unwrap();
    // The gate is still shut, so the renderer is still at work when the job ends.
    assert!(matches!(wait(&job), JobState::Failed(_)));
    fixture.open.send(()).unwrap();
    // The one worker takes another job once it is through with the first.
    let began = Instant::now();
    while !matches!(wait(&fixture.submit(b"1", false).unwrap()), JobState::Done(_)) {
        assert!(began.elapsed() < SOON, "the worker did not come free");
    }
    assert!(matches!(job.state(), JobState::Failed(_)), "the first end counts");
    assert_eq!(fixture.jobs.load().running, 0);
}

#[test]
fn a_cancelled_job_frees_its_place_and_its_memory_at_once() {
    let fixture = fixture(settings());
    let first = fixture.occupy();
    let waiting = [fixture.submit(b"22", true).unwrap(), fixture.submit(b"333", true).unwrap()];
    assert_eq!(fixture.budget.used(Account::Uploads), 4 + 2 + 3);
    fixture.jobs.cancel(&waiting[0]);
    assert!(matches!(waiting[0].state(), JobState::Cancelled));
    assert_eq!((fixture.budget.used(Account::Uploads), fixture.jobs.load().queued), (4 + 3, 1));
    fixture.submit(b"1", false).unwrap();
    fixture.open.send(()).unwrap();
    assert!(matches!(wait(&waiting[1]), JobState::Done(_)));
    fixture.jobs.cancel(&waiting[1]);
    assert!(matches!(waiting[1].state(), JobState::Done(_)), "what has ended stays as it is");
    assert!(matches!(wait(&first), JobState::Done(_)));
}

#[test]
fn results_are_kept_for_a_while_and_within_their_memory() {
    let fixture = fixture(settings());
    let large: &'static [u8] = &[b'x'; 600];
    let first = fixture.submit(large, true).unwrap();
    wait(&first);
    assert!(fixture.jobs.find(first.id).is_some());
    let second = fixture.submit(large, true).unwrap();
    wait(&second);
    assert!(fixture.jobs.find(first.id).is_none(), "the oldest goes first");
    assert!(fixture.jobs.find(second.id).is_some());
    assert_eq!(fixture.jobs.load().kept_bytes, 600);

    let short_lived = self::fixture(JobSettings { unfetched_ttl: Duration::from_millis(30), ..settings() });
    let job = short_lived.submit(b"1", true).unwrap();
    wait(&job);
    let began = Instant::now();
    while short_lived.jobs.find(job.id).is_some() {
        assert!(began.elapsed() < SOON, "the result did not expire");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(short_lived.jobs.load(), JobLoad::default());
}

/// A registry without threads, for jobs that are thought to take 1 s, and reports that are thought to take
/// `report`.
fn registry(workers: usize, report: Duration, job_time: Duration) -> (Arc<JobRegistry>, Arc<Memory>) {
    let registry = Arc::new(JobRegistry::new(JobSettings { workers, queue: 1000, job_time, ..settings() }));
    let budget = Memory::unlimited(&[(Account::Uploads, 1 << 20)]);
    for _ in 0..200 {
        registry.estimates.learn(registry.estimates.size(&work(&budget, b"1")), Duration::from_secs(1));
        registry.estimates.learn(registry.estimates.size(&report_on(&budget)), report);
    }
    (registry, budget)
}

fn report_on(budget: &Arc<Memory>) -> Work {
    Work { task: Task::Inspect { time_s: None }, ..work(budget, b"1") }
}

/// Gives each worker a job of 1 s.
fn occupy_all(registry: &JobRegistry, budget: &Arc<Memory>) {
    for _ in 0..registry.settings.workers {
        registry.submit(work(budget, b"1"), false).unwrap();
        assert!(matches!(registry.take(None), Next::Job(..)));
    }
}

#[test]
fn a_job_that_would_wait_for_too_long_is_refused_at_once() {
    let (registry, budget) = registry(2, Duration::from_secs(1), Duration::from_secs(40));
    assert_eq!(registry.load().wait, Duration::ZERO);
    occupy_all(&registry, &budget);
    let accepted: Vec<_> = std::iter::from_fn(|| registry.submit(work(&budget, b"1"), false).ok()).take(500).collect();
    // Each worker has one; 58 more fill the 30 s of both. A second or two more or less is the time that this took.
    assert!((56..=62).contains(&accepted.len()), "{}", accepted.len());
    let refusal = registry.submit(work(&budget, b"1"), false).unwrap_err();
    assert!(
        matches!(refusal, Refusal::TooLate { wait_ms: 30_000..=32_000, limit_ms: 30_000, retry_after_s: 1..=3, .. }),
        "{refusal:?}"
    );
    assert!(registry.load().wait > Duration::from_secs(28));
    // Batch jobs may wait for longer.
    assert!(registry.submit(work(&budget, b"1"), true).is_ok());
    accepted.iter().for_each(|job| registry.end(job, JobState::Cancelled));
    assert!(registry.submit(work(&budget, b"1"), false).is_ok(), "there is time again");
}

#[test]
fn a_job_does_not_fail_because_it_has_waited() {
    let fixture = fixture(JobSettings { job_time: Duration::from_millis(300), queue: 20, ..settings() });
    let first = fixture.occupy();
    let waiting: Vec<_> = (0..12).map(|_| fixture.submit(b"1", true).unwrap()).collect();
    // The first one is out of time, and its renderer goes on for longer than any job may take.
    assert!(matches!(wait(&first), JobState::Failed(_)));
    std::thread::sleep(Duration::from_millis(400));
    fixture.open.send(()).unwrap();
    for job in &waiting {
        assert!(matches!(wait(job), JobState::Done(_)), "{:?}", job.state());
        assert!(job.accepted.elapsed() > Duration::from_millis(300));
    }
}

/// Work of an owner.
fn work_of(budget: &Arc<Memory>, owner: &str) -> Work {
    Work { owner: Owner::new(owner), ..work(budget, b"1") }
}

/// Takes the next job and does it.
fn do_next(registry: &Arc<JobRegistry>) -> Arc<Job> {
    let Next::Job(job, ..) = registry.take(Some(Duration::ZERO)) else { panic!("no job") };
    registry.finish(&job, JobState::Cancelled, Duration::ZERO);
    job
}

#[test]
fn a_thumbnail_does_not_wait_behind_batch_jobs_and_these_do_not_starve() {
    let (registry, budget) = registry(1, Duration::from_secs(1), Duration::from_secs(40));
    let batch: Vec<_> = (0..12).map(|_| registry.submit(work(&budget, b"1"), true).unwrap()).collect();
    let thumbnails: Vec<_> = (0..8).map(|_| registry.submit(work(&budget, b"1"), false).unwrap()).collect();
    let order: String = (0..20).map(|_| if do_next(&registry).class == Class::Batch { 'b' } else { 't' }).collect();
    assert_eq!(order, "ttttbttttbbbbbbbbbbb");
    drop((batch, thumbnails));
    // Of several workers, one is left free for whoever waits.
    let (registry, budget) = self::registry(3, Duration::from_secs(1), Duration::from_secs(40));
    let jobs: Vec<_> = (0..5).map(|_| registry.submit(work(&budget, b"1"), true).unwrap()).collect();
    let running: Vec<_> = (0..2).map(|_| registry.take(Some(Duration::ZERO))).collect();
    assert!(running.iter().all(|next| matches!(next, Next::Job(..))));
    assert!(matches!(registry.take(Some(Duration::ZERO)), Next::Idle), "for a client that waits");
    registry.submit(work(&budget, b"1"), false).unwrap();
    assert!(matches!(registry.take(Some(Duration::ZERO)), Next::Job(..)));
    drop(jobs);
}

#[test]
fn owners_take_turns_and_leave_places_to_each_other() {
    let (registry, budget) = registry(1, Duration::from_secs(1), Duration::from_secs(40));
    let submit = |owner: &str| registry.submit(work_of(&budget, owner), true);
    (0..6).for_each(|_| _ = submit("a").unwrap());
    assert_eq!(do_next(&registry).owner, Owner::new("a"));
    (0..2).for_each(|_| _ = submit("b").unwrap());
    (0..2).for_each(|_| _ = submit("c").unwrap());
    let order: Vec<String> = (0..9).map(|_| do_next(&registry).owner.to_string()).collect();
    assert!(order[..6].iter().filter(|owner| *owner == "a").count() <= 2, "{order:?}");
    assert_eq!(order[6..], ["a", "a", "a"], "{order:?}");
    assert_eq!(registry.load().queued, 0);

    let (registry, budget) = self::registry(1, Duration::from_secs(1), Duration::from_secs(4000));
    let submit = |owner: &str| registry.submit(work_of(&budget, owner), true);
    let accepted = std::iter::from_fn(|| submit("a").ok()).take(2000).count();
    assert!((500..=751).contains(&accepted), "{accepted}");
    assert!(submit("a").is_err() && submit("b").is_ok(), "a quarter is left to others");
    // Whoever sends little waits little.
    let (light, heavy) = (submit("c").is_ok(), submit("a").unwrap_err().to_string());
    assert!(light, "{heavy}");
}

#[test]
fn one_clients_junk_does_not_cost_anothers_result() {
    let fixture = fixture(JobSettings { result_count: 4, queue: 100, ..settings() });
    let submit = |owner: &str| fixture.jobs.submit(work_of(&fixture.budget, owner), true).unwrap();
    let theirs = submit("b");
    wait(&theirs);
    // One after the other: of jobs that wait together, one with a smaller estimate may end before an older one.
    let junk: Vec<_> = (0..6).map(|_| submit("a")).inspect(|job| _ = wait(job)).collect();
    assert!(fixture.jobs.find(theirs.id).is_some(), "the oldest, but of another client");
    assert_eq!(fixture.jobs.load().kept, 4);
    assert!(fixture.jobs.find(junk[5].id).is_some() && fixture.jobs.find(junk[0].id).is_none());
}

#[test]
fn short_jobs_overtake_long_ones_for_a_while() {
    let (registry, budget) = registry(1, Duration::from_secs(8), Duration::from_secs(40));
    occupy_all(&registry, &budget);
    let long = registry.submit(report_on(&budget), false).unwrap();
    let short = registry.submit(work(&budget, b"1"), false).unwrap();
    // 4 s and, at most, a quarter of 40 s behind.
    assert!((5..7).contains(&(long.rank - short.rank).as_secs()), "{:?} {:?}", long.rank, short.rank);
    for expected in [short, long] {
        let Next::Job(job, ..) = registry.take(None) else { panic!("no job") };
        assert_eq!(job.id, expected.id);
        registry.finish(&job, JobState::Cancelled, Duration::ZERO);
    }
}

#[test]
fn an_idle_worker_drops_its_renderer() {
    let fixture = fixture(JobSettings { idle_time: Duration::from_millis(20), ..settings() });
    for round in 1..4 {
        assert!(matches!(wait(&fixture.submit(b"1", false).unwrap()), JobState::Done(_)));
        assert_eq!(fixture.renderers.load(Ordering::Relaxed), round, "a fresh renderer");
        let began = Instant::now();
        // The fixture and the factory hold the number as well.
        while Arc::strong_count(&fixture.renderers) > 2 {
            assert!(began.elapsed() < SOON, "the renderer was not dropped");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

#[test]
fn draining_finishes_what_was_accepted_and_takes_nothing_new() {
    let fixture = fixture(settings());
    let jobs = [fixture.occupy(), fixture.submit(b"1", true).unwrap()];
    fixture.jobs.drain();
    assert_eq!(fixture.submit(b"1", false).unwrap_err(), Refusal::Draining);
    fixture.open.send(()).unwrap();
    for job in &jobs {
        assert!(matches!(wait(job), JobState::Done(_)));
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    runtime.block_on(async { tokio::time::timeout(SOON, fixture.jobs.idle()).await.expect("idle") });
}

#[test]
fn many_threads_lose_no_job() {
    let fixture = fixture(JobSettings { workers: 3, queue: 8, ..settings() });
    let (done, refused) = (AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for round in 0..200 {
                    match fixture.submit(if round % 50 == 7 { b"panic" } else { b"1" }, round % 2 == 0) {
                        Ok(job) if round % 10 == 3 => fixture.jobs.cancel(&job),
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
    runtime.block_on(async { tokio::time::timeout(SOON, fixture.jobs.idle()).await.expect("idle") });
    assert_eq!(
        (fixture.budget.used(Account::Uploads), fixture.jobs.load().queued, fixture.jobs.load().running),
        (0, 0, 0)
    );
}

#[test]
fn the_views_of_a_sheet_are_estimated() {
    let (estimates, budget) = (Estimates::new(), Memory::unlimited(&[(Account::Uploads, 1 << 20)]));
    let estimate = |turntable: Option<u32>, columns: Option<u32>| {
        let mut work = work(&budget, b"v 0 0 0\n");
        let Task::Draw(spec) = &mut work.task else { panic!("it draws") };
        (spec.image.width_px, spec.image.height_px) = (512, 512);
        spec.sheet = turntable.map(|steps| Sheet { views: SheetViews::Turntable(steps), columns, labels: false });
        estimates.estimate(estimates.size(&work)).as_secs_f64()
    };
    let one = estimate(None, None);
    let (animation, grid) = (estimate(Some(24), None), estimate(Some(24), Some(6)));
    assert!((animation / one - 24.0).abs() < 0.01, "{animation} {one}");
    assert!(grid > 1.5 * one && grid < animation, "{grid} {one}");
}
