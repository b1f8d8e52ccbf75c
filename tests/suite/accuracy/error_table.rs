//! Tests of the table of errors by which the program chooses a technique for `max_error`: it
//! follows from the measurement in `docs/accuracy.json`, and it holds on meshes that were not
//! measured for it.

use std::path::{Path, PathBuf};

use meshsnap_render::limits::Limits;
use meshsnap_render::plan;
use meshsnap_render::request;
use meshsnap_render::request::Rules;
use meshsnap_render::spec::{BackendChoice, Samples};

use crate::measure::scenes::{SCENES, Scene, UNSEEN};
use crate::measure::techniques::{Family, Technique};
use crate::measure::{Effort, SAMPLES, back_ends, condensed, rounds};
use crate::support::skip::{Need, skip};
use crate::support::truth::cases;

/// Sides of pictures.
const SIZES_PX: [u32; 2] = [96, 512];

/// The factor by which an error may exceed the expected one, which is the worst of a few scenes at
/// 512 px, and not a bound.
const FACTOR: f64 = 1.25;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

/// `MESHSNAP_GOLDEN=write` stores the table anew, and fails.
#[test]
fn the_shipped_table_is_what_was_measured() {
    let measured = std::fs::read_to_string(root().join("docs/accuracy.json")).unwrap();
    let made = condensed::table(&serde_json::from_str(&measured).unwrap());
    let path = root().join("src/render/plan/quality/error_table.json");
    if std::env::var_os("MESHSNAP_GOLDEN").is_some_and(|v| v == "write") {
        std::fs::write(&path, &made).unwrap();
        panic!("{} was written: look at it, then run without MESHSNAP_GOLDEN", path.display());
    }
    let stored = std::fs::read_to_string(&path).unwrap();
    assert!(stored == made, "{} differs; cargo bench --bench accuracy -- --table-only stores it anew", path.display());
}

#[test]
fn times_are_fitted_by_pixels_and_triangles() {
    let exact = [[0.25, 1.0, 3.0], [0.25, 10.0, 7.5], [1.0, 4.0, 12.0]];
    let [a, b] = condensed::fit(&exact, 0.0);
    assert!((a - 10.0).abs() < 1e-9 && (b - 0.5).abs() < 1e-9, "{a} {b}");
    // Neither may be below zero.
    let [a, b] = condensed::fit(&[[1.0, 1.0, 10.0], [1.0, 100.0, 5.0]], 0.0);
    assert!(a > 0.0 && b == 0.0, "{a} {b}");
    let [a, b] = condensed::fit(&[[1.0, 1.0, 1.0], [1.0, 100.0, 1000.0]], 0.0);
    assert!(a == 0.0 && b > 0.0, "{a} {b}");
    // Nor a triangle's time below the least.
    let [a, b] = condensed::fit(&[[1.0, 1.0, 10.0], [1.0, 100.0, 5.0]], 0.01);
    assert!(b == 0.01 && (a - 5.198).abs() < 1e-9, "{a} {b}");
    assert_eq!(condensed::fit(&[[1.0, 1.0, 10.0], [1.0, 100.0, 5.0]], 1.0), [0.0, 1.0]);
    assert_eq!(condensed::fit(&[[1.0, 1.0, 1.0], [1.0, 100.0, 1000.0]], 20.0), [0.0, 20.0]);
    assert_eq!(condensed::fit(&exact, 0.4), condensed::fit(&exact, 0.0));
}

/// The program's own expectation of a technique with so many samples.
fn expected(technique: Technique, samples: Samples, size_px: u32) -> f64 {
    let mut keys =
        vec![("size", size_px.to_string()), ("max_error", "255".to_owned()), ("samples", samples.to_string())];
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
    let selection = plan::select_quality(&spec, 1000, false).unwrap().selection;
    assert_eq!((selection.samples, selection.backend), (samples, BackendChoice::Cpu));
    selection.expected_error
}

#[test]
fn expected_errors_hold_on_meshes_that_the_table_was_not_made_from() {
    assert!(UNSEEN.iter().all(|unseen| SCENES.iter().all(|seen| seen.name != unseen.name)));
    // Made meshes take the place of missing models.
    for file in UNSEEN.iter().filter_map(Scene::missing_model) {
        skip(Need::LargeData, file);
    }
    let mut back_ends = back_ends(None);
    back_ends.truncate(1);
    let (mut compared, mut missed, mut worst) = (0, Vec::new(), 0.0_f64);
    let sizes_px = &SIZES_PX[..cases(1, 2)];
    for (scene, &size_px) in UNSEEN.iter().flat_map(|scene| sizes_px.iter().map(move |size_px| (scene, size_px))) {
        for row in rounds::measure(scene, Effort { size_px, runs: 1, ..Effort::FULL }, &mut back_ends) {
            let expected = expected(row.technique, row.samples, size_px);
            let (name, samples, measured) = (row.technique.name(), row.samples, row.errors.rmse);
            let what = format!("{}, {size_px} px, {name}, {samples} samples", scene.name);
            let line = format!("{what:<60} {measured:7.3}, expected {expected:7.3}");
            println!("{line}");
            worst = worst.max(measured / expected);
            if measured > FACTOR * expected {
                missed.push(line);
            }
            compared += 1;
        }
    }
    println!("at worst {worst:.3} times what is expected");
    let techniques = |family: Family| UNSEEN.iter().filter(|s| s.family == family).count() * family.techniques().len();
    let all = [Family::Wires, Family::Outlines, Family::Pictures].map(techniques);
    // Adaptive samples: of pictures and of hulls.
    let adaptive = all[2] + all[1] / 2;
    assert_eq!((compared, all), (((SAMPLES.len() - 1) * 45 + adaptive) * sizes_px.len(), [25, 6, 14]));
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}
