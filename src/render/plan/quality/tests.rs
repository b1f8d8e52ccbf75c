//! Tests of the selection of techniques for a quality target, from a small table of errors and times.

use super::*;
use crate::limits::Limits;
use crate::request::{self, Rules};

fn spec(keys: &[(&str, &str)]) -> Spec {
    let rules = Rules { limits: Limits::default(), backend: BackendChoice::Auto };
    let keys: Vec<(String, String)> = keys.iter().map(|&(k, v)| (k.to_owned(), v.to_owned())).collect();
    request::read(None, &keys, &rules).unwrap()
}

/// Exact lines err little and are slow where there are many; one sample is cheaper and worse.
const TABLE: &str = r#"{ "gpu_is_software": GPU, "size_px": 512, "rows": [
    {"technique":"face","backend":"cpu","samples":1,"error":5,"ms_per_megapixel":10,"ms_per_kilotriangle":0},
    {"technique":"face","backend":"cpu","samples":4,"error":2,"ms_per_megapixel":20,"ms_per_kilotriangle":0},
    {"technique":"face","backend":"cpu","samples":"adaptive","error":0.5,"ms_per_megapixel":40,"ms_per_kilotriangle":0},
    {"technique":"exact","backend":"cpu","samples":1,"error":1.5,"ms_per_megapixel":10,"ms_per_kilotriangle":1},
    {"technique":"exact","backend":"cpu","samples":4,"error":1,"ms_per_megapixel":20,"ms_per_kilotriangle":1},
    {"technique":"fwidth","backend":"cpu","samples":1,"error":60,"ms_per_megapixel":30,"ms_per_kilotriangle":0.1},
    {"technique":"fwidth","backend":"cpu","samples":4,"error":50,"ms_per_megapixel":60,"ms_per_kilotriangle":0.1},
    {"technique":"exact","backend":"gpu","samples":1,"error":1.5,"ms_per_megapixel":2,"ms_per_kilotriangle":0.01},
    {"technique":"exact","backend":"gpu","samples":4,"error":1,"ms_per_megapixel":3,"ms_per_kilotriangle":0.01}
]}"#;

fn table(gpu_is_software: bool) -> ErrorTable {
    serde_json::from_str(&TABLE.replace("GPU", &gpu_is_software.to_string())).unwrap()
}

/// A megapixel of lines alone.
const LINES: &[(&str, &str)] = &[("size", "1000"), ("surface", "null"), ("wire", "{}"), ("wire.thickness", "3")];

type Case = (&'static [(&'static str, &'static str)], usize, &'static str, [f64; 2], &'static [&'static str]);

#[test]
fn the_cheapest_that_is_good_enough_is_chosen_of_what_is_open() {
    const UNMET: &[&str] = &["max_error_unmet"];
    const LATE: &[&str] = &["max_time_ms_unmet"];
    let cases: [Case; 13] = [
        (&[("max_error", "2")], 0, "image.samples=1, wire.method=exact, backend=cpu", [1.5, 10.0], &[]),
        (&[("max_error", "1.2")], 0, "image.samples=4, wire.method=exact, backend=cpu", [1.0, 20.0], &[]),
        (&[("max_error", "0.5")], 0, "image.samples=4, wire.method=exact, backend=cpu", [1.0, 20.0], UNMET),
        // Many triangles, and any picture will do.
        (&[("max_error", "99")], 100_000, "image.samples=1, wire.method=fwidth, backend=cpu", [60.0, 40.0], &[]),
        (&[("max_error", "55")], 100_000, "image.samples=4, wire.method=fwidth, backend=cpu", [50.0, 70.0], &[]),
        (&[("image.max_time_ms", "15")], 0, "image.samples=1, wire.method=exact, backend=cpu", [1.5, 10.0], &[]),
        (&[("image.max_time_ms", "99")], 0, "image.samples=4, wire.method=exact, backend=cpu", [1.0, 20.0], &[]),
        (&[("image.max_time_ms", "5")], 0, "image.samples=1, wire.method=exact, backend=cpu", [1.5, 10.0], LATE),
        (
            &[("max_error", "1.2"), ("image.max_time_ms", "15")],
            0,
            "image.samples=1, wire.method=exact, backend=cpu",
            [1.5, 10.0],
            UNMET,
        ),
        // What is given is kept.
        (
            &[("max_error", "2"), ("samples", "4"), ("backend", "auto")],
            0,
            "image.samples=4, wire.method=exact, backend=auto",
            [1.0, 20.0],
            &[],
        ),
        (
            &[("max_error", "1"), ("wire.method", "fwidth")],
            0,
            "image.samples=4, wire.method=fwidth, backend=cpu",
            [50.0, 60.0],
            UNMET,
        ),
        (
            &[("max_error", "99"), ("wire.smoothing", "0")],
            100_000,
            "image.samples=1, wire.method=exact, backend=cpu",
            [1.5, 110.0],
            &[],
        ),
        (
            &[("max_error", "99"), ("wire.hidden", "show")],
            100_000,
            "image.samples=1, wire.method=exact, backend=cpu",
            [1.5, 110.0],
            &[],
        ),
    ];
    for (keys, triangles, what, expected, warnings) in &cases {
        let chosen = select_from(&table(true), &spec(&[LINES, keys].concat()), *triangles, false).unwrap();
        assert_eq!(chosen.selection.to_string(), *what, "{keys:?}");
        let QualitySelection { expected_error, expected_time_ms, .. } = chosen.selection;
        assert_eq!([expected_error, expected_time_ms], *expected, "{keys:?}");
        let codes: Vec<&str> = chosen.warnings.iter().map(|warning| warning.code).collect();
        assert_eq!(codes, *warnings, "{keys:?}");
    }
}

#[test]
fn a_gpu_is_chosen_where_there_is_one_and_the_table_knows_it() {
    let asked = spec(&[LINES, &[("max_error", "2")]].concat());
    let chosen = select_from(&table(false), &asked, 1000, true).unwrap();
    assert_eq!((chosen.spec.backend, chosen.selection.expected_time_ms), (BackendChoice::Auto, 2.01));
    let without = select_from(&table(false), &asked, 1000, false).unwrap();
    assert_eq!((without.spec.backend, without.selection.expected_time_ms), (BackendChoice::Cpu, 11.0));
    let given = spec(&[LINES, &[("max_error", "2"), ("backend", "cpu")]].concat());
    assert_eq!(select_from(&table(false), &given, 1000, true).unwrap().spec.backend, BackendChoice::Cpu);
    let rules = Rules { limits: Limits::default(), backend: BackendChoice::Gpu };
    let of_server = request::read(None, &[("max_error".to_owned(), "2".to_owned())], &rules).unwrap();
    assert_eq!(select_from(&table(true), &of_server, 1000, false).unwrap().spec.backend, BackendChoice::Gpu);
}

#[test]
fn another_method_draws_as_wide() {
    let asked = spec(&[LINES, &[("max_error", "99")]].concat());
    let wire = select_from(&table(true), &asked, 100_000, false).unwrap().spec.layers.wire.unwrap();
    assert_eq!((wire.method, wire.thickness, wire.smoothing), (WireMethod::Fwidth, WireThickness::Given(1.0), 1.0));
    let exact = asked.layers.wire.unwrap();
    let wide = |width_px| as_wide(&Wire { thickness: WireThickness::Given(width_px), ..exact }, WireMethod::Fwidth);
    let thin = wide(0.5).unwrap();
    assert_eq!((thin.thickness, thin.smoothing), (WireThickness::Given(0.0), 0.5));
    assert!(wide(0.0).is_none() && wide(21.5).is_none() && wide(21.0).is_some());
}

#[test]
fn the_worst_technique_of_all_materials_counts() {
    let keys = [("size", "1000"), ("max_error", "3"), ("materials.A.wire.method", "fwidth")];
    let chosen = select_from(&table(true), &spec(&keys), 0, false).unwrap();
    assert_eq!((chosen.selection.expected_error, chosen.selection.expected_time_ms), (50.0, 80.0));
    assert_eq!(chosen.selection.wire_methods, ["fwidth"]);
    // A material's open wire is chosen too.
    let keys = [("size", "1000"), ("max_error", "99"), ("materials.A.wire", "{}")];
    let chosen = select_from(&table(true), &spec(&keys), 100_000, false).unwrap();
    assert_eq!(chosen.spec.materials[0].1.wire.unwrap().method, WireMethod::Fwidth);
    assert!(chosen.spec.layers.wire.is_none());
}

#[test]
fn adaptive_samples_are_chosen_where_a_picture_can_have_them() {
    let chosen = |keys: &[(&str, &str)]| {
        let keys = [&[("size", "1000"), ("backend", "cpu")], keys].concat();
        let found = select_from(&table(false), &spec(&keys), 7, false).unwrap();
        (found.selection.samples, found.selection.expected_error)
    };
    assert_eq!(chosen(&[("max_error", "0.6")]), (Samples::Adaptive, 0.5));
    assert_eq!(chosen(&[("max_error", "2.5")]), (Samples::Fixed(4), 2.0));
    // Exact lines have no error of their own with adaptive samples: that of 4 counts.
    assert_eq!(chosen(&[("max_error", "1.2"), ("wire.method", "exact")]), (Samples::Adaptive, 1.0));
    let see_through = [
        ("surface.opacity", "0.5"),
        ("surface.facing_opacity", "0.1"),
        ("surface.color", "#fff8"),
        ("scene.ground", "shadow"),
    ];
    for see_through in see_through {
        assert_eq!(chosen(&[("max_error", "0.6"), see_through]), (Samples::Fixed(4), 2.0), "{see_through:?}");
    }
    assert_eq!(chosen(&[("max_error", "0.6"), ("surface", "null"), ("wire", "{}")]).0, Samples::Fixed(4));
}

#[test]
fn nothing_is_chosen_where_nothing_is_asked_for() {
    for keys in [&[("samples", "1")][..], &[("max_error", "null")], &[("image.max_time_ms", "null")]] {
        assert!(select_from(&table(true), &spec(keys), 7, false).is_none(), "{keys:?}");
    }
    // Without a table nothing can be promised.
    assert!(select_from(&ErrorTable::default(), &spec(&[("max_error", "1")]), 7, true).is_none());
}
