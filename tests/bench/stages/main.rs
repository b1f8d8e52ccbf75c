//! Time by stage: reading a mesh, planning, drawing and encoding it, on the CPU, for meshes of
//! three sizes.
//!
//!     cargo bench --bench stages                              # the table
//!     cargo bench --bench stages -- --mesh bunny.obj          # this mesh instead, as often as it is named
//!     cargo bench --bench stages -- --threads 1 --rounds 50
//!     cargo bench --bench stages -- --growth                  # time and memory against triangles, pixels, samples
//!     cargo bench --bench stages -- --growth --write          # the same into docs/growth.md and docs/growth.svg
//!     cargo bench --bench stages -- --fill                  # triangles and samples per second, one thread
//!     cargo bench --bench stages -- --samples               # fixed numbers of samples, and adaptive ones
//!     cargo bench --bench stages -- --gate                    # fails where a stage has become slower
//!     cargo bench --bench stages -- --write                   # keeps today's ratios for the gate
//!
//! Machines differ and are noisy, so the gate compares ratios. Each round runs every stage and a
//! fixed loop (`reference.rs`) in turns; a stage's ratio is its least time over the loop's. The
//! gate allows 1.5 times the ratio in `ratios.json`.

// A tool for developers: giving up loudly is fine.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod fill;
mod growth;
mod meshes;
mod plot;
mod reference;
mod rounds;
mod samples;

use std::collections::BTreeMap;
use std::process::ExitCode;

use rounds::{Row, measure};

/// A stage may take this many times its stored ratio.
const GATE: f64 = 1.5;

struct Options {
    meshes: Vec<String>,
    threads: usize,
    rounds: usize,
    gate: bool,
    write: bool,
    growth: bool,
    fill: bool,
    samples: bool,
}

fn main() -> ExitCode {
    let options = options();
    if options.fill {
        fill::print();
        return ExitCode::SUCCESS;
    }
    if options.growth {
        let (tables, plot) = growth::measure(options.threads);
        if options.write {
            write_growth(&tables, &plot, options.threads);
        }
        return ExitCode::SUCCESS;
    }
    let meshes = if options.meshes.is_empty() {
        meshes::made()
    } else {
        options.meshes.iter().map(|path| meshes::file(path)).collect()
    };
    if options.samples {
        samples::print(&meshes, options.threads, options.rounds);
        return ExitCode::SUCCESS;
    }
    let rows: Vec<Row> = meshes.iter().flat_map(|mesh| measure(mesh, options.threads, options.rounds)).collect();
    print(&rows, options.threads);
    if options.write {
        write(&rows);
    }
    if options.gate { gate(&rows) } else { ExitCode::SUCCESS }
}

fn options() -> Options {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut options = Options {
        meshes: Vec::new(),
        threads,
        rounds: 15,
        gate: false,
        write: false,
        growth: false,
        fill: false,
        samples: false,
    };
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(name) = arguments.next() {
        let mut value = || arguments.next().unwrap_or_else(|| panic!("{name} lacks its value"));
        match name.as_str() {
            "--mesh" => options.meshes.push(value()),
            "--threads" => options.threads = value().parse().expect("a number of threads"),
            "--rounds" => options.rounds = value().parse().expect("a number of rounds"),
            "--gate" => options.gate = true,
            "--write" => options.write = true,
            "--growth" => options.growth = true,
            "--fill" => options.fill = true,
            "--samples" => options.samples = true,
            other => panic!("{other} is unknown: see the top of tests/bench/stages/main.rs"),
        }
    }
    options
}

fn print(rows: &[Row], threads: usize) {
    println!("512 x 512 px, 4 samples, {threads} threads; least of the rounds\n");
    println!("| mesh | stage | ms | of the reference loop | |\n|---|---|---|---|---|");
    for row in rows {
        println!("| {} | {} | {:.3} | {:.3} | {} |", row.mesh, row.stage, row.ms, row.ratio, row.note);
    }
}

fn write_growth(tables: &str, plot: &str, threads: usize) {
    let docs = concat!(env!("CARGO_MANIFEST_DIR"), "/docs");
    let head = format!(
        "# How cost grows\n\nMilliseconds on the CPU with {threads} threads, 512 x 512 px and 4 samples unless a row says otherwise; least \
         of three, or the only one of what takes over a second. Measured by `cargo bench --bench stages -- --growth --write`.\n\n![time against triangles](growth.svg)\n"
    );
    std::fs::write(format!("{docs}/growth.md"), head + tables).unwrap();
    std::fs::write(format!("{docs}/growth.svg"), plot).unwrap();
}

fn path() -> &'static str {
    concat!(env!("CARGO_MANIFEST_DIR"), "/tests/bench/stages/ratios.json")
}

fn write(rows: &[Row]) {
    let ratios: BTreeMap<String, f64> =
        rows.iter().map(|row| (row.name(), (row.ratio * 1000.0).round() / 1000.0)).collect();
    let mut text = serde_json::to_string_pretty(&ratios).unwrap();
    text.push('\n');
    std::fs::write(path(), text).unwrap();
}

/// Fails where a stage has become slower, and where nothing was compared.
fn gate(rows: &[Row]) -> ExitCode {
    let Ok(bytes) = std::fs::read(path()) else {
        println!("nothing to compare with: --write keeps the ratios of a run");
        return ExitCode::FAILURE;
    };
    let stored: BTreeMap<String, f64> = serde_json::from_slice(&bytes).unwrap();
    let compared: Vec<(&Row, f64)> =
        rows.iter().filter_map(|row| stored.get(&row.name()).map(|ratio| (row, *ratio))).collect();
    let slower: Vec<_> = compared.iter().filter(|(row, ratio)| row.ratio > GATE * ratio).collect();
    for (row, ratio) in &slower {
        println!("slower: {}: {:.3} of the reference loop, stored {ratio:.3}", row.name(), row.ratio);
    }
    println!("{} stages compared, {} slower", compared.len(), slower.len());
    if slower.is_empty() && !compared.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
