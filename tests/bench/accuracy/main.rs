//! Run time against error: every technique on every back-end with every number of samples, each
//! compared with the oracle.
//!
//!     cargo bench --bench accuracy                            # all scenes; some minutes
//!     cargo bench --bench accuracy -- --quick                 # few and small scenes, few rounds; under a minute
//!     cargo bench --bench accuracy -- --scene 'deep rings'    # one scene, as often as it is named
//!     cargo bench --bench accuracy -- --write                 # all, and docs/accuracy.{json,md}, docs/*.svg of it
//!                                                             # and src/render/plan/quality/error_table.json
//!     cargo bench --bench accuracy -- --table-only            # the last of these, from docs/accuracy.json as it is
//!
//! Truth and the count of errors: `measure/truths.rs`. The request of each technique:
//! `measure/techniques.rs`. Times: medians of interleaved rounds of `Renderer::draw` alone, after
//! one that warms up, as ratios to a baseline in the same rounds, since machines differ. A model
//! that is not there is replaced (see `measure/scenes.rs`), and the report says so.

// A tool for developers: giving up loudly is fine.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod measure;
#[path = "../../oracle/mod.rs"]
mod oracle;
// The suite uses more of these.
#[allow(dead_code)]
#[path = "../../suite/support"]
mod support {
    pub mod seen;
    pub mod shapes;
}

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use meshsnap_render::backend::gpu::{AtomicsChoice, Gpu, GpuKind};

use measure::scenes::{SCENES, Scene};
use measure::table::{Machine, method, table};
use measure::{Effort, Row, back_ends, condensed, goals, json, plot};

struct Options {
    effort: Effort,
    scenes: Vec<Scene>,
    write: bool,
}

fn main() {
    if std::env::args().any(|argument| argument == "--table-only") {
        return write_table();
    }
    let options = options();
    let gpu = match Gpu::open(GpuKind::Any, AtomicsChoice::Best, None) {
        Ok(gpu) => Some(Arc::new(gpu)),
        Err(reason) => {
            println!("CPU alone: {reason}");
            None
        }
    };
    let machine = Machine::new(gpu.as_ref().map(|gpu| gpu.info()));
    println!("{}\n{}", machine.line(), method(options.effort));
    machine.warning().iter().for_each(|warning| println!("{warning}"));
    let mut back_ends = back_ends(gpu);
    let mut rows = Vec::new();
    for scene in &options.scenes {
        let began = Instant::now();
        rows.extend(measure::rounds::measure(scene, options.effort, &mut back_ends));
        // On standard error: the report stays the same however long it takes.
        eprintln!("{:<22} {:5.1} s  ({})", scene.name, began.elapsed().as_secs_f64(), scene.about());
    }
    println!("\n{}", table(&rows));
    goals::sentences(&rows).iter().for_each(|sentence| println!("{sentence}"));
    if options.write {
        write(&rows, &machine, &options);
    }
}

fn options() -> Options {
    let mut options = Options { effort: Effort::FULL, scenes: Vec::new(), write: false };
    let mut is_quick = false;
    let mut arguments = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(name) = arguments.next() {
        match name.as_str() {
            "--quick" => is_quick = true,
            "--write" => options.write = true,
            "--scene" => {
                let wanted = arguments.next().unwrap_or_else(|| panic!("--scene needs a name"));
                let names: Vec<&str> = SCENES.iter().map(|scene| scene.name).collect();
                let found = SCENES.iter().find(|scene| scene.name == wanted);
                options
                    .scenes
                    .push(*found.unwrap_or_else(|| panic!("there is no scene {wanted:?}; there are {names:?}")));
            }
            other => panic!("there is no option {other}; there are --quick, --scene NAME, --write and --table-only"),
        }
    }
    let is_partial = is_quick || !options.scenes.is_empty();
    assert!(!(options.write && is_partial), "--write publishes what it measures, so it measures everything");
    if is_quick {
        options.effort = Effort::QUICK;
    }
    if options.scenes.is_empty() {
        options.scenes = SCENES.iter().filter(|scene| scene.is_quick || !is_quick).copied().collect();
    }
    options
}

fn write(rows: &[Row], machine: &Machine, options: &Options) {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs");
    let before = std::fs::read_to_string(folder.join("accuracy.md")).unwrap_or_default();
    let files = [
        ("accuracy.json", json::document(machine, options.effort, &options.scenes, rows)),
        ("accuracy.md", goals::page(rows, machine, options.effort, &before)),
        ("work-precision.svg", plot::svg(rows, machine, &plot::TECHNIQUES)),
        ("whole-pictures.svg", plot::svg(rows, machine, &plot::WHOLE)),
    ];
    for (name, text) in files {
        std::fs::write(folder.join(name), text).unwrap_or_else(|e| panic!("docs/{name}: {e}"));
        println!("wrote docs/{name}");
    }
    write_table();
}

/// Condenses docs/accuracy.json into what the program chooses by.
fn write_table() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("docs/accuracy.json")).expect("docs/accuracy.json");
    let document = serde_json::from_str(&text).expect("docs/accuracy.json is JSON");
    std::fs::write(root.join("src/render/plan/quality/error_table.json"), condensed::table(&document))
        .expect("a table");
    println!("wrote src/render/plan/quality/error_table.json");
}
