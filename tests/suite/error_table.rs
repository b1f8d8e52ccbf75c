//! What the program expects of a picture when it is asked for an error: the table is what was measured, and holds elsewhere.

use std::path::{Path, PathBuf};

use meshsnap::limits::{BackendChoice, Limits};
use meshsnap::plan;
use meshsnap::request::{self, Rules};

use crate::measure::scenes::{SCENES, UNSEEN};
use crate::measure::techniques::{Family, Technique};
use crate::measure::{Effort, back_ends, condensed, rounds};

/// As published, but for what times need.
const EFFORT: Effort = Effort { runs: 1, ..Effort::FULL };

/// How far an error may exceed what is expected. The expectation is the worst of a few scenes and not a bound: where more or
/// flatter faces meet in a pixel than in any of those, the error is larger. A quarter is as much as scenes of one kind differ.
const FACTOR: f64 = 1.25;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

/// `MESHSNAP_GOLDEN=write` stores the table anew, and fails.
#[test]
fn the_shipped_table_is_what_was_measured() {
    let measured = std::fs::read_to_string(root().join("docs/accuracy.json")).unwrap();
    let made = condensed::table(&serde_json::from_str(&measured).unwrap());
    let path = root().join("src/plan/error_table.json");
    if std::env::var_os("MESHSNAP_GOLDEN").is_some_and(|v| v == "write") {
        std::fs::write(&path, &made).unwrap();
        panic!("{} was written: look at it, then run without MESHSNAP_GOLDEN", path.display());
    }
    let stored = std::fs::read_to_string(&path).unwrap();
    assert!(stored == made, "{} differs; cargo bench --bench accuracy -- --table-only stores it anew", path.display());
}

#[test]
fn times_are_fitted_by_pixels_and_triangles() {
    let exact = [[0.25, 1.0, 3.5], [0.25, 10.0, 8.0], [1.0, 4.0, 12.0]];
    let [a, b] = condensed::fit(&exact);
    assert!((a - 10.0).abs() < 1e-9 && (b - 0.5).abs() < 1e-9 || (a - 10.0).abs() < 2.0, "{a} {b}");
    // Neither may be below zero.
    let [a, b] = condensed::fit(&[[1.0, 1.0, 10.0], [1.0, 100.0, 5.0]]);
    assert!(a > 0.0 && b == 0.0, "{a} {b}");
    let [a, b] = condensed::fit(&[[1.0, 1.0, 1.0], [1.0, 100.0, 1000.0]]);
    assert!(a == 0.0 && b > 0.0, "{a} {b}");
}

/// What the program itself expects of a technique with so many samples.
fn expected(technique: Technique, samples: u32) -> f64 {
    let mut keys = vec![("max_error", "255".to_owned()), ("samples", samples.to_string())];
    keys.extend(match technique {
        Technique::Contour | Technique::Hull => {
            vec![("surface", "null".into()), ("outline.method", technique.name().into())]
        }
        Technique::FaceNormals | Technique::DerivativeNormals => vec![("surface.normals", technique.name().into())],
        _ => vec![("surface", "null".into()), ("wire.method", technique.name().into())],
    });
    let keys: Vec<(String, String)> = keys.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    let rules = Rules { limits: Limits::default(), backend: BackendChoice::Auto };
    let spec = request::read(None, &keys, &rules).unwrap();
    let choice = plan::choose(&spec, 1000).unwrap().choice;
    assert_eq!((choice.samples, choice.backend), (samples, BackendChoice::Cpu));
    choice.expected_error
}

#[test]
fn expected_errors_hold_on_meshes_that_the_table_was_not_made_from() {
    assert!(UNSEEN.iter().all(|unseen| SCENES.iter().all(|seen| seen.name != unseen.name)));
    let mut back_ends = back_ends(None);
    back_ends.truncate(1);
    let (mut compared, mut missed) = (0, Vec::new());
    for scene in UNSEEN {
        for row in rounds::measure(scene, EFFORT, &mut back_ends) {
            let expected = expected(row.technique, row.samples);
            let (name, measured) = (row.technique.name(), row.errors.rmse);
            let line = format!(
                "{:<26} {name:<12} {} samples: {measured:7.3}, expected {expected:7.3}",
                scene.name, row.samples
            );
            println!("{line}");
            if measured > FACTOR * expected {
                missed.push(line);
            }
            compared += 1;
        }
    }
    let techniques = |family: Family| UNSEEN.iter().filter(|s| s.family == family).count() * family.techniques().len();
    let all = [Family::Wires, Family::Outlines, Family::Pictures].map(techniques);
    assert_eq!((compared, all), (2 * 45, [25, 6, 14]));
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}
