//! Tests of the automatic width of wires: lines cover about a third of the surface at most.

use super::*;
use crate::import::{self, Bundle};
use crate::limits::{Budget, Deadline, Limits};
use crate::request::{self, Rules};
use crate::spec::BackendChoice;

/// A square of n by n squares that fills a picture of 120 px, and the lines along its edges.
fn lines(n: usize, are_polygons: bool) -> AutoWidth {
    let at = |i: usize| format!("v {} {} 0\n", i % (n + 1), i / (n + 1));
    let face = |i: usize| {
        let a = i / n * (n + 1) + i % n + 1;
        format!("f {} {} {} {}\n", a, a + 1, a + n + 2, a + n + 1)
    };
    let obj: String = (0..(n + 1) * (n + 1)).map(at).chain((0..n * n).map(face)).collect();
    let limits = Limits::default();
    let mut budget = Budget::new(&limits);
    let bundle = Bundle::of_one(obj.into_bytes());
    let mesh = import::import(&bundle, None, &limits, &mut budget, &Deadline::default()).unwrap().0;
    let keys = [("size", "120"), ("view", "front"), ("camera.projection", "orthographic"), ("camera.margin", "0")];
    let keys = keys.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let rules = Rules { limits: limits.clone(), backend: BackendChoice::Cpu };
    let spec = request::read(None, &keys, &rules).unwrap();
    let scene = Scene::new(&mesh, &spec, &mut budget).unwrap();
    let deadline = Deadline::default();
    AutoWidth::of(&scene, are_polygons, |_| true, &mut PlanContext::new(&mut budget, &deadline, &[])).unwrap()
}

#[test]
fn lines_cover_about_a_third_at_most() {
    // Squares of 12 px: 1 px covers about a sixth.
    assert_eq!(lines(10, true), AutoWidth::WIDEST);
    let mut last = 1.0;
    let mut kinds = [0; 2];
    for n in [20, 22, 24, 26, 28, 30, 60, 120, 300] {
        let side_px = 120.0 / n as f64;
        let AutoWidth { width_px, opacity } = lines(n, true);
        let free = (1.0 - f64::from(width_px) / side_px).max(0.0);
        let covered = (1.0 - free * free) * f64::from(opacity);
        assert!(covered < 0.36, "{n}: {covered}");
        if width_px < 1.0 {
            assert!(covered > 0.33, "{n}: {covered}");
            kinds[usize::from(opacity < 1.0)] += 1;
        }
        assert!(width_px * opacity <= last, "{n}");
        last = width_px * opacity;
    }
    assert!(kinds[0] > 0 && kinds[1] > 3, "{kinds:?}");
    // Diagonals take room, too.
    assert!(lines(22, false).width_px < lines(22, true).width_px);
}
