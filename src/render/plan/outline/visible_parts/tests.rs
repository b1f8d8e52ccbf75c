//! Tests of the parts of an edge that faces hide, and of the parts that are left.

use super::grid::ScreenFace;
use super::*;

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
