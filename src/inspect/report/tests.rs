//! Tests of the report: walls, overhangs, components, loops and UV charts of shapes whose exact
//! values follow from formulas.

use serde_json::Value;

use super::*;
use crate::made_obj::Obj;
use meshsnap_render::import::Bundle;
use meshsnap_render::limits::{Budget, Limits};

/// The report with all sections.
fn report(obj: &Obj) -> Value {
    let extras = Extras { print: true, parts: true, uv: true };
    let report = report_of(obj.text(), extras);
    let text = report.text();
    assert!(text.contains("overhangs") && text.contains("parts") && text.contains("charts       none"), "{text}");
    serde_json::from_str(&report.json().unwrap()).unwrap()
}

fn report_of(obj: String, extras: Extras) -> Report {
    let (limits, deadline) = (Limits::default(), Deadline::default());
    inspect(&Bundle::of_one(obj.into_bytes()), None, extras, &limits, &mut Budget::new(&limits), &deadline, &mut |_| ())
        .unwrap()
}

#[track_caller]
fn near(value: &Value, expected: f64) {
    let found = value.as_f64().unwrap_or(f64::NAN);
    assert!((found - expected).abs() <= 1e-4 * expected.abs().max(1.0), "{value}, and {expected} expected");
}

#[test]
fn walls_are_as_thick_as_they_are_made() {
    let solid = report(&Obj::default().block([0.0; 3], [4.0, 2.0, 6.0], false));
    let walls = &solid["print"]["wall_thickness"];
    near(&walls["min"], 2.0);
    assert_eq!((&walls["faces"], &walls["open"]), (&12.into(), &0.into()));
    // A hollow one: the wall above the hollow is the thinnest.
    let hollow =
        report(&Obj::default().block([0.0; 3], [4.0; 3], false).block([0.5, 0.5, 0.5], [3.5, 3.75, 3.5], true));
    let walls = &hollow["print"]["wall_thickness"];
    near(&walls["min"], 0.25);
    assert!([3.75, 4.0].contains(&walls["at"][1].as_f64().unwrap()), "{walls}");
    near(&walls["median"], 0.5);
    // Without a side, what lies opposite of it has nothing below.
    let open = report(&Obj::default().block([0.0; 3], [1.0; 3], false).without_face(1));
    assert_eq!(open["print"]["wall_thickness"]["open"], 2);
}

#[test]
fn overhangs_and_the_way_of_standing_are_those_of_the_form() {
    // A block on the bed, and a plate of 4 by 3 above it: its lower side hangs over.
    let plate =
        report(&Obj::default().block([0.0; 3], [1.0; 3], false).block([-1.0, 2.0, -1.0], [3.0, 2.5, 2.0], false));
    let print = &plate["print"];
    near(&print["overhangs"]["area"], 12.0);
    near(&print["overhangs"]["share"], 12.0 / (6.0 + 24.0 + 7.0));
    near(&print["overhangs"]["steepest_deg"], 90.0);
    near(&print["bed"]["contact_area"], 1.0);
    near(&print["bed"]["tilt_deg"], 0.0);
    for degrees in [5.0, 30.0, 44.0] {
        let tilted = report(&Obj::default().block([0.0; 3], [3.0, 1.0, 2.0], false).turned_about_x(degrees));
        let print = &tilted["print"];
        near(&print["bed"]["tilt_deg"], degrees);
        near(&print["bed"]["contact_area"], 0.0);
        near(&print["overhangs"]["area"], 6.0);
        near(&print["overhangs"]["steepest_deg"], 90.0 - degrees);
    }
    // Beyond 45 degrees, another side is the one that looks down.
    let tilted = report(&Obj::default().block([0.0; 3], [3.0, 1.0, 2.0], false).turned_about_x(50.0));
    near(&tilted["print"]["overhangs"]["area"], 3.0);
    near(&tilted["print"]["bed"]["tilt_deg"], 40.0);
}

#[test]
fn parts_have_their_own_area_volume_and_genus() {
    let two = Obj::default().block([0.0; 3], [1.0, 2.0, 3.0], false).block([5.0; 3], [6.0; 3], false).without_face(6);
    let parts = &report(&two)["parts"];
    assert_eq!(parts["components"], 2);
    let [first, second] = [&parts["largest"][0], &parts["largest"][1]];
    near(&first["area"], 22.0);
    near(&first["volume"], 6.0);
    assert_eq!((&first["genus"], &first["open_edges"]), (&0.into(), &0.into()));
    near(&second["area"], 5.0);
    assert_eq!((&second["volume"], &second["genus"], &second["open_edges"]), (&Value::Null, &Value::Null, &4.into()));
    assert_eq!(second["middle"], serde_json::json!([5.5, 5.5, 5.5]));

    let segments = 48;
    let ring = report(&Obj::ring(segments, 4.0, 0.5));
    let part = &ring["parts"]["largest"][0];
    assert_eq!(part["genus"], 1);
    // The section is a square of 1, and its middle goes around on a polygon.
    let inner = segments as f64 * (std::f64::consts::TAU / segments as f64).sin() / 2.0;
    near(&part["volume"], inner * (4.5 * 4.5 - 3.5 * 3.5));
}

#[test]
fn loops_are_as_long_as_their_edges() {
    let open = report(&Obj::default().block([0.0; 3], [1.0, 2.0, 3.0], false).without_face(5));
    let loops = &open["parts"]["boundary_loops"];
    assert_eq!((&loops["count"], &loops["edges"]), (&1.into(), &4.into()));
    near(&loops["length"], 2.0 * (2.0 + 3.0));
    assert_eq!(loops["longest"][0]["closed"], true);
    assert_eq!(loops["longest"][0]["middle"], serde_json::json!([0.0, 1.0, 1.5]));
    let sharp = &open["parts"]["sharp_loops"];
    assert_eq!((&sharp["count"], &sharp["edges"]), (&1.into(), &8.into()));
    near(&sharp["length"], 4.0 + 2.0 * 2.0 + 2.0 * 3.0);
    // The four edges of a ring's section: its corners are sharp, its segments are not.
    let segments = 48;
    let ring = &report(&Obj::ring(segments, 4.0, 0.5))["parts"]["sharp_loops"];
    assert_eq!((&ring["count"], &ring["edges"]), (&4.into(), &(4 * segments).into()));
    let around = |radius: f64| 2.0 * segments as f64 * radius * (std::f64::consts::PI / segments as f64).sin();
    near(&ring["length"], 2.0 * (around(3.5) + around(4.5)));
    near(&ring["longest"][0]["length"], around(4.5));
}

#[test]
fn charts_have_the_areas_of_the_file_and_its_stretch() {
    // Two squares of 8 by 2: one has a quarter of the texture, the other half of that quarter, mirrored, on the first one.
    let vertices = "v 0 0 0\nv 8 0 0\nv 8 2 0\nv 0 2 0\nv 0 0 5\nv 8 0 5\nv 8 2 5\nv 0 2 5\n";
    let uvs = "vt 0 0\nvt 0.5 0\nvt 0.5 0.5\nvt 0 0.5\nvt 0.25 0\nvt 0 0\nvt 0 0.5\nvt 0.25 0.5\n";
    let obj = format!("{vertices}{uvs}f 1/1 2/2 3/3 4/4\nf 5/5 6/6 7/7 8/8\n");
    let report = report_of(obj, Extras { uv: true, ..Extras::default() });
    let json: Value = serde_json::from_str(&report.json().unwrap()).unwrap();
    let uv = &json["uv"];
    assert_eq!((&uv["charts"], &uv["flipped_faces"], &uv["faces_without_area"]), (&2.into(), &2.into(), &0.into()));
    near(&uv["area"], 0.375);
    near(&uv["overlaps"]["covered_area"], 0.25);
    near(&uv["overlaps"]["overlapping_area"], 0.125);
    assert_eq!(uv["overlaps"]["faces"], 4);
    assert!(uv["overlaps"]["stated_error"].as_f64().unwrap() < 1e-6, "{uv}");
    // Lengths on the surface over those in the texture: 16 and 4, scaled by the root of 0.25 / 16.
    let [first, second] = [&uv["largest"][0], &uv["largest"][1]];
    near(&first["stretch"]["linf"], 2.0);
    near(&first["stretch"]["l2"], (0.5 * (4.0 + 0.25_f64)).sqrt());
    // 32 and 4 of the mirrored one.
    near(&second["stretch"]["linf"], 32.0 * (0.125 / 16.0_f64).sqrt());
    near(&uv["stretch"]["linf"], 32.0 * (0.375 / 32.0_f64).sqrt());
    near(&uv["stretch"]["l2"], ((272.0 + 1040.0) / 4.0 * 0.375 / 32.0_f64).sqrt());
    assert_eq!(second["flipped_faces"], 2);
    let text = report.text();
    let expected = "charts       2, 37.5 % of the texture's area, stretch 1.961 (L2), 3.464 (Linf), 2 faces mirrored\n  \
                    overlaps   4 faces, 12.5 % of the texture's area (within";
    assert!(text.contains(expected), "{text}");
}
