//! Jobs that are cancelled, meshes that are dropped and devices that are lost while jobs draw stored
//! meshes, in random order: every picture is right, and nothing is left of what has ended.

use std::sync::Arc;
use std::time::Duration;

use meshsnap_render::backend::HardwareHint;
use meshsnap_render::backend::cpu::DrawingThreads;
use meshsnap_render::import::Bundle;
use meshsnap_render::limits::Limits;
use meshsnap_server::jobs::{CpuThreads, Job, JobSettings, JobState, Jobs, Owner, Task, Work, pipeline_renderers};
use meshsnap_server::memory::{Account, Memory, MemoryLimits};
use meshsnap_server::residents::Residents;

use crate::support::fake_gpus::{Machine, Open};
use crate::support::scenes;

/// Processes, so to speak, one after the other, and rounds of jobs in each.
const LIVES: usize = 20;
const ROUNDS: usize = 50;

/// Room for two of the meshes.
const RESIDENT_BYTES: u64 = 24_000;

const STYLES: [&str; 3] = ["flat", "wire", "outline"];

/// A fan of so many triangles.
fn mesh(number: usize) -> Vec<u8> {
    let corners = 20 + number;
    let ring = (0..corners).map(|i| {
        let (sin, cos) = (i as f64 / corners as f64 * std::f64::consts::TAU).sin_cos();
        format!("v {cos} {sin} {}\n", 0.1 * (i % 3) as f64)
    });
    let faces = (0..corners).map(|i| format!("f 1 {} {}\n", i + 2, (i + 1) % corners + 2));
    std::iter::once("v 0 0 1\n".to_owned()).chain(ring).chain(faces).collect::<String>().into_bytes()
}

/// A process's parts, as the server puts them together.
struct Process {
    machine: Machine,
    residents: Arc<Residents>,
    budget: Arc<Memory>,
    jobs: Jobs,
}

impl Process {
    fn start() -> Self {
        let machine = Machine::new(&[Open::Hardware; 2 * ROUNDS], &[]);
        let memory = Memory::new(&MemoryLimits { all: u64::MAX / 2, job: u64::MAX / 4, accounts: Vec::new() });
        let residents = Arc::new(Residents::new(RESIDENT_BYTES, memory.clone()));
        let threads = CpuThreads::Shared(Arc::new(DrawingThreads::new(2)));
        let gpu = machine.host(HardwareHint::Maybe);
        let settings = JobSettings {
            workers: 3,
            queue: 100,
            idle_time: Duration::from_millis(1),
            overdue_grace: Duration::from_secs(60),
            job_time: Duration::from_secs(60),
            interactive_wait: Duration::from_secs(60),
            batch_wait: Duration::from_secs(60),
            result_ttl: Duration::from_secs(60),
            unfetched_ttl: Duration::from_secs(60),
            result_bytes: 1 << 20,
            result_count: 10,
            memory: memory.clone(),
            storage: None,
            metrics: None,
            code_of: |_| "failed",
            webhooks: None,
        };
        let renderers = pipeline_renderers(gpu, threads, Limits::default(), residents.clone());
        let jobs = Jobs::start(settings, renderers).unwrap();
        Self { machine, residents, budget: memory, jobs }
    }

    fn submit(&self, mesh_number: usize, style: &str, backend: &str) -> Arc<Job> {
        let spec = scenes::spec(&[("style", style), ("size", "24"), ("backend", backend)]);
        let bytes = mesh(mesh_number);
        let memory = self.budget.share(Account::Uploads);
        memory.grow(bytes.len() as u64).unwrap();
        let work = Work {
            bundle: Bundle::of_one(bytes),
            format_in: None,
            mesh_key: Some(format!("mesh {mesh_number}")),
            task: Task::Draw(Box::new(spec)),
            memory: Arc::new(memory),
            lender: None,
            recipe: None,
            owner: Owner::default(),
            request_id: "".into(),
            holds: [].into(),
            claim: None,
            webhook: None,
        };
        self.jobs.submit(work, false).unwrap()
    }

    /// Pulls the devices out that are there.
    fn lose_devices(&self) {
        for device in &self.machine.0.lock().unwrap().devices {
            let _ = device.lost.set("pulled out".into());
        }
    }
}

fn end_of(runtime: &tokio::runtime::Runtime, job: &Job) -> JobState {
    let ended = async { tokio::time::timeout(Duration::from_secs(60), job.ended()).await };
    runtime.block_on(ended).expect("the job ends")
}

/// Numbers that look random: xorshift64, Marsaglia 2003.
fn next(state: &mut u64) -> usize {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 8) as usize
}

#[test]
fn a_thousand_interleavings_leave_every_picture_right_and_nothing_behind() {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    let mut random = 0x2545_F491_4F6C_DD1D_u64;
    // Nothing interferes with these. The devices draw as the CPU does.
    let alone = Process::start();
    let pictures: Vec<_> = (0..15)
        .map(|i| match end_of(&runtime, &alone.submit(i / 3, STYLES[i % 3], "cpu")) {
            JobState::Done(finished) => finished.content.to_vec(),
            other => panic!("{other:?}"),
        })
        .collect();
    ends_clean(&runtime, alone);
    let (mut rounds, mut done, mut cancelled, mut lost) = (0, 0, 0, 0);
    for _ in 0..LIVES {
        let process = Process::start();
        for _ in 0..ROUNDS {
            let jobs: Vec<_> = (0..1 + next(&mut random) % 4)
                .map(|_| {
                    let (mesh, style) = (next(&mut random) % 5, next(&mut random) % 3);
                    let backend = ["auto", "auto", "gpu", "cpu"][next(&mut random) % 4];
                    (process.submit(mesh, STYLES[style], backend), 3 * mesh + style)
                })
                .collect();
            std::thread::sleep(Duration::from_micros(next(&mut random) as u64 % 300));
            match next(&mut random) % 4 {
                0 => process.jobs.cancel(&jobs[0].0),
                1 => process.residents.forget(["mesh", "mesh 1", "mesh 2"][next(&mut random) % 3]),
                2 => process.lose_devices(),
                _ => {}
            }
            for (job, picture) in jobs {
                match end_of(&runtime, &job) {
                    JobState::Done(finished) => {
                        assert!(finished.content == pictures[picture], "round {rounds}: picture {picture}");
                        done += 1;
                    }
                    JobState::Cancelled => cancelled += 1,
                    // Its device was lost twice, and it asked for the GPU.
                    JobState::Failed(failure) if failure.to_string().contains("pulled out") => lost += 1,
                    other => panic!("round {rounds}: {other:?}"),
                }
            }
            assert!(process.residents.load().bytes <= RESIDENT_BYTES, "{:?}", process.residents.load());
            rounds += 1;
        }
        ends_clean(&runtime, process);
    }
    println!("{done} drawn, {cancelled} cancelled, {lost} lost");
    assert_eq!(rounds, LIVES * ROUNDS);
    assert!(done > 1000 && cancelled > 0, "{done} drawn, {cancelled} cancelled");
}

/// The next jobs are right, and in the end nobody holds meshes or devices.
fn ends_clean(runtime: &tokio::runtime::Runtime, process: Process) {
    for mesh in 0..5 {
        assert!(matches!(end_of(runtime, &process.submit(mesh, "flat", "auto")), JobState::Done(_)));
    }
    let Process { machine, residents, budget, jobs } = process;
    jobs.drain();
    runtime.block_on(async { tokio::time::timeout(Duration::from_secs(60), jobs.idle()).await.expect("idle") });
    jobs.join(Duration::from_secs(60));
    drop(jobs);
    assert_eq!(budget.used(Account::Uploads), 0);
    assert_eq!(budget.used(Account::Jobs), 0);
    assert_eq!(budget.used(Account::Answers), 0, "somebody holds a picture");
    // The clock's thread ends a moment after the workers.
    let began = std::time::Instant::now();
    let devices = std::mem::take(&mut machine.0.lock().unwrap().devices);
    while devices.iter().any(|device| Arc::strong_count(device) > 1) || Arc::strong_count(&residents) > 1 {
        assert!(began.elapsed() < Duration::from_secs(60), "somebody holds a device or the meshes");
        std::thread::sleep(Duration::from_millis(1));
    }
}
