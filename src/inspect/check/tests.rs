//! Tests of rules, on meshes that obey a rule and on meshes that break it.

use super::*;
use crate::made_obj::{Obj, SIDES};
use meshsnap_render::import::Bundle;
use meshsnap_render::limits::{Budget, Deadline, Limits};

fn cube() -> Obj {
    Obj::default().cube([0.0; 3], [1.0; 3])
}

/// The check of an OBJ file by one rule.
#[track_caller]
fn judge(text: &str, rule: &str) -> Check {
    let rules = RuleSet::parse([rule], []).unwrap();
    let bundle = Bundle::of_one(text.as_bytes().to_vec());
    let deadline = Deadline::default();
    let limits = Limits::default();
    let mut checks = match crate::read(&bundle, None, &limits, Budget::new(&limits), &deadline) {
        Ok(model) => check(&model, &rules, Options::default(), &deadline).unwrap(),
        Err(fault) => vec![unopened(fault.to_string())],
    };
    assert_eq!(checks.len(), 1, "{rule}");
    checks.remove(0)
}

#[track_caller]
fn obeys(obj: &Obj, rule: &str) {
    let check = judge(&obj.text(), rule);
    assert!(check.ok && check.places.is_empty(), "{check:?}");
}

/// The check of a rule that is broken this many times.
#[track_caller]
fn breaks(obj: &Obj, rule: &str, found: u64, detail: &str) -> Check {
    let check = judge(&obj.text(), rule);
    assert!(!check.ok && check.detail.contains(detail), "{check:?}");
    assert_eq!(check.found, Some(Figure::Count(found)), "{check:?}");
    check
}

#[test]
fn a_cube_obeys_the_rules_of_solids() {
    let rules = ["opens", "no-warnings", "watertight", "manifold", "consistent-winding", "no-degenerate"];
    let more = ["no-duplicate-faces", "no-self-intersection", "no-inverted-volume", "no-ngons", "single-component"];
    for rule in rules.into_iter().chain(more) {
        obeys(&cube(), rule);
    }
}

#[test]
fn a_hole_has_its_edges() {
    let open = Obj::default().cube_of([5.0, 0.0, 0.25], [1.0; 3], &SIDES[1..], false);
    let check = breaks(&open, "watertight", 4, "4 open edges in 1 loop");
    assert_eq!(check.places.len(), 4);
    let is_below = |place: &Place| matches!(place, Place::Edge(ends) if ends.iter().all(|end| end[2] == -0.75));
    assert!(check.places.iter().all(is_below), "{:?}", check.places);
    for rule in ["manifold", "consistent-winding", "no-inverted-volume", "single-component"] {
        obeys(&open, rule);
    }
}

#[test]
fn many_faults_are_counted_and_few_are_listed() {
    let many = (0..30)
        .fold(Obj::default(), |obj, i| obj.cube_of([3.0 * f64::from(i), 0.0, 0.0], [1.0; 3], &SIDES[1..], false));
    let check = breaks(&many, "watertight", 120, "120 open edges in 30 loops");
    assert_eq!(check.places.len(), PLACES_MAX);
    breaks(&many, "single-component", 30, "30 connected parts, and 1 allowed");
}

#[test]
fn a_side_that_is_turned_over() {
    let [first, rest @ ..] = SIDES;
    let mut turned = first;
    turned.reverse();
    let sides: Vec<[usize; 4]> = [turned].into_iter().chain(rest).collect();
    let obj = Obj::default().cube_of([0.0; 3], [1.0; 3], &sides, false);
    assert_eq!(breaks(&obj, "consistent-winding", 4, "4 edges between faces").places.len(), 4);
    breaks(&obj, "watertight", 4, "4 edges between faces that look to different sides");
    obeys(&obj, "manifold");
}

#[test]
fn faces_that_repeat_others() {
    let obj = cube().and("f 3 2 1\n");
    // The diagonal decides whether these corners are a face already.
    let count = judge(&obj.text(), "no-duplicate-faces").found;
    let other = judge(&cube().and("f 4 3 2\n").text(), "no-duplicate-faces").found;
    let mut both = [count, other];
    both.sort_by_key(|found| matches!(found, Some(Figure::Count(1))));
    assert_eq!(both, [Some(Figure::Count(0)), Some(Figure::Count(1))]);
    let twice = Obj::default().and("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 2 1 3\n");
    let check = breaks(&twice, "no-duplicate-faces", 1, "1 face repeats an earlier one");
    let Place::Face(corners) = check.places[0] else { panic!("{check:?}") };
    assert!(corners.contains(&[0.0, 1.0, 0.0]) && corners.contains(&[1.0, 0.0, 0.0]), "{corners:?}");
}

#[test]
fn surfaces_that_touch() {
    // Three triangles at an edge, and two cubes that share a corner.
    let fins = Obj::default().and("v 0 0 0\nv 0 0 1\nv 1 0 0\nv -1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n");
    let check = breaks(&fins, "manifold", 1, "1 edge with more than two faces");
    assert_eq!(check.places, [Place::Edge([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])]);
    let touching = cube().cube([2.0; 3], [1.0; 3]);
    let check = breaks(&touching, "manifold", 1, "1 vertex where surfaces touch");
    assert_eq!(check.places, [Place::Vertex([1.0; 3])]);
    obeys(&touching, "watertight");
}

#[test]
fn parts_that_are_inside_out() {
    let inward = Obj::default().cube_of([0.0; 3], [1.0; 3], &SIDES, true);
    breaks(&inward, "no-inverted-volume", 1, "1 of 1 closed part inside out");
    let beside = cube().cube_of([5.0, 0.0, 0.0], [1.0; 3], &SIDES, true);
    let check = breaks(&beside, "no-inverted-volume", 1, "1 of 2 closed parts inside out");
    assert!(matches!(check.places[0], Place::Face(corners) if corners.iter().all(|c| c[0] >= 4.0)), "{check:?}");
    // A cavity looks inwards by right; a solid within a solid is none, and no fault of this rule.
    obeys(&cube().cube_of([0.0; 3], [0.5; 3], &SIDES, true), "no-inverted-volume");
    obeys(&cube().cube([0.0; 3], [0.5; 3]), "no-inverted-volume");
}

#[test]
fn faces_that_go_through_others() {
    let overlapping = cube().cube([1.0; 3], [1.0; 3]);
    // Both triangles of three sides of each cube reach into the other.
    let check = breaks(&overlapping, "no-self-intersection", 12, "12 faces intersect others");
    assert_eq!(check.places.len(), 12);
    obeys(&cube().cube([0.0; 3], [0.5; 3]), "no-self-intersection");
    obeys(&cube().cube([2.0; 3], [1.0; 3]), "no-self-intersection");
    // A small cube that stands on a side: its foot, the sides that rise from it, and what it stands on.
    breaks(&cube().cube([1.5, 0.0, 0.0], [0.5; 3]), "no-self-intersection", 12, "12 faces intersect others");
}

#[test]
fn faces_without_area_and_large_polygons() {
    let thin = breaks(&cube().and("v 0 0 0\nv 1 1 1\nv 2 2 2\nf 9 10 11\n"), "no-degenerate", 1, "1 face without area");
    assert_eq!(thin.places, [Place::Face([[0.0; 3], [1.0; 3], [2.0; 3]])]);
    let many = (0..50).fold(cube(), |obj, _| obj.and("f 1 2 2\nf 1 1 3\n"));
    assert_eq!(breaks(&many, "no-degenerate", 100, "100 faces without area").places.len(), PLACES_MAX);
    let fan = Obj::default().and("v 0 0 0\nv 2 0 0\nv 3 1 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4 5\n");
    let check = breaks(&fan, "no-ngons", 1, "1 polygon with more than 4 corners");
    assert!(matches!(check.places[..], [Place::Face(corners)] if corners.iter().all(|c| c[2] == 0.0)), "{check:?}");
    // Between quadrilaterals, of which two repeat each other, and of nine corners and more.
    let around = |n: usize, z: f64| -> Obj {
        let angle = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
        let vertices = (0..n).map(|i| [5.0 + angle(i).cos(), angle(i).sin(), z]).collect();
        Obj { vertices, faces: vec![(0..n).collect()], ..Obj::default() }
    };
    let quads = cube().and("f 1 4 3 2\n");
    obeys(&quads, "no-ngons");
    let mut checked = 0;
    for n in [5, 6, 9, 40] {
        let mut obj = around(n, 3.0).cube([0.0; 3], [1.0; 3]);
        obj.faces.push((0..n).rev().collect());
        let check = breaks(&obj, "no-ngons", 2, "2 polygons with more than 4 corners");
        let is_high = |place: &Place| matches!(place, Place::Face(corners) if corners.iter().all(|c| c[2] == 3.0));
        assert!(check.places.len() == 2 && check.places.iter().all(is_high), "{n}: {check:?}");
        checked += 1;
    }
    assert_eq!(checked, 4);
}

#[test]
fn attributes_are_there_or_not() {
    let plain = cube();
    let whole =
        Obj::default().and("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1/1 2/2/1 3/3/1\n");
    for rule in ["has-normals", "has-uv"] {
        obeys(&whole, rule);
        let check = judge(&plain.text(), rule);
        assert!(!check.ok && check.found.is_none() && check.detail.contains("it has no "), "{check:?}");
    }
    for rule in ["uv-in-range", "uv-no-overlap"] {
        obeys(&whole, rule);
        obeys(&plain, rule);
    }
}

#[test]
fn texture_coordinates_beyond_the_texture_and_on_each_other() {
    let two = |moved: f64| {
        let uvs = format!("vt 0 0\nvt 0.4 0\nvt 0 0.4\nvt {moved} 0\nvt {} 0\nvt {moved} 0.4\n", moved + 0.4);
        let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 5 1 0\n";
        Obj::default().and(vertices).and(&uvs).and("f 1/1 2/2 3/3\nf 4/4 5/5 6/6\n")
    };
    obeys(&two(0.5), "uv-in-range");
    obeys(&two(0.5), "uv-no-overlap");
    let check = breaks(&two(0.7), "uv-in-range", 1, "1 vertex lies outside");
    assert_eq!(check.places, [Place::Vertex([6.0, 0.0, 0.0])]);
    assert_eq!(breaks(&two(0.1), "uv-no-overlap", 2, "2 faces overlap others").places.len(), 2);
}

#[test]
fn counts_have_limits() {
    let bytes = cube().text().len() as u64;
    for (name, found) in [("max-triangles", 12), ("max-vertices", 8), ("max-materials", 1), ("max-file-bytes", bytes)] {
        obeys(&cube(), &format!("{name}:{found}"));
        let check = breaks(&cube(), &format!("{name}:{}", found - 1), found, "allowed");
        assert_eq!(check.allowed, Some(Figure::Count(found - 1)));
    }
    obeys(&cube(), "max-texture-px:0");
    obeys(&cube(), "bounds:2,2,2");
    let check = judge(&cube().text(), "bounds:2,1.5,2");
    assert!(!check.ok && check.detail == "2 along y, and 1.5 allowed", "{check:?}");
    assert_eq!((check.found, check.allowed), (Some(Figure::Size([2.0; 3])), Some(Figure::Size([2.0, 1.5, 2.0]))));
}

#[test]
fn warnings_warn() {
    let check = judge(&cube().and("mtllib absent.mtl\n").text(), "no-warnings");
    assert!(!check.ok && check.level == Level::Warn && check.found == Some(Figure::Count(1)), "{check:?}");
    assert!(Verdict::new("x".into(), None, vec![check]).ok);
}

#[test]
fn what_does_not_open_fails_whatever_the_rules() {
    for text in ["", "f 1 2 3\n", "v 0 0 0\n"] {
        let check = judge(text, "max-triangles:5");
        assert!(check.rule == "opens" && !check.ok && check.level == Level::Error && !check.detail.is_empty());
        assert!(!Verdict::new("x".into(), None, vec![check]).ok);
    }
}

#[test]
fn points_alone_are_not_watertight() {
    let check = judge("v 0 0 0\nv 1 0 0\np 1 2\n", "watertight");
    assert!(!check.ok && check.detail == "it has no faces", "{check:?}");
}

#[test]
fn rules_are_read_and_mistakes_named() {
    for name in NAMES {
        let with_value = [name.to_owned(), format!("{name}:5"), format!("{name}:1,2,3")];
        let read: Vec<Rule> = with_value.iter().filter_map(|text| Rule::parse(text).ok()).collect();
        assert!(read.len() == 1 && read[0].name() == name, "{name}: {read:?}");
    }
    assert_eq!(
        RuleSet::split("watertight, bounds:1,2.5,3,max-triangles:5,"),
        ["watertight", "bounds:1,2.5,3", "max-triangles:5"]
    );
    let cases = [
        ("watertigth", "did you mean `watertight`?"),
        ("max_triangles:5", "did you mean `max-triangles`?"),
        ("self-intersection", "the rules are opens, "),
        ("xyz", "there is no rule `xyz`; the rules are"),
        ("max-triangles", "takes a whole number"),
        ("max-triangles:-1", "takes a whole number"),
        ("manifold:3", "takes no number"),
        ("bounds:1,2", "takes three lengths"),
        ("bounds:1,2,inf", "takes three lengths"),
    ];
    for (text, part) in cases {
        let error = RuleSet::parse([text], []).unwrap_err().to_string();
        assert!(error.contains(part), "{text}: {error}");
    }
    assert_eq!(RuleSet::parse(["manifold"], ["manifold"]), Err(UnknownRule::Twice("manifold")));
    let long = "x".repeat(100_000);
    assert!(RuleSet::parse([long.as_str()], []).unwrap_err().to_string().len() < 1000);
}

#[test]
fn a_verdict_is_the_public_json() {
    let check = judge(&Obj::default().and("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").text(), "watertight");
    let json = serde_json::to_value(Verdict::new("a.obj".into(), Some("00".into()), vec![check])).unwrap();
    let expected = serde_json::json!({
        "path": "a.obj", "sha256": "00", "ok": false,
        "checks": [{ "rule": "watertight", "level": "error", "ok": false, "known": false, "found": 3, "allowed": 0,
                     "detail": "3 open edges in 1 loop", "where": json["checks"][0]["where"] }]
    });
    assert_eq!(json, expected);
    let edges = json["checks"][0]["where"].as_array().unwrap();
    assert_eq!(edges.len(), 3);
    assert!(edges.contains(&serde_json::json!({ "edge": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]] })), "{edges:?}");
}

#[test]
fn each_rule_has_a_meaning() {
    for name in NAMES {
        assert!(meaning(name).ends_with('.'), "{name}");
    }
    assert_eq!(meaning("other"), "");
}

#[test]
fn vertices_that_nothing_refers_to_are_counted_though_reading_drops_them() {
    obeys(&cube(), "no-loose-vertices");
    let (one, more) = ("1 vertex that nothing refers to", "3 vertices that nothing refers to");
    breaks(&cube().and("v 9 9 9\n"), "no-loose-vertices", 1, one);
    // Faces with texture coordinates of their own, so that vertices are made anew.
    let seams = "v 5 5 5\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\nf 1/1 2/2 3/3\nf 1/4 3/2 4/1\n";
    breaks(&cube().and(seams), "no-loose-vertices", 1, one);
    breaks(&cube().and("v 9 9 9\nv 9 9 9\nv 8 8 8\n"), "no-loose-vertices", 3, more);
    obeys(&cube().and("v 9 9 9\nl 1 -1\n"), "no-loose-vertices");
    obeys(&cube().and("v 9 9 9\np -1\n"), "no-loose-vertices");
    // Its face is dropped, and it belongs to one all the same.
    obeys(&cube().and("v 9 9 9\nf -1 -1 1\n"), "no-loose-vertices");
}

#[test]
fn a_limit_that_a_rule_hits_is_told_by_that_rule() {
    let rules = RuleSet::parse(["opens", "watertight"], ["manifold"]).unwrap();
    let bundle = Bundle::of_one(cube().text().into_bytes());
    let deadline = Deadline::default();
    let read = |memory_bytes| {
        let limits = Limits::default().with(|limits| limits.memory_bytes = memory_bytes);
        crate::read(&bundle, None, &limits, Budget::new(&limits), &deadline)
    };
    // The least memory with which the file opens leaves none for its edges.
    let least = (0..200).map(|n| 256 * n).find(|bytes| read(*bytes).is_ok()).unwrap();
    let model = read(least).unwrap();
    let error = check(&model, &rules, Options::default(), &deadline).unwrap_err();
    assert!(matches!(error.fault, meshsnap_render::import::MeshFault::Limit(_)), "{error:?}");
    let options = Options { fails_at_limits: true, ..Options::default() };
    let checks = check(&model, &rules, options, &deadline).unwrap();
    assert_eq!(checks.iter().map(|check| check.ok).collect::<Vec<_>>(), [true, false, false]);
    for check in &checks[1..] {
        assert!(check.found.is_none() && check.places.is_empty(), "{check:?}");
        assert!(check.detail.starts_with("it could not be judged: ") && check.detail.contains("--limit-memory-bytes"));
    }
    assert!(!Verdict::new("x".into(), None, checks).ok);
}

#[test]
fn all_places_are_listed_on_request_up_to_a_bound_of_the_whole_verdict() {
    let with = |count: usize, options: Options| {
        let rules = RuleSet::parse(["watertight", "manifold"], ["no-warnings"]).unwrap();
        let bundle = Bundle::of_one(Obj::row(count).text().into_bytes());
        let limits = Limits::default();
        let model = crate::read(&bundle, None, &limits, Budget::new(&limits), &Deadline::default()).unwrap();
        check(&model, &rules, options, &Deadline::default()).unwrap()
    };
    let options = Options { all_places: true, ..Options::default() };
    let (all, first) = (with(50, options), with(50, Options::default()));
    assert_eq!((all[0].places.len(), first[0].places.len()), (150, PLACES_MAX));
    assert_eq!(all[0].places[..PLACES_MAX], first[0].places);
    let many = with(ALL_PLACES_MAX / 3 + 10, options);
    assert_eq!(many[0].places.len(), ALL_PLACES_MAX);
    assert_eq!(many[0].found, Some(Figure::Count(3 * (ALL_PLACES_MAX as u64 / 3 + 10))));
}
