//! Tests of the parts of an edge that faces hide, and of the parts that are left.

use super::grid::ScreenFace;
use super::*;
use crate::import::{Bundle, import};
use crate::limits::{Budget, Limits};
use crate::plan::edges::silhouettes::hiding_materials;
use crate::plan::outline::silhouette_edges::ScreenMesh;
use crate::plan::skips::SkipKind;
use crate::request::{self, Rules};
use crate::scene::{Scene, Thickness};
use crate::spec::BackendChoice;

fn visible(hidden: &[[f64; 2]], length_px: f64) -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    each_gap(&mut hidden.to_vec(), length_px * PX, |range| found.push(range));
    found
}

#[test]
fn what_is_not_hidden_is_visible() {
    assert_eq!(visible(&[], 100.0), [[0.0, 1.0]]);
    assert_eq!(visible(&[[0.4, 0.6]], 100.0), [[0.0, 0.4], [0.6, 1.0]]);
    assert_eq!(visible(&[[0.5, 0.75], [0.25, 0.625]], 100.0), [[0.0, 0.25], [0.75, 1.0]]);
    assert_eq!(visible(&[[0.0, 0.5], [0.5, 1.0]], 100.0), [[0.0; 2]; 0]);
    // Short hidden parts are drawn, and visible slivers are not.
    assert_eq!(visible(&[[0.4, 0.405]], 100.0), [[0.0, 1.0]]);
    assert_eq!(visible(&[[0.0, 0.005], [0.5, 0.75]], 100.0), [[0.0, 0.5], [0.75, 1.0]]);
    assert_eq!(visible(&[[0.0, 0.5], [0.5005, 0.75]], 100.0), [[0.75, 1.0]]);
    // An edge shorter than a sliver is visible as a whole or not at all.
    assert_eq!(visible(&[], 0.01), [[0.0, 1.0]]);
    // Beyond the last part that is told apart, everything is visible.
    let many: Vec<[f64; 2]> = (0..40).map(|i| [f64::from(i) / 40.0, (f64::from(i) + 0.5) / 40.0]).collect();
    let parts = visible(&many, 1000.0);
    assert_eq!(parts.len(), PARTS_MAX);
    assert!(parts.iter().zip(&many).all(|(part, hidden)| part[0] == hidden[1]) && parts[PARTS_MAX - 1][1] == 1.0);
}

/// A large triangle over the edge's second half, at a depth.
fn face(depth: f64, vertices: [u32; 3]) -> ScreenFace {
    ScreenFace { corners: [[500.0, -5000.0, depth], [9000.0, 0.0, depth], [500.0, 5000.0, depth]], vertices }
}

/// An edge 1000 units long.
fn edge() -> ScreenEdge {
    let ends = [[0.0, 0.0, 0.5, 1.0], [1000.0, 0.0, 0.5, 1.0]];
    ScreenEdge { ends, is_whole: [true; 2], may_show: true }
}

#[test]
fn a_face_hides_what_it_covers_and_what_is_farther() {
    let hidden = |depth: f64, vertices: [u32; 3]| hidden_range(&face(depth, vertices), &edge(), [1, 2], 1e-6);
    let near = |got: Option<[f64; 2]>, want: [f64; 2]| {
        let got = got.unwrap();
        assert!((0..2).all(|k| (got[k] - want[k]).abs() < 2e-3), "{got:?}, not {want:?}");
    };
    near(hidden(0.6, [7, 8, 9]), [0.5, 1.0]);
    assert_eq!(hidden(0.4, [7, 8, 9]), None);
    assert_eq!(hidden(0.5, [7, 8, 9]), None, "as deep");
    assert_eq!(hidden(0.6, [2, 8, 1]), None, "its own");
    // A face through which the edge comes out.
    let mut slanted = face(0.6, [7, 8, 9]);
    (slanted.corners[0][2], slanted.corners[2][2], slanted.corners[1][2]) = (0.6, 0.6, -2.8);
    near(hidden_range(&slanted, &edge(), [1, 2], 1e-6), [0.5, 0.75]);
}

#[test]
fn a_face_at_the_edges_own_vertex_hides_it_from_there() {
    // From the edge's second vertex the face comes nearer, or recedes.
    for (depth, want) in [(0.7, true), (0.3, false)] {
        let corners = [[200.0, -5000.0, depth], [1000.0, 0.0, 0.5], [200.0, 5000.0, depth]];
        let found = hidden_range(&ScreenFace { corners, vertices: [7, 2, 9] }, &edge(), [1, 2], 1e-6);
        assert_eq!(found.is_some_and(|range| range[1] == 1.0 && (range[0] - 0.2).abs() < 2e-3), want, "{found:?}");
    }
}

#[test]
fn two_faces_that_share_a_side_leave_nothing_between_them() {
    let [a, b, c, d] = [[-10.0, -10.0], [1010.0, 0.0], [1010.0, 10.0], [-10.0, 0.0]].map(|[x, y]| [x, y, 0.9]);
    let faces = [[a, b, d], [b, c, d]].map(|corners| ScreenFace { corners, vertices: [7, 8, 9] });
    assert!(faces.iter().all(|face| hidden_range(face, &edge(), [1, 2], 1e-6) == Some([0.0, 1.0])));
}

/// A closed ball with bumps, of `n` bands; inside out if the faces are turned.
fn bumpy_ball(n: usize, is_turned: bool) -> String {
    use std::fmt::Write;
    let mut obj = String::new();
    let columns = 2 * n;
    for (i, j) in (0..=n).flat_map(|i| (0..if i % n == 0 { 1 } else { columns }).map(move |j| (i, j))) {
        let [a, b] = [(i, n), (2 * j, columns)].map(|(at, of)| std::f64::consts::PI * at as f64 / of as f64);
        let r = 1.0 + 0.15 * (7.0 * a).sin() * (5.0 * b).sin() + 0.01 * f64::from((i * 7 + j * 5) as u32 % 5);
        writeln!(obj, "v {} {} {}", r * a.sin() * b.cos(), r * a.cos(), r * a.sin() * b.sin()).unwrap();
    }
    let vertex = |i: usize, j: usize| match i {
        0 => 1,
        _ if i == n => 2 + (n - 1) * columns,
        _ => 2 + (i - 1) * columns + j % columns,
    };
    for (i, j) in (0..n).flat_map(|i| (0..columns).map(move |j| (i, j))) {
        let [a, b, c, d] = [vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j)];
        for [p, q, r] in [[a, b, c], [a, c, d]].into_iter().filter(|[p, q, r]| p != q && q != r && r != p) {
            let [q, r] = if is_turned { [r, q] } else { [q, r] };
            writeln!(obj, "f {p} {q} {r}").unwrap();
        }
    }
    obj
}

/// As the search that looks at all edges, and at all faces.
#[test]
fn what_a_closed_surface_hides_changes_no_visible_part() {
    let limits = Limits::default();
    let deadline = Deadline::default();
    let (mut hidden, mut parts) = (0, 0);
    for (is_turned, view, projection) in [
        (false, "iso", "perspective"),
        (false, "front", "orthographic"),
        (true, "top", "perspective"),
        (true, "iso", "orthographic"),
    ] {
        let mut budget = Budget::new(&limits);
        let bundle = Bundle::of_one(bumpy_ball(40, is_turned).into_bytes());
        let mesh = import(&bundle, None, &limits, &mut budget, &deadline).unwrap().0;
        let keys = [("style", "outline"), ("view", view), ("camera.projection", projection)];
        let keys: Vec<(String, String)> = keys.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
        let rules = Rules { limits: limits.clone(), backend: BackendChoice::Auto };
        let spec = request::read(None, &keys, &rules).unwrap();
        let scene = Scene::new(&mesh, &spec, &mut budget).unwrap();
        let mut find = |keep: &[SkipKind], searches_all: bool| {
            let mut cx = PlanContext::new(&mut budget, &deadline, keep);
            let (list, silhouettes) = cx.silhouettes(&scene).unwrap();
            let screen = ScreenMesh::new(&scene, &mut cx).unwrap();
            let outlines = [Some(Thickness::Px(3.0))];
            let mut edges = screen.silhouette_edges(&outlines, &list, &silhouettes, &mut cx).unwrap();
            let hidden = edges.iter().filter(|edge| edge.is_hidden).count();
            edges.iter_mut().for_each(|edge| edge.is_hidden &= !searches_all);
            let view = OutlineView::new(&screen, &outlines, scene.size_px(), 0);
            let places = view.screen_edges(&edges, &mut cx).unwrap();
            let hides = hiding_materials(&scene.groups);
            let parts = visible_parts(&view, &edges, &places, &hides, OutlineMethod::Hull, &mut cx).unwrap();
            (hidden, edges.len(), parts)
        };
        let (_, count, want) = find(&[SkipKind::UnseenFaces], true);
        let (left_out, _, found) = find(&[], false);
        assert!(found == want, "{view} {projection}: {} parts, not {}", found.len(), want.len());
        assert!(5 * left_out > count && 5 * left_out < 4 * count, "{left_out} of {count}");
        (hidden, parts) = (hidden + left_out, parts + found.len());
    }
    assert!(hidden > 400 && parts > 400, "{hidden}, {parts}");
}
