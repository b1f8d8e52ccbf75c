//! The choice of back-end: with fake devices that are missing, wrong, busy or lost, or that refuse
//! a plan; and once with the machine's own.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuKind;
use meshsnap_render::backend::{
    BackendKind, Backends, CostModel, DrawError, GpuHost, GpuState, HardwareHint, Opener, Renderer as _,
};
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;
use meshsnap_render::spec::BackendChoice;
use meshsnap_server::warm_up::WarmUp;

use crate::support::fake_gpus::{Act, Machine, Open, job};
use crate::support::server::{CUBE_OBJ, Server, meshsnap};
use crate::support::skip::{Need, skip};
use BackendChoice::{Auto, Cpu, Gpu};
use BackendKind::{Cpu as ByCpu, Gpu as ByGpu};

/// Draws a job, checks the picture, and says who drew it.
fn draw(backends: &mut Backends, choice: BackendChoice) -> Result<BackendKind, DrawError> {
    let chosen = backends.draw(choice, &job(), None, &Deadline::default())?;
    assert_eq!(chosen.image, CpuRenderer::new(1).draw(&job(), &Deadline::default()).unwrap());
    Ok(chosen.backend)
}

/// A job's outcome: the back-end that draws it, or its error.
type Want = Result<BackendKind, &'static str>;

#[track_caller]
fn check(backends: &mut Backends, jobs: &[(BackendChoice, Want)]) {
    for (i, (choice, want)) in jobs.iter().enumerate() {
        match (draw(backends, *choice), want) {
            (Ok(got), Ok(want)) => assert_eq!(got, *want, "job {i}"),
            (Err(error), Err(want)) => assert!(error.to_string().contains(want), "job {i}: {error}"),
            (got, want) => panic!("job {i}: {got:?}, want {want:?}"),
        }
    }
}

fn none() -> HardwareHint {
    HardwareHint::None { reason: "no node".into() }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn the_choice_follows_what_the_machine_has() {
    use GpuKind::{Any, Hardware};
    use HardwareHint::Maybe;
    // Hint, what opening finds, jobs, the kinds that were opened, the state after that.
    type Case<'a> = (HardwareHint, &'a [Open], &'a [(BackendChoice, Want)], &'a [GpuKind], GpuState, Option<&'a str>);
    let cases: &[Case<'_>] = &[
        // A CPU render opens nothing, and without a node neither does `auto`.
        (Maybe, &[], &[(Cpu, Ok(ByCpu))], &[], GpuState::NotOpened, None),
        (none(), &[], &[(Auto, Ok(ByCpu)), (Auto, Ok(ByCpu))], &[], GpuState::None, Some("no node")),
        // Hardware serves both, opened by whichever comes first.
        (Maybe, &[Open::Hardware], &[(Auto, Ok(ByGpu)), (Gpu, Ok(ByGpu))], &[Hardware], GpuState::Ready, None),
        (Maybe, &[Open::Hardware], &[(Gpu, Ok(ByGpu)), (Auto, Ok(ByGpu))], &[Any], GpuState::Ready, None),
        // Software is for who asks for it.
        (
            Maybe,
            &[Open::Software, Open::Software],
            &[(Auto, Ok(ByCpu)), (Gpu, Ok(ByGpu)), (Auto, Ok(ByCpu)), (Gpu, Ok(ByGpu))],
            &[Hardware, Any],
            GpuState::Ready,
            Some("`auto` means the CPU all the same: software alone"),
        ),
        (
            Maybe,
            &[Open::Software],
            &[(Gpu, Ok(ByGpu)), (Auto, Ok(ByCpu)), (Gpu, Ok(ByGpu))],
            &[Any],
            GpuState::Ready,
            Some("`auto` means the CPU all the same: fake 1 is no hardware"),
        ),
        (
            none(),
            &[Open::Software],
            &[(Auto, Ok(ByCpu)), (Gpu, Ok(ByGpu))],
            &[Any],
            GpuState::Ready,
            Some("`auto` means the CPU all the same: no node"),
        ),
        // Nothing there, which is found out once for each kind.
        (
            Maybe,
            &[Open::Absent, Open::Absent],
            &[(Auto, Ok(ByCpu)), (Gpu, Err("nothing there")), (Auto, Ok(ByCpu)), (Gpu, Err("nothing there"))],
            &[Hardware, Any],
            GpuState::None,
            Some("nothing there"),
        ),
        (
            Maybe,
            &[Open::Absent],
            &[(Gpu, Err("nothing there")), (Auto, Ok(ByCpu))],
            &[Any],
            GpuState::None,
            Some("nothing there"),
        ),
        // Not to be trusted: found out once.
        (
            Maybe,
            &[Open::Wrong],
            &[(Auto, Ok(ByCpu)), (Gpu, Err("no GPU to draw on: fake 1: it draws the probe wrong")), (Auto, Ok(ByCpu))],
            &[Hardware],
            GpuState::Failed,
            Some("fake 1: it draws the probe wrong: 1 of 576 pixels where samples = 1"),
        ),
        (
            Maybe,
            &[Open::Broken],
            &[(Gpu, Err("no such shader")), (Auto, Ok(ByCpu))],
            &[Any],
            GpuState::Failed,
            Some("fake 1: it does not draw the probe: the GPU cannot draw this: no such shader"),
        ),
        (
            Maybe,
            &[Open::Panics],
            &[(Auto, Ok(ByCpu)), (Gpu, Err("panicked"))],
            &[Hardware],
            GpuState::Failed,
            Some("opening the GPU panicked; the log has more"),
        ),
    ];
    let mut checked = 0;
    for (hint, opens, jobs, opened, state, reason) in cases {
        let machine = Machine::new(opens, &[]);
        let host = machine.host(hint.clone());
        check(&mut Backends::new(host.clone(), 1), jobs);
        assert_eq!(machine.opened(), *opened, "case {checked}");
        let status = host.status();
        assert_eq!((status.state, status.reason.as_deref()), (*state, *reason), "case {checked}");
        assert_eq!(status.info.is_some(), *state == GpuState::Ready, "case {checked}");
        checked += 1;
    }
    assert_eq!(checked, 12);
}

/// Jobs whose device is being opened have their pipelines made while it draws the probe. What becomes of that
/// changes no picture.
#[test]
fn a_device_is_made_ready_while_it_is_probed() {
    let cases = [(Open::Hardware, false, ByGpu), (Open::Hardware, true, ByGpu), (Open::Wrong, true, ByCpu)];
    for (open, ready_panics, by) in cases {
        let machine = Machine::new(&[open], &[]);
        let (open_gate, gate) = std::sync::mpsc::channel();
        let mut story = machine.0.lock().unwrap();
        (story.ready_panics, story.probe_gate) = (ready_panics, Some(gate));
        drop(story);
        let host = machine.host(HardwareHint::Maybe);
        let made_ready = || machine.0.lock().unwrap().made_ready;
        std::thread::scope(|scope| {
            let began = Instant::now();
            // The gate is shut: neither the job that opens the device has a picture, nor the one that waits.
            let jobs = [1, 2].map(|count| {
                let job = scope.spawn(|| draw(&mut Backends::new(host.clone(), 1), Auto));
                while made_ready() < count {
                    assert!(began.elapsed() < Duration::from_secs(30), "{} made ready", made_ready());
                    std::thread::sleep(Duration::from_millis(1));
                }
                job
            });
            assert!(!machine.0.lock().unwrap().drawn_px.contains(&job().width_px));
            open_gate.send(()).unwrap();
            for job in jobs {
                assert_eq!(job.join().unwrap().unwrap(), by, "{open:?}");
            }
        });
        // An open device is not made ready again.
        check(&mut Backends::new(host, 1), &[(Auto, Ok(by))]);
        assert_eq!(made_ready(), 2);
    }
}

#[test]
fn a_refused_plan_goes_to_the_cpu_and_the_gpu_stays() {
    let machine = Machine::new(&[Open::Hardware], &[Act::Refuses, Act::Refuses, Act::Draws]);
    let mut backends = Backends::new(machine.host(HardwareHint::Maybe), 1);
    check(&mut backends, &[(Auto, Ok(ByCpu)), (Gpu, Err("out of memory")), (Auto, Ok(ByGpu))]);
}

#[test]
fn a_job_that_was_stopped_is_not_drawn_again() {
    let machine = Machine::new(&[Open::Hardware], &[Act::Stops]);
    let mut backends = Backends::new(machine.host(HardwareHint::Maybe), 1);
    check(&mut backends, &[(Auto, Err("stopped")), (Auto, Ok(ByGpu))]);
}

#[test]
fn a_lost_device_is_opened_again_and_the_job_drawn_again() {
    for lose in [Act::Loses, Act::PanicsLost] {
        let machine = Machine::new(&[Open::Hardware; 3], &[lose, Act::Draws, Act::Draws, lose]);
        let host = machine.host(HardwareHint::Maybe);
        let mut backends = Backends::new(host.clone(), 1);
        check(&mut backends, &[(Auto, Ok(ByGpu)), (Gpu, Ok(ByGpu)), (Gpu, Ok(ByGpu)), (Auto, Ok(ByGpu))]);
        assert_eq!(machine.opened().len(), 3);
        assert_eq!(host.status().state, GpuState::Ready);
        assert_eq!(host.status().info.unwrap().name, "fake 3");
    }
}

#[test]
fn lost_in_three_jobs_in_a_row_means_the_cpu() {
    // Two jobs lose it twice; the third loses it once and gives up.
    let machine = Machine::new(&[Open::Hardware; 9], &[Act::Loses; 7]);
    let host = machine.host(HardwareHint::Maybe);
    let mut backends = Backends::new(host.clone(), 1);
    check(&mut backends, &[(Auto, Ok(ByCpu)), (Auto, Ok(ByCpu))]);
    assert!(host.status().reason.unwrap().contains("pulled out"));
    check(&mut backends, &[(Auto, Ok(ByCpu)), (Auto, Ok(ByCpu)), (Auto, Ok(ByCpu))]);
    assert_eq!(machine.opened().len(), 5, "given up, and opened no more");
    let status = host.status();
    assert_eq!(status.state, GpuState::Failed);
    assert!(status.reason.as_ref().unwrap().contains("lost in 3 jobs in a row"), "{status:?}");
    // A request for it by name gets the error, or the picture once it works again; `auto` stays
    // with its choice.
    check(&mut backends, &[(Gpu, Err("pulled out")), (Gpu, Ok(ByGpu)), (Auto, Ok(ByCpu))]);
    let status = host.status();
    assert_eq!(status.state, GpuState::Ready);
    assert!(status.reason.unwrap().contains("lost in 3 jobs in a row"));
}

#[test]
fn a_gpu_that_is_lost_often_rests_and_is_tried_again() {
    // Lost in three jobs, in a trial, and then well.
    let machine = Machine::new(&[Open::Hardware; 9], &[Act::Loses; 6]);
    let clock_s = Arc::new(AtomicU64::new(0));
    let read = clock_s.clone();
    let host = Arc::into_inner(machine.host(HardwareHint::Maybe)).unwrap();
    let host = Arc::new(host.with_clock(Box::new(move || Duration::from_secs(read.load(Ordering::Relaxed)))));
    let pass = |seconds: u64| clock_s.fetch_add(seconds, Ordering::Relaxed);
    let mut backends = Backends::new(host.clone(), 1);
    check(&mut backends, &[(Auto, Ok(ByCpu)); 3]);
    let opened = machine.opened().len();
    pass(59);
    check(&mut backends, &[(Auto, Ok(ByCpu)); 3]);
    assert!(!backends.has_gpu() && host.may_have_hardware());
    assert!(host.status().reason.unwrap().contains("tried again after 60 s"));
    assert_eq!(machine.opened().len(), opened, "nobody opens it while it rests");
    pass(1);
    assert!(backends.has_gpu());
    check(&mut backends, &[(Auto, Ok(ByCpu)); 2]);
    let reason = host.status().reason.unwrap();
    assert!(reason.contains("lost again when it was tried") && reason.contains("after 120 s"), "{reason}");
    pass(119);
    check(&mut backends, &[(Auto, Ok(ByCpu))]);
    pass(1);
    check(&mut backends, &[(Auto, Ok(ByGpu)); 2]);
    let status = host.status();
    assert_eq!((status.state, status.reason), (GpuState::Ready, None));
}

#[test]
fn a_good_job_between_losses_begins_the_count_anew() {
    let acts = [[Act::Loses, Act::Draws]; 2].concat();
    let acts = [acts.clone(), vec![Act::Draws], acts, vec![Act::Draws]].concat();
    let machine = Machine::new(&[Open::Hardware; 5], &acts);
    let mut backends = Backends::new(machine.host(HardwareHint::Maybe), 1);
    check(&mut backends, &[(Auto, Ok(ByGpu)); 6]);
    assert_eq!(machine.opened().len(), 5);
}

#[test]
fn a_device_that_cannot_be_opened_again_counts_as_lost() {
    let machine = Machine::new(&[Open::Hardware, Open::Absent, Open::Wrong, Open::Hardware], &[Act::Loses]);
    let mut backends = Backends::new(machine.host(HardwareHint::Maybe), 1);
    // Lost and not found; found in no state to draw, and then well again.
    check(&mut backends, &[(Auto, Ok(ByCpu)), (Auto, Ok(ByGpu)), (Auto, Ok(ByGpu))]);
    assert_eq!(machine.opened().len(), 4);

    let machine =
        Machine::new(&[Open::Hardware, Open::Absent, Open::Absent, Open::Absent, Open::Absent], &[Act::Loses]);
    let host = machine.host(HardwareHint::Maybe);
    check(&mut Backends::new(host.clone(), 1), &[(Auto, Ok(ByCpu)); 6]);
    assert_eq!(machine.opened().len(), 5, "after the third job nobody looks for it");
    assert!(host.status().reason.unwrap().contains("3 jobs in a row"));
}

#[test]
fn workers_share_the_device_and_one_loss_is_one_loss() {
    let machine = Machine::new(&[Open::Hardware; 2], &[]);
    let host = machine.host(HardwareHint::Maybe);
    let mut workers: Vec<_> = (0..5).map(|_| Backends::new(host.clone(), 1)).collect();
    for worker in &mut workers {
        check(worker, &[(Cpu, Ok(ByCpu)), (Auto, Ok(ByGpu)), (Auto, Ok(ByGpu))]);
    }
    // One renderer for each worker and one for the probe.
    assert_eq!((machine.opened().len(), machine.0.lock().unwrap().renderers), (1, 6));
    let device = machine.0.lock().unwrap().devices.remove(0);
    device.lost.set("pulled out".into()).unwrap();
    for worker in &mut workers {
        check(worker, &[(Auto, Ok(ByGpu))]);
    }
    assert_eq!((machine.opened().len(), machine.0.lock().unwrap().renderers), (2, 12));
    assert_eq!(Arc::strong_count(&device), 1, "nobody holds the lost device");
    check(&mut workers[0], &[(Auto, Ok(ByGpu))]);
}

#[test]
fn while_the_gpu_is_busy_the_cpu_draws_what_is_small() {
    let (open, gate) = std::sync::mpsc::channel();
    let machine = Machine::new(&[Open::Hardware], &[Act::Waits]);
    machine.0.lock().unwrap().gate = Some(gate);
    let host = machine.host(HardwareHint::Maybe);
    let busy = std::thread::spawn({
        let host = host.clone();
        move || draw(&mut Backends::new(host, 1), Auto).unwrap()
    });
    let began = Instant::now();
    while machine.0.lock().unwrap().gate.is_some() {
        assert!(began.elapsed() < Duration::from_secs(30), "the GPU got no job");
        std::thread::sleep(Duration::from_millis(1));
    }
    // The job is small, and nobody has to wait for it.
    let mut backends = Backends::new(host, 1);
    check(&mut backends, &[(Auto, Ok(ByCpu)), (Gpu, Ok(ByGpu)), (Auto, Ok(ByCpu))]);
    assert!(!backends.draw(Auto, &job(), None, &Deadline::default()).unwrap().is_substitute);
    open.send(()).unwrap();
    assert_eq!(busy.join().unwrap(), ByGpu);
    check(&mut backends, &[(Auto, Ok(ByGpu))]);
}

/// A device is probed with a number of samples before it first draws with it.
#[test]
fn a_gpu_that_is_wrong_with_many_samples_draws_none_of_them() {
    let machine = Machine::new(&[Open::WrongAtSixteen], &[]);
    let host = machine.host(HardwareHint::Maybe);
    let mut backends = Backends::new(host.clone(), 1);
    check(&mut backends, &[(Auto, Ok(ByGpu))]);
    assert_eq!(host.status().state, GpuState::Ready);
    let fine = || DrawPlan { samples: 16, ..job() };
    let chosen = backends.draw(Auto, &fine(), None, &Deadline::default()).unwrap();
    let want = CpuRenderer::new(1).draw(&fine(), &Deadline::default()).unwrap();
    assert_eq!((chosen.backend, chosen.image), (ByCpu, want));
    let status = host.status();
    assert_eq!(status.state, GpuState::Failed);
    assert!(status.reason.is_some_and(|reason| reason.contains("where samples = 16")));
    check(&mut backends, &[(Auto, Ok(ByCpu)), (Gpu, Err("where samples = 16"))]);
    assert_eq!(machine.opened().len(), 1, "it is not opened again");
}

/// Number of styles.
const STYLES: usize = 12;

/// Of these, the styles without wires: small pictures have them with more samples.
const STYLES_OF_SMALL: usize = 8;

#[test]
fn a_warm_gpu_has_drawn_every_style() {
    let machine = Machine::new(&[Open::Hardware], &[]);
    let warm_up = WarmUp::start(&machine.host(HardwareHint::Maybe), Auto);
    assert!(warm_up.wait(Duration::from_secs(30)), "it takes too long");
    let drawn = |machine: &Machine| machine.0.lock().unwrap().drawn_px.iter().filter(|&&px| px == 64).count();
    // Each with few triangles, and for each number of samples one with many.
    let looks = STYLES + STYLES_OF_SMALL;
    assert_eq!((machine.opened(), drawn(&machine)), (vec![GpuKind::Hardware], looks + 2));
    assert_eq!(machine.0.lock().unwrap().made_ready, looks);
    assert_eq!(machine.0.lock().unwrap().made_ready_for_load, 2 * looks);
    // Without hardware, or need of it, nothing is opened. A software GPU, or none, is left alone.
    let cases: [(&[Open], HardwareHint, BackendChoice); 4] = [
        (&[], none(), Auto),
        (&[], HardwareHint::Maybe, Cpu),
        (&[Open::Software], HardwareHint::Maybe, Auto),
        (&[Open::Absent], HardwareHint::Maybe, Gpu),
    ];
    for (opens, hint, backend) in cases {
        let machine = Machine::new(opens, &[]);
        assert!(WarmUp::start(&machine.host(hint), backend).wait(Duration::from_secs(30)));
        assert_eq!((machine.opened().len(), drawn(&machine)), (opens.len(), 0), "{opens:?} {backend:?}");
    }
}

#[test]
fn a_bug_in_drawing_costs_its_job() {
    let machine = Machine::new(&[Open::Hardware], &[Act::Panics, Act::Draws]);
    let mut backends = Backends::new(machine.host(HardwareHint::Maybe), 1);
    assert!(catch_unwind(AssertUnwindSafe(|| draw(&mut backends, Auto))).is_err());
    check(&mut backends, &[(Auto, Ok(ByGpu))]);
}

#[test]
fn a_report_does_not_wait_for_a_driver() {
    let (entered, wait_entered) = std::sync::mpsc::channel();
    let (release, wait_release) = std::sync::mpsc::channel::<()>();
    let ends = Mutex::new((entered, wait_release));
    let open: Box<Opener> = Box::new(move |_| {
        let ends = ends.lock().unwrap();
        ends.0.send(()).unwrap();
        let _ = ends.1.recv();
        Err(DrawError::NoGpu("slow and nothing".into()))
    });
    let host = Arc::new(GpuHost::with_opener(HardwareHint::Maybe, CostModel::fixed(), open));
    let worker = std::thread::spawn({
        let host = host.clone();
        move || draw(&mut Backends::new(host, 1), Auto).unwrap()
    });
    wait_entered.recv().unwrap();
    assert_eq!(host.status().state, GpuState::NotOpened);
    drop(release);
    assert_eq!(worker.join().unwrap(), ByCpu);
    assert_eq!(host.status().state, GpuState::None);
}

/// The real thing: a GPU by name, `auto` as the machine has it, and what is said about both.
#[test]
fn a_server_says_who_drew() {
    let server = Server::start_with(meshsnap().args(["serve", "--listen", "127.0.0.1:0"]));
    let status = || server.get("/v1/capabilities").json()["backend"]["gpu"].take();
    let maps = || std::fs::read_to_string(format!("/proc/{}/maps", server.pid())).unwrap_or_default();

    let auto = server.post("/v1/render?size=32", CUBE_OBJ);
    let picture = auto.picture(32, 32);
    let drawn_by = auto.header("x-render-backend").unwrap().to_owned();
    if status()["state"] == "none" && status()["reason"].as_str().unwrap().contains("/dev") {
        assert_eq!(drawn_by, "cpu");
        assert!(!maps().contains("libvulkan"), "auto loaded Vulkan on a machine without a GPU");
    }
    assert_eq!(drawn_by == "gpu", status()["state"] == "ready");

    let named = server.post("/v1/render?size=32&backend=gpu", CUBE_OBJ);
    if named.status != 200 && status()["state"] == "none" {
        println!("no Vulkan here: {}", status());
        skip(Need::Gpu, "Vulkan");
        named.problem(422, "backend_unavailable");
        return;
    }
    assert_eq!(named.header("x-render-backend"), Some("gpu"), "{named:?}");
    let same = named.picture(32, 32).pixels().zip(picture.pixels()).filter(|(a, b)| a == b).count();
    assert!(same > 32 * 32 * 9 / 10, "{same} pixels of 1024 are the same");
    let gpu = status();
    println!("{gpu}");
    assert_eq!(gpu["state"], "ready");
    if drawn_by == "cpu" {
        assert!(gpu["reason"].as_str().is_some_and(|reason| reason.starts_with("`auto` means the CPU")), "{gpu}");
    }
    assert!(gpu["name"].as_str().is_some_and(|name| !name.is_empty()), "{gpu}");
    let again = server.post("/v1/render?size=32", CUBE_OBJ);
    assert_eq!(again.header("x-render-backend"), Some(drawn_by.as_str()));
    assert_eq!(server.post("/v1/render?size=32&backend=cpu", CUBE_OBJ).header("x-render-backend"), Some("cpu"));
    memory_stays_flat(&server);
}

/// A driver may keep something of every job: a software one keeps kernels. Its pipelines are new after 128 jobs.
/// Memory steps up by about 200 MiB the first two or three times, when old ones and new ones are there together,
/// and then stays: 327, 495, 524, 546, 551, 560, 560 MiB after 128 jobs each.
fn memory_stays_flat(server: &Server) {
    let mut drawn = 0;
    let mut draw = |count: usize| {
        for _ in 0..count {
            let style = ["flat", "wire", "outline"][drawn % 3];
            // A camera of its own each, or kept pictures would answer.
            let keys = format!("size=32&backend=gpu&style={style}&camera.azimuth_deg={}", drawn as f64 / 8.0);
            let answer = server.post(&format!("/v1/render?{keys}"), CUBE_OBJ);
            assert_eq!((answer.status, answer.header("x-render-backend")), (200, Some("gpu")));
            drawn += 1;
        }
        server.resident_bytes() / (1 << 20)
    };
    // All readings are of pipelines of the same age.
    let warm = draw(3 * 128);
    let later: Vec<u64> = (0..3).map(|_| draw(128)).collect();
    let least = later.iter().min().copied().unwrap_or(u64::MAX);
    println!("resident memory: {warm} MiB, then {later:?} MiB");
    assert!(least <= warm + 64, "resident memory grew from {warm} MiB to {later:?} MiB, 128 jobs each");
}
