//! The time that self-intersections and T-junctions of a mesh take, once it is read.
//!
//!     cargo bench --bench intersections                      # 1 M triangles, on 2 threads
//!     cargo bench --bench intersections -- --quads 1000 --threads 8
//!
//! Four meshes: a bumpy torus, two of them through each other, a flat sheet along two axes, and an
//! oblique one whose corners lie in one plane exactly, so that every sign beside it is a hard one.
//! After their lines comes the time of the charts of a texture and of their overlaps, for a torus
//! whose texture lies twice on itself. The last line is the verdict: whether the slowest search for
//! intersections took less than 3 s for each million triangles. If not, the program ends with 1.

// A tool for developers: giving up loudly is fine.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::time::Instant;

use meshsnap_inspect::geometry::charts::{Charts, overlaps};
use meshsnap_inspect::geometry::intersections::{self_intersections, t_junctions};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;

fn main() {
    // 2 * 707^2 triangles are a million.
    let (mut quads, mut threads) = (707_u32, 2_usize);
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(name) = arguments.next() {
        let value = arguments.next().unwrap_or_else(|| panic!("{name} needs a value"));
        match name.as_str() {
            "--quads" => quads = value.parse().expect("a number"),
            "--threads" => threads = value.parse().expect("a number"),
            other => panic!("there is no option {other}"),
        }
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let meshes = [
        ("bumpy torus", torus(quads, 0.0)),
        ("two through each other", both(torus(quads * 7 / 10, -0.05), torus(quads * 7 / 10, 0.05))),
        ("flat sheet", sheet(quads, |_, _| 0)),
        ("oblique sheet", sheet(quads, |x, y| x + y)),
    ];
    let mut slowest_s = 0.0_f64;
    for (name, mesh) in &meshes {
        let (budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
        let mut best = [f64::INFINITY; 2];
        let mut found = (0, None);
        for _ in 0..3 {
            let start = Instant::now();
            let faces =
                pool.install(|| self_intersections(mesh, &budget, &deadline)).expect("faces").expect("not too many");
            best[0] = best[0].min(start.elapsed().as_secs_f64());
            let start = Instant::now();
            let junctions = pool.install(|| t_junctions(mesh, &budget, &deadline)).expect("a count");
            best[1] = best[1].min(start.elapsed().as_secs_f64());
            found = (faces.len(), junctions);
        }
        let [intersections_s, junctions_s] = best;
        slowest_s = slowest_s.max(intersections_s * 1e6 / mesh.triangles.len() as f64);
        println!(
            "{name}: {} triangles, {} intersect in {intersections_s:.2} s, T-junctions: {} in {junctions_s:.2} s",
            mesh.triangles.len(),
            found.0,
            found.1.map_or_else(|| "too many faces above each other".to_owned(), |count: u64| count.to_string())
        );
    }
    pool.install(|| texture(torus(quads, 0.0), quads));
    let is_fast = slowest_s < LIMIT_S;
    let verdict = if is_fast { "met" } else { "MISSED" };
    println!(
        "{verdict}: {slowest_s:.2} s for each million triangles where it is slowest, on {threads} threads, and less than \
         {LIMIT_S} s wanted"
    );
    std::process::exit(i32::from(!is_fast));
}

/// The longest time for a million triangles.
const LIMIT_S: f64 = 3.0;

/// Prints the times of charts and overlaps of a mesh whose texture coordinates go twice over the texture.
fn texture(mut mesh: Mesh, quads: u32) {
    let unit = |c: u32| c as f32 / quads as f32;
    mesh.uvs = (0..quads * quads).map(|k| [unit(k / quads * 2 % quads), unit(k % quads)]).collect();
    mesh.attribute_triangles = mesh.triangles.clone();
    let (budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    let start = Instant::now();
    let charts = Charts::of(&mesh, &budget, &deadline).expect("charts");
    let charts_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let found = overlaps(&mesh, &budget, &deadline).expect("overlaps");
    let overlaps_s = start.elapsed().as_secs_f64();
    let found = found.map_or_else(
        || "too many faces above each other".to_owned(),
        |found| {
            format!(
                "{} faces overlap on {:.4} of the texture, within {:.0e}",
                found.faces, found.overlapping, found.error
            )
        },
    );
    println!("texture: {} charts in {charts_s:.2} s; {found}, in {overlaps_s:.2} s", charts.all.len());
}

/// A grid of n x n quads on a torus with bumps, moved along x.
fn torus(n: u32, x: f64) -> Mesh {
    let turn = std::f64::consts::TAU / f64::from(n);
    let at = |i: u32, j: u32| {
        let (u, v) = (f64::from(i) * turn, f64::from(j) * turn);
        let tube = 0.12 + 0.01 * (9.0 * u).sin() * (7.0 * v).cos();
        let from_axis = 0.3 + tube * v.cos();
        [from_axis * u.cos() + x, tube * v.sin(), from_axis * u.sin()].map(|c| c as f32)
    };
    let positions = (0..n * n).map(|k| at(k / n, k % n)).collect();
    Mesh { positions, triangles: triangles(n, n), ..Mesh::default() }
}

/// A flat grid of n x n quads over whole numbers.
fn sheet(n: u32, z: impl Fn(u32, u32) -> u32) -> Mesh {
    let unit = |c: u32| c as f32 / 4096.0 - 0.25;
    let positions = (0..(n + 1) * (n + 1)).map(|k| (k / (n + 1), k % (n + 1)));
    let positions = positions.map(|(x, y)| [unit(x), unit(y), unit(z(x, y))]).collect();
    Mesh { positions, triangles: triangles(n, n + 1), ..Mesh::default() }
}

/// Two triangles for each of n x n quads, on rows of so many vertices: as many as quads where the ends
/// of a row meet.
fn triangles(n: u32, row: u32) -> Vec<[u32; 3]> {
    let at = |i: u32, j: u32| (i % row) * row + j % row;
    let quads = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    quads
        .flat_map(|(i, j)| [[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]])
        .collect()
}

fn both(mut a: Mesh, b: Mesh) -> Mesh {
    let first = a.positions.len() as u32;
    a.positions.extend(b.positions);
    a.triangles.extend(b.triangles.iter().map(|triangle| triangle.map(|v| v + first)));
    a
}
