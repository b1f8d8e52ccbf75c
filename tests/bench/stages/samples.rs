//! Time of drawing by samples per pixel: fixed numbers of them, and adaptive ones.

use std::time::Instant;

use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::import::Bundle;

use crate::meshes::MeshFile;
use crate::rounds::{draw, import, plan, spec};

const SAMPLES: [&str; 4] = ["1", "4", "16", "adaptive"];
const LOOKS: [&str; 2] = ["flat", "smooth"];

/// Prints the medians of interleaved rounds: milliseconds, and ratios to 4 samples.
pub fn print(meshes: &[MeshFile], threads: usize, rounds: usize) {
    println!("512 x 512 px, {threads} threads; medians of {rounds} interleaved rounds, ms, and ratios to 4 samples\n");
    println!("| mesh | look | 1 | 4 | 16 | adaptive | mixed pixels | 16 / 4 | adaptive / 4 | adaptive / 16 |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let mut cpu = CpuRenderer::new(threads);
    for file in meshes {
        let mesh = import(&Bundle::of_one(file.bytes.clone()));
        for look in LOOKS {
            let specs = SAMPLES.map(|samples| spec(&[("style", look), ("samples", samples)]));
            let plans: Vec<_> = specs.iter().map(|spec| plan(&mesh, spec)).collect();
            let (mut times, mut mixed) = (SAMPLES.map(|_| Vec::new()), 0);
            for round in 0..=rounds {
                for (plan, times) in plans.iter().zip(&mut times) {
                    let began = Instant::now();
                    draw(&mut cpu, plan).unwrap();
                    // The first round warms up.
                    if round > 0 {
                        times.push(began.elapsed().as_secs_f64() * 1e3);
                    }
                }
                mixed = cpu.draw_times().mixed_pixels;
            }
            let [one, four, sixteen, adaptive] = times.map(median);
            println!(
                "| {} | {look} | {one:.2} | {four:.2} | {sixteen:.2} | {adaptive:.2} | {mixed} | {:.2} | {:.2} | {:.2} |",
                file.name,
                sixteen / four,
                adaptive / four,
                adaptive / sixteen
            );
        }
    }
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
