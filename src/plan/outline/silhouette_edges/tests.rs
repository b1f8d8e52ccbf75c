//! Silhouette edges that are left out early.

use super::*;
use crate::import::{Bundle, import};
use crate::limits::{Budget, Deadline, Limits};
use crate::request::{self, Rules};
use crate::spec::BackendChoice;

/// A bumpy sheet of two materials, in which some faces are inside out, lie twice or are missing.
fn sheet(n: usize) -> String {
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
    let bundle = Bundle::of_one(sheet(60).into_bytes());
    let mesh = import(&bundle, None, &limits, &mut budget, &deadline).unwrap().mesh;
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
