//! Tables of time against numbers of triangles, pixels, samples and edges, each varied alone, with
//! the peak memory by triangles; and the times of scenes that are made to be slow.

use std::fmt::Write as _;
use std::time::Instant;

use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::import::Bundle;
use meshsnap_render::mesh::Mesh;

use crate::meshes::{Torus, layers, needles, obj, specks, stl};
use crate::plot::{self, Point};
use crate::rounds::{draw, import, plan, spec};

/// Keys and values of a request.
type Keys<'a> = &'a [(&'a str, &'a str)];

/// All tables as Markdown, and the plot of the first as SVG.
pub fn measure(threads: usize) -> (String, String) {
    let mut growth = Growth { cpu: CpuRenderer::new(threads), threads, text: String::new(), points: Vec::new() };
    growth.triangles();
    growth.pixels_samples_and_lines();
    growth.adversaries();
    (growth.text, plot::svg(&growth.points))
}

struct Growth {
    cpu: CpuRenderer,
    threads: usize,
    text: String,
    points: Vec<Point>,
}

impl Growth {
    fn line(&mut self, line: &str) {
        println!("{line}");
        writeln!(self.text, "{line}").unwrap();
    }

    fn header(&mut self, title: &str, columns: &[&str]) {
        self.line(&format!("\n### {title}\n"));
        self.line(&format!("| {} |", columns.join(" | ")));
        self.line(&format!("|{}", "---|".repeat(columns.len())));
    }

    fn triangles(&mut self) {
        let columns = [
            "triangles",
            "parse",
            "MB/s",
            "flat: plan",
            "render",
            "wire: plan",
            "render",
            "peak MB, flat",
            "ns/triangle, flat",
        ];
        self.header("Triangles: a bumpy torus as binary STL", &columns);
        for n in [23, 71, 224, 707, 2236] {
            let bytes = stl(&Torus { n });
            let (triangles, len, bundle) = (2 * n * n, bytes.len(), Bundle::of_one(bytes));
            // A renderer keeps its buffers, which would count for the next size.
            self.cpu = CpuRenderer::new(self.threads);
            let has_peak = forget_peak();
            let before = memory_mb("VmRSS:");
            let (parse_ms, mesh) = least(|| import(&bundle));
            let [flat_plan, flat] = self.look(&mesh, &[("style", "flat")]);
            let peak = memory_mb("VmHWM:") - before + len as f64 / 1e6;
            let peak = if has_peak { format!("{peak:.0}") } else { "not known".to_owned() };
            let [wire_plan, wire] = self.look(&mesh, &[("style", "wire")]);
            let mb_per_s = len as f64 / 1e3 / parse_ms;
            let ns = (flat_plan + flat) * 1e6 / triangles as f64;
            self.line(&format!(
                "| {triangles} | {parse_ms:.2} | {mb_per_s:.0} | {flat_plan:.2} | {flat:.2} | {wire_plan:.2} | {wire:.2} | {peak} | {ns:.0} |"
            ));
            for (series, ms) in [("parse", parse_ms), ("flat", flat_plan + flat), ("wire", wire_plan + wire)] {
                self.points.push(Point { series, triangles: triangles as f64, ms });
            }
        }
    }

    fn pixels_samples_and_lines(&mut self) {
        let mesh = import(&Bundle::of_one(obj(&Torus { n: 187 })));
        for look in ["flat", "wire"] {
            self.header(&format!("Pixels a side, 70 k triangles, {look}"), &["pixels", "plan", "render", "ns/pixel"]);
            for size in [64_u32, 128, 256, 512, 1024, 2048, 4096] {
                // By default, small pictures have more.
                let keys = [("style", look), ("size", &size.to_string()), ("samples", "4")];
                let [plan, render] = self.look(&mesh, &keys);
                let ns = render * 1e6 / f64::from(size * size);
                self.line(&format!("| {size} | {plan:.2} | {render:.2} | {ns:.0} |"));
            }
            self.header(&format!("Samples, {look}"), &["samples", "plan", "render"]);
            for samples in ["1", "4", "8", "16"] {
                self.row(samples, &mesh, &[("style", look), ("samples", samples)]);
            }
        }
        self.header("Edges drawn, 70 k triangles", &["edges", "plan", "render"]);
        for (name, keys) in [
            ("none", &[("style", "flat")] as Keys<'_>),
            ("sharp ones", &[("style", "wire"), ("wire.edges", "feature")]),
            ("all", &[("style", "wire")]),
            ("all, hidden ones too", &[("style", "wire"), ("wire.hidden", "fade")]),
        ] {
            self.row(name, &mesh, keys);
        }
    }

    fn adversaries(&mut self) {
        self.header("Scenes made to be slow", &["scene", "plan", "render"]);
        for count in [1, 16, 256, 2000] {
            let mesh = import(&Bundle::of_one(layers(count)));
            self.row(&format!("{count} transparent layers"), &mesh, &[("style", "flat"), ("surface.opacity", "0.5")]);
        }
        for count in [1_000, 10_000, 100_000] {
            let mesh = import(&Bundle::of_one(needles(count)));
            for look in ["flat", "wire"] {
                self.row(&format!("{count} needles across the picture, {look}"), &mesh, &[("style", look)]);
            }
        }
        let mesh = import(&Bundle::of_one(specks(1_000_000)));
        for look in ["flat", "wire"] {
            self.row(&format!("1,000,000 triangles in one pixel, {look}"), &mesh, &[("style", look)]);
        }
    }

    fn row(&mut self, value: &str, mesh: &Mesh, keys: Keys<'_>) {
        let [plan, render] = self.look(mesh, keys);
        self.line(&format!("| {value} | {plan:.2} | {render:.2} |"));
    }

    /// Least times of plan and render, milliseconds.
    fn look(&mut self, mesh: &Mesh, keys: Keys<'_>) -> [f64; 2] {
        let spec = spec(keys);
        let (plan_ms, plan) = least(|| plan(mesh, &spec));
        let (render_ms, _) = least(|| draw(&mut self.cpu, &plan).unwrap());
        [plan_ms, render_ms]
    }
}

/// Least time of three, milliseconds, and the last result. What takes over a second runs once.
fn least<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let mut least = f64::INFINITY;
    for round in 0.. {
        let began = Instant::now();
        let made = run();
        let ms = began.elapsed().as_secs_f64() * 1e3;
        least = least.min(ms);
        if round == 2 || ms > 1000.0 {
            return (least, made);
        }
    }
    unreachable!("the loop ends by itself")
}

/// A line of this process's status, MB; 0 where the system has none.
fn memory_mb(line: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib = status.lines().find_map(|l| l.strip_prefix(line)?.trim().strip_suffix("kB")?.trim().parse().ok());
    kib.unwrap_or(0.0) * 1.024e-3
}

/// Sets this process's peak memory back to what it has now (Linux, proc(5): clear_refs). True if the
/// system can.
fn forget_peak() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}
