//! Tests of the search for silhouette edges: edges inside a surface are left out early, and runs of
//! faces (32 consecutive ones) that are tested as a whole give what their faces would give one by
//! one.

use super::*;
use crate::import::{Bundle, import};
use crate::limits::{Budget, Deadline, Limits};
use crate::request::{self, Rules};
use crate::spec::BackendChoice;

/// A bumpy open surface of two materials, in which some faces are inside out, lie twice or are missing.
fn open_surface(n: usize) -> String {
    use std::fmt::Write;
    let mut obj = String::new();
    for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
        writeln!(obj, "v {i} {j} {}", (i * i * 7 + j * j * 3) % 11).unwrap();
    }
    for (i, j) in (0..(n - 1) * (n - 1)).map(|k| (k / (n - 1) * n, k % (n - 1))) {
        let [a, b, c, d] = [i + j + 1, i + j + 2, i + j + n + 2, i + j + n + 1];
        writeln!(obj, "usemtl {}", if (i + j) % 5 < 2 { "red" } else { "blue" }).unwrap();
        match (i + 3 * j) % 13 {
            0 => writeln!(obj, "f {a} {c} {b}\nf {a} {c} {d}").unwrap(),
            1 => writeln!(obj, "f {a} {b} {c}\nf {a} {b} {c}").unwrap(),
            _ => writeln!(obj, "f {a} {b} {c}\nf {a} {c} {d}").unwrap(),
        }
    }
    obj
}

#[test]
fn edges_that_are_surely_inside_have_no_outline() {
    let limits = Limits::default();
    let (mut budget, deadline) = (Budget::new(&limits), Deadline::default());
    let bundle = Bundle::of_one(open_surface(60).into_bytes());
    let mesh = import(&bundle, None, &limits, &mut budget, &deadline).unwrap().0;
    for cull in ["none", "back"] {
        let keys = [("style", "outline"), ("outline.method", "hull"), ("materials.red.surface.cull", cull)];
        let keys: Vec<(String, String)> = keys.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
        let rules = Rules { limits: limits.clone(), backend: BackendChoice::Auto };
        let spec = request::read(None, &keys, &rules).unwrap();
        let scene = Scene::new(&mesh, &spec, &mut budget).unwrap();
        let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
        let (list, silhouettes) = cx.silhouettes(&scene).unwrap();
        let view = ScreenMesh::new(&scene, &mut cx).unwrap();
        let outlines = vec![Some(Thickness::Px(3.0)); scene.groups.material_count()];
        let mut all = Vec::new();
        let mut inside = 0;
        for (i, edge) in list.iter().enumerate() {
            let before = all.len();
            if let Some(edge) = silhouettes.edge(&mesh, i, &edge) {
                view.each_side(i as u32, &edge, &outlines, &mut |side| all.push(side));
            }
            let is_inside = view.is_surely_inside(&edge);
            assert!(!is_inside || all.len() == before, "{edge:?}");
            inside += usize::from(is_inside);
        }
        assert!(inside > list.len() / 4, "{inside} of {}", list.len());
        assert!(all.len() > 100 && view.silhouette_edges(&outlines, &list, &silhouettes, &mut cx).unwrap() == all);
    }
}

/// A ball of triangles in bands, with bumps of a height.
fn ball(n: usize, height: f64) -> String {
    use std::fmt::Write;
    let mut obj = String::new();
    for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
        let (a, b) = (i as f64 / (n - 1) as f64 * 3.1 + 0.02, j as f64 / n as f64 * std::f64::consts::TAU);
        let r = 1.0 + height * f64::from((i * 7 + j * 5) as u32 % 11);
        writeln!(obj, "v {} {} {}", r * a.sin() * b.cos(), r * a.sin() * b.sin(), r * a.cos()).unwrap();
    }
    for (i, j) in (0..(n - 1) * n).map(|k| (k / n, k % n)) {
        let at = |i: usize, j: usize| i * n + j % n + 1;
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        writeln!(obj, "f {a} {b} {c}\nf {a} {c} {d}").unwrap();
    }
    obj
}

#[test]
fn runs_tell_what_their_faces_would() {
    let limits = Limits::default();
    let (mut budget, deadline) = (Budget::new(&limits), Deadline::default());
    let (mut sure, mut all, mut placed) = (0, 0, 0);
    for (height, view, projection) in [
        (0.0, "front", "perspective"),
        (0.002, "top", "orthographic"),
        (0.002, "iso", "perspective"),
        (0.02, "iso", "perspective"),
    ] {
        let bundle = Bundle::of_one(ball(90, height).into_bytes());
        let mesh = import(&bundle, None, &limits, &mut budget, &deadline).unwrap().0;
        let keys = [("style", "outline"), ("view", view), ("camera.projection", projection)];
        let keys: Vec<(String, String)> = keys.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
        let rules = Rules { limits: limits.clone(), backend: BackendChoice::Auto };
        let spec = request::read(None, &keys, &rules).unwrap();
        let scene = Scene::new(&mesh, &spec, &mut budget).unwrap();
        let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
        let view = ScreenMesh::new(&scene, &mut cx).unwrap();
        let places = Places { mesh: &mesh, projector: view.projector, rounded: 0.0 };
        for (r, run) in view.runs.runs.iter().enumerate() {
            let side = view.run_view.side(run);
            (sure, all) = (sure + usize::from(side != 0), all + 1);
            let around = view.run_view.place(run);
            placed += usize::from(around.is_some());
            for face in FaceRuns::faces(r, mesh.triangles.len()) {
                let plain = places.sorted_facing(face);
                assert!(plain == view.facing[face] && (side == 0 || side == plain), "{face}");
                for [x, y, w] in mesh.triangles[face].map(|v| view.place(v)) {
                    let is_within = |[low, high]: [[f64; 2]; 2]| {
                        (low[0]..=high[0]).contains(&(x / w)) && (low[1]..=high[1]).contains(&(y / w))
                    };
                    assert!(around.is_none_or(is_within));
                }
            }
        }
    }
    assert!(sure > all / 4 && sure < all && placed == all, "{sure} of {all}, {placed}");
}
