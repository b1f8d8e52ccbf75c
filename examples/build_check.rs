//! What a build script says of the meshes that a program ships: cargo shows the warnings, and an error ends the build.
//!
//!     cargo run --release -p meshsnap --example build_check -- api/examples/knot.obj api/examples/lamp.obj

use std::error::Error;

use meshsnap_inspect::check::{Options, RuleSet, check};
use meshsnap_render::import::Bundle;
use meshsnap_render::limits::{Budget, Deadline, Limits};

fn main() -> Result<(), Box<dyn Error>> {
    let rules = RuleSet::parse(["opens", "manifold", "max-triangles:100000"], ["watertight"])?;
    let mut failed = 0;
    for path in std::env::args().skip(1) {
        println!("cargo:rerun-if-changed={path}");
        let (limits, deadline) = (Limits::default(), Deadline::default());
        let model = meshsnap_inspect::read(
            &Bundle::of_one(std::fs::read(&path)?),
            None,
            &limits,
            Budget::new(&limits),
            &deadline,
        )?;
        for check in check(&model, &rules, Options::default(), &deadline)?.iter().filter(|check| !check.ok) {
            println!("cargo:warning={path}: {}: {}", check.rule, check.detail);
            failed += usize::from(check.fails());
        }
    }
    match failed {
        0 => Ok(()),
        count => Err(format!("{count} rules are broken").into()),
    }
}
