//! The visibility stage of the CPU alone, on one thread: the time that one more layer of triangles
//! takes, large ones or small ones. It is found from the times of pictures of two and of six
//! layers, so that the other stages drop out.

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;

use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::import::Bundle;

use crate::rounds::{draw, import, plan, spec};

/// Pixels a side.
const SIZE: usize = 1024;

/// Samples of a pixel, and bytes of a sample.
const SAMPLES: usize = 4;
const SAMPLE_BYTES: usize = 8;

/// Layers, and layers more.
const LAYERS: [usize; 2] = [2, 6];

/// Prints both rates, each beside its goal.
pub fn print() {
    // Two triangles fill the picture.
    let large_ms = ms_per_layer(1);
    let bytes = SIZE * SIZE * SAMPLES * SAMPLE_BYTES;
    let memset_ms = memset_ms(bytes);
    println!(
        "large triangles: {:.2} G samples/s, {:.2} of memset (goal: 0.5)",
        (SIZE * SIZE * SAMPLES) as f64 / 1e6 / large_ms,
        memset_ms / large_ms
    );
    // Legs of 2 sqrt(2) px.
    let cells = (SIZE as f64 / 8_f64.sqrt()).round() as usize;
    let small_ms = ms_per_layer(cells);
    println!("triangles of 4 px: {:.1} M/s (goal: 40)", (2 * cells * cells) as f64 / 1e3 / small_ms);
}

/// Time of one layer of `cells` x `cells` squares, two triangles each, that fills the picture:
/// each layer lies in front of the last.
fn ms_per_layer(cells: usize) -> f64 {
    let look = [
        ("style", "flat"),
        ("view", "front"),
        ("up", "y"),
        ("camera.projection", "orthographic"),
        ("camera.margin", "0"),
        ("size", &SIZE.to_string()),
        ("samples", &SAMPLES.to_string()),
    ];
    let spec = spec(&look);
    let mut cpu = CpuRenderer::new(1);
    let meshes = LAYERS.map(|layers| import(&Bundle::of_one(obj(layers, cells))));
    let plans = [plan(&meshes[0], &spec), plan(&meshes[1], &spec)];
    let mut least = [f64::INFINITY; 2];
    for _ in 0..40 {
        for (plan, least) in plans.iter().zip(&mut least) {
            let began = Instant::now();
            black_box(draw(&mut cpu, plan).unwrap());
            *least = least.min(began.elapsed().as_secs_f64() * 1e3);
        }
    }
    (least[1] - least[0]) / (LAYERS[1] - LAYERS[0]) as f64
}

/// Time to fill so many bytes in the cache, as much at a time as a band of rows has.
fn memset_ms(bytes: usize) -> f64 {
    let mut buffer = vec![1_u8; 512 << 10];
    let mut least = f64::INFINITY;
    for round in 0..40 {
        let began = Instant::now();
        for _ in 0..bytes / buffer.len() {
            buffer.fill(round);
            black_box(&mut buffer);
        }
        least = least.min(began.elapsed().as_secs_f64() * 1e3);
    }
    least
}

fn obj(layers: usize, cells: usize) -> Vec<u8> {
    let mut text = String::new();
    let corners = (cells + 1) * (cells + 1);
    for k in 0..layers * corners {
        let (layer, at) = (k / corners, k % corners);
        let [x, y] = [at % (cells + 1), at / (cells + 1)].map(|i| i as f64 / cells as f64);
        writeln!(text, "v {x:.7} {y:.7} {:.7}", layer as f64 * 1e-3).unwrap();
    }
    for layer in 0..layers {
        for k in 0..cells * cells {
            let a = layer * corners + k / cells * (cells + 1) + k % cells + 1;
            let [b, c, d] = [a + 1, a + cells + 1, a + cells + 2];
            writeln!(text, "f {a} {b} {d}\nf {a} {d} {c}").unwrap();
        }
    }
    text.into_bytes()
}
