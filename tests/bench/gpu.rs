//! The GPU: time to its first picture, time of each stage by its own clock, and pictures per second
//! without encoding, on any number of workers.
//!
//!     cargo bench --bench gpu                              # bumpy tori of 70 k and 1 M triangles, 512 px
//!     cargo bench --bench gpu -- --mesh bunny.obj --look flat --size 256 --workers 16 --rounds 200
//!     cargo bench --bench gpu -- --samples adaptive
//!     cargo bench --bench gpu -- --samples 4,16,adaptive --pause-ms 20    # in turns, asked for now and then
//!     cargo bench --bench gpu -- --copy yes                # with a copy of each picture, as if none were read in place

// A tool for developers: giving up loudly is fine.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[allow(dead_code)] // others draw the other meshes
#[path = "stages/meshes.rs"]
mod meshes;

use std::hint::black_box;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use meshes::MeshFile;
use meshsnap_render::backend::gpu::{AtomicsChoice, Gpu, GpuKind, GpuRenderer};
use meshsnap_render::backend::{DrawTimes, Renderer as _};
use meshsnap_render::import::{self, Bundle};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{self, DrawPlan, Prepared};
use meshsnap_render::request::{self, Rules};
use meshsnap_render::scene::Scene;
use meshsnap_render::spec::BackendChoice;

const LOOKS: [&str; 4] = ["flat", "auto", "wire", "outline"];

fn main() {
    let (mut file, mut size, mut workers, mut rounds, mut copies) = (None, "512".to_owned(), 1, 60_usize, false);
    let mut looks = LOOKS.map(str::to_owned).to_vec();
    let (mut samples, mut pause) = ("4".to_owned(), Duration::ZERO);
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(name) = arguments.next() {
        let value = arguments.next().unwrap_or_else(|| panic!("{name} needs a value"));
        match name.as_str() {
            "--mesh" => file = Some(value),
            "--size" => size = value,
            "--workers" => workers = value.parse().expect("a number"),
            "--look" => looks = vec![value],
            "--samples" => samples = value,
            "--pause-ms" => pause = Duration::from_millis(value.parse().expect("a number")),
            "--copy" => copies = value == "yes",
            "--rounds" => rounds = value.parse().expect("a number"),
            other => panic!("there is no option {other}"),
        }
    }
    let files = match file {
        Some(path) => vec![meshes::file(&path)],
        None => meshes::made()
            .into_iter()
            .filter(|file| ["torus 70 k OBJ", "torus 1 M STL"].contains(&&*file.name))
            .collect(),
    };
    let began = Instant::now();
    let gpu = Arc::new(Gpu::open(GpuKind::Any, AtomicsChoice::Best, None).expect("a GPU"));
    println!("{}: opened in {:.0} ms; {size} px, {workers} workers", gpu.info().name, ms(began));
    for file in files {
        let mesh = read(&file);
        for look in &looks {
            measure(&gpu, (&file.name, &mesh), (look, &size, &samples), (workers, rounds.max(1)), (copies, pause));
        }
    }
}

fn ms(began: Instant) -> f64 {
    began.elapsed().as_secs_f64() * 1e3
}

fn read(file: &MeshFile) -> Mesh {
    let limits = Limits::default().with(|limits| limits.memory_bytes = 16 << 30);
    let bundle = Bundle::of_one(file.bytes.clone());
    import::import(&bundle, None, &limits, &mut Budget::new(&limits), &Deadline::default()).unwrap().0
}

/// Draws one look of a mesh `rounds` times on each worker, with each number of samples in turns, and prints a line for
/// each number.
fn measure(
    gpu: &Arc<Gpu>,
    (name, mesh): (&str, &Mesh),
    (look, size, samples): (&str, &str, &str),
    (workers, rounds): (usize, usize),
    (copies, pause): (bool, Duration),
) {
    let limits = Limits::default().with(|limits| limits.memory_bytes = 16 << 30);
    let (mut budget, deadline) = (Budget::new(&limits), Deadline::default());
    let rules = Rules { limits: limits.clone(), backend: BackendChoice::Gpu };
    let counts: Vec<&str> = samples.split(',').collect();
    let spec = |count: &&str| {
        let keys = [("style", look), ("size", size), ("view", "iso"), ("samples", *count)];
        let keys = keys.map(|(key, value)| (key.to_owned(), value.to_owned()));
        request::read(None, &keys, &rules).unwrap()
    };
    let specs: Vec<_> = counts.iter().map(spec).collect();
    let scenes: Vec<_> = specs.iter().map(|spec| Scene::new(mesh, spec, &mut budget).unwrap()).collect();
    let prepared = Prepared::default();
    let plans: Vec<_> =
        scenes.iter().map(|scene| plan::build_from(scene, &prepared, &mut budget, &deadline).unwrap()).collect();
    let draw = |renderer: &mut GpuRenderer, plan: &DrawPlan<'_>| {
        thread::sleep(pause);
        let began = Instant::now();
        let image = renderer.draw(plan, &deadline).unwrap();
        // As an encoder does.
        black_box(image.is_opaque());
        if copies {
            black_box(image.rgba.to_vec());
        }
        ms(began)
    };
    let first: Vec<f64> = plans.iter().map(|plan| draw(&mut GpuRenderer::new(gpu.clone()), plan)).collect();
    let all = Instant::now();
    let drawn = thread::scope(|scope| {
        let worker = || {
            let mut renderer = GpuRenderer::new(gpu.clone());
            let mut results = vec![(Vec::new(), DrawTimes::default()); plans.len()];
            for _ in 0..rounds {
                for (plan, (took, times)) in plans.iter().zip(&mut results) {
                    took.push(draw(&mut renderer, plan));
                    *times = renderer.draw_times();
                }
            }
            results
        };
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().map(|worker| worker.join().unwrap()).collect::<Vec<_>>()
    });
    let rate = (workers * rounds * plans.len()) as f64 / all.elapsed().as_secs_f64();
    for ((count, first), (took, times)) in counts.iter().zip(first).zip(drawn.into_iter().next().expect("a worker")) {
        println!(
            "{name}, {look}, samples {count}: first {first:.0} ms, {}, {rate:.0}/s; {}",
            spread(took),
            stages(&times)
        );
    }
}

/// The least and the median of times.
fn spread(mut took_ms: Vec<f64>) -> String {
    took_ms.sort_by(f64::total_cmp);
    format!("least {:.2} ms, median {:.2} ms", took_ms[0], took_ms[took_ms.len() / 2])
}

/// The times of stages on the device.
fn stages(times: &DrawTimes) -> String {
    let parts: Vec<String> =
        times.parts().map(|(stage, took)| format!("{} {:.3}", stage.name(), took.as_secs_f64() * 1e3)).collect();
    let mixed = if times.mixed_pixels > 0 { format!("; {} mixed pixels", times.mixed_pixels) } else { String::new() };
    let device: f64 = times.parts().map(|(_, took)| took.as_secs_f64() * 1e3).sum();
    format!("device {device:.3} ms: {}{mixed}", parts.join(", "))
}
