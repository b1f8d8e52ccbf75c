//! Time and peak memory against what a picture is made of.

use std::time::Instant;

use meshsnap::backend::cpu::CpuRenderer;
use meshsnap::import::Bundle;

use crate::meshes::{Torus, obj, stl};
use crate::rounds::{draw, import, plan, spec};

/// Triangles, pixels, samples, lines and layers, each alone; least of three.
pub fn print(threads: usize) {
    println!("{threads} threads, least of three; a bumpy torus\n");
    triangles(threads);
    let mesh = import(&Bundle::of_one(obj(&Torus { n: 187 })));
    let header = |what: &str| println!("\n| {what} | plan ms | render ms |\n|---|---|---|");
    let row = |value: &str, keys: &[(&str, &str)]| {
        let spec = spec(keys);
        let mut cpu = CpuRenderer::new(threads);
        let (plan_ms, plan) = least(|| plan(&mesh, &spec));
        let (render_ms, _) = least(|| draw(&mut cpu, &plan).unwrap());
        println!("| {value} | {plan_ms:.2} | {render_ms:.2} |");
    };
    header("pixels a side, 70 k triangles, flat");
    for size in ["64", "128", "256", "512", "1024", "2048", "4096"] {
        row(size, &[("style", "flat"), ("size", size)]);
    }
    for look in ["flat", "wire"] {
        header(&format!("samples, {look}"));
        for samples in ["1", "4", "8", "16"] {
            row(samples, &[("style", look), ("samples", samples)]);
        }
    }
    header("layers");
    for (value, keys) in [
        ("opaque", [("style", "flat"), ("surface.opacity", "1")]),
        ("glass", [("style", "flat"), ("surface.opacity", "0.5")]),
    ] {
        row(value, &keys);
    }
}

fn triangles(threads: usize) {
    println!(
        "| triangles, STL | MB/s of parse | parse ms | flat: plan | render | wire: plan | render | peak MB |\n|---|---|---|---|---|---|---|---|"
    );
    for n in [23, 71, 224, 707, 1581] {
        let bytes = stl(&Torus { n });
        let (len, bundle) = (bytes.len(), Bundle::of_one(bytes));
        let (parse_ms, mesh) = least(|| import(&bundle));
        let mut cpu = CpuRenderer::new(threads);
        let [flat, wire] = ["flat", "wire"].map(|look| {
            let spec = spec(&[("style", look)]);
            let (plan_ms, plan) = least(|| plan(&mesh, &spec));
            let (render_ms, _) = least(|| draw(&mut cpu, &plan).unwrap());
            (plan_ms, render_ms)
        });
        println!(
            "| {} | {:.0} | {parse_ms:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.0} |",
            2 * n * n,
            len as f64 / 1e3 / parse_ms,
            flat.0,
            flat.1,
            wire.0,
            wire.1,
            peak_mb(),
        );
    }
}

/// Least time of three, milliseconds, and the last result.
fn least<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let mut timed = || {
        let began = Instant::now();
        let made = run();
        (began.elapsed().as_secs_f64() * 1e3, made)
    };
    let (first, second, (third, made)) = (timed().0, timed().0, timed());
    (first.min(second).min(third), made)
}

/// Largest memory of this process so far; 0 where the system does not say.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok());
    kib.unwrap_or(0.0) / 1e3
}
