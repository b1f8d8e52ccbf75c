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
    width_of(obj, [120; 2], are_polygons)
}

/// The lines along the edges of a model that fills a picture of this size.
fn width_of(obj: String, size_px: [u32; 2], are_polygons: bool) -> AutoWidth {
    let limits = Limits::default();
    let mut budget = Budget::new(&limits);
    let bundle = Bundle::of_one(obj.into_bytes());
    let mesh = import::import(&bundle, None, &limits, &mut budget, &Deadline::default()).unwrap().0;
    let size = format!("{}x{}", size_px[0], size_px[1]);
    let keys = [("size", &size[..]), ("view", "front"), ("camera.projection", "orthographic"), ("camera.margin", "0")];
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
    assert_eq!(lines(10, true), AutoWidth::opaque(1.0));
    let mut last = 1.0;
    let mut kinds = [0; 2];
    for n in [20, 22, 24, 26, 28, 30, 60, 120, 300] {
        let side_px = 120.0 / n as f64;
        let AutoWidth { width_px, fade } = lines(n, true);
        let opacities = fade.map_or(vec![1.0], |fade| fade.opacities.clone());
        let (least, most) = opacities.iter().fold((1.0_f32, 0.0_f32), |(a, b), &v| (a.min(v), b.max(v)));
        // Of 180,000 triangles some are looked at.
        assert!(most - least < 0.05, "{n}: {opacities:?}");
        let opacity = 0.5 * (least + most);
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

#[test]
fn lines_are_faint_over_the_dense_part_of_a_mesh_alone() {
    // A square that is one polygon beside one of 60 x 60, each 60 px wide.
    let at = |i: usize| format!("v {} {} 0\n", i % 61, i / 61);
    let face = |i: usize| {
        let a = i / 60 * 61 + i % 60 + 1;
        format!("f {} {} {} {}\n", a, a + 1, a + 62, a + 61)
    };
    let large = "v -60 0 0\nv 0 0 0\nv 0 60 0\nv -60 60 0\nf -4 -3 -2 -1\n".to_owned();
    let obj: String = (0..61 * 61).map(at).chain((0..3600).map(face)).chain([large]).collect();
    let AutoWidth { width_px, fade } = width_of(obj, [120, 60], true);
    let fade = fade.unwrap();
    let row = fade.row(30);
    let along: Vec<f32> = (0..120).map(|x| fade.at(&row, x)).collect();
    assert_eq!(width_px, 0.8);
    assert!(along[..24].iter().all(|&opacity| opacity == 1.0), "{along:?}");
    assert!(along[96..].iter().all(|&opacity| opacity < 0.4), "{along:?}");
}

#[test]
fn order_and_winding_of_faces_leave_no_trace() {
    // A bent square whose columns get wider.
    let n = 40;
    let vertex = |i: usize| {
        let (x, y) = ((i % (n + 1)) as f64, (i / (n + 1)) as f64);
        format!("v {} {} {}\n", 0.37 * x * x, 14.8 * y, 3.0 * libm::sin(x + 0.7 * y))
    };
    let corners = |i: usize| {
        let a = i / 2 / n * (n + 1) + i / 2 % n;
        if i.is_multiple_of(2) { [a, a + 1, a + n + 2] } else { [a, a + n + 2, a + n + 1] }
    };
    let (vertices, faces) = ((n + 1) * (n + 1), 2 * n * n);
    let face = |[a, b, c]: [usize; 3]| format!("f {} {} {}\n", a + 1, b + 1, c + 1);
    let first: String = (0..vertices).map(vertex).chain((0..faces).map(|i| face(corners(i)))).collect();
    let turned = |i: usize| {
        let [a, b, c] = corners(i).map(|v| vertices - 1 - v);
        [[c, b, a], [b, a, c], [a, c, b]][i % 3]
    };
    let other = (0..vertices).rev().map(vertex).chain((0..faces).rev().map(|i| face(turned(i))));
    let [first, other] = [first, other.collect()].map(|obj| width_of(obj, [400, 300], false));
    assert!(first.fade.is_some());
    assert_eq!(first, other);
}
