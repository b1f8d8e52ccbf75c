//! The visible parts of an edge. On screen an edge and a triangle are straight and their depths
//! are affine, so what a triangle hides of an edge is an interval. Its ends are roots
//! of four affine functions: the three sides of the triangle, and the difference in depth.

use std::collections::BTreeMap;

use super::super::camera::project;
use super::super::screen::{Piece, Scene, Screen, is_front};
use super::super::vector::{V2, V3, length, mix, sub};

/// A piece of an edge on screen, pixels from the upper left corner.
pub type Segment = [V2; 2];

/// The share of its depth by which a surface must be nearer to hide an edge: more than f64 rounds,
/// and far less than any two surfaces that are not meant to touch.
const NEARER: f64 = 1e-9;

/// Twice the area that a side spans with a point on it, as f64 rounds it, square pixels.
const ON_SIDE: f64 = 1e-8;

/// The longest rest of an edge that rounding alone leaves where its occluder ends. Its round caps
/// would show as a dot.
const CRUMB_PX: f64 = 1e-4;

/// Every edge, hidden or not.
pub fn all(scene: &Scene) -> Vec<Segment> {
    scene.edges.iter().filter_map(|&edge| on_screen(scene, edge)).map(|[a, b]| [xy(a), xy(b)]).collect()
}

/// The visible parts of the scene's edges.
pub fn visible(scene: &Scene, screen: &Screen) -> Vec<Segment> {
    let mut segments = Vec::new();
    for &edge in &scene.edges {
        let Some([a, b]) = on_screen(scene, edge) else { continue };
        for [from, to] in visible_parts(screen, edge, [a, b]) {
            let segment = [from, to].map(|t| xy(mix(a, b, t)));
            let is_whole = from <= 0.0 && to >= 1.0;
            if is_whole || length(sub(segment[1], segment[0])) > CRUMB_PX {
                segments.push(segment);
            }
        }
    }
    segments
}

/// The edges on the silhouette: with one face alone, or with one face that looks at the viewer and
/// one that looks away.
pub fn contour(scene: &Scene) -> Vec<[u32; 2]> {
    let mut sides: BTreeMap<[u32; 2], Vec<bool>> = BTreeMap::new();
    for t in &scene.triangles {
        let front = is_front(&scene.camera, t.map(|v| scene.positions[v as usize]));
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            // A face that is seen edge on shows nothing of its front.
            sides.entry([a.min(b), a.max(b)]).or_default().push(front == Some(true));
        }
    }
    let turns = |fronts: &Vec<bool>| fronts.len() == 1 || fronts.contains(&true) && fronts.contains(&false);
    sides.into_iter().filter(|(_, fronts)| turns(fronts)).map(|(edge, _)| edge).collect()
}

/// The part of an edge in front of the near plane.
pub fn on_screen(scene: &Scene, edge: [u32; 2]) -> Option<[V3; 2]> {
    let ends = edge.map(|v| scene.camera.homogeneous(scene.positions[v as usize]));
    match scene.camera.in_front(&ends)[..] {
        [a, b] => Some([project(a), project(b)]),
        _ => None,
    }
}

/// Intervals of 0 to 1 along an edge where nothing hides it.
pub fn visible_parts(screen: &Screen, edge: [u32; 2], [a, b]: [V3; 2]) -> Vec<[f64; 2]> {
    let is_incident = |piece: &Piece| edge.iter().all(|v| piece.vertices.contains(v));
    let mut hidden: Vec<[f64; 2]> = screen
        .near(&[xy(a), xy(b)])
        .into_iter()
        .filter(|piece| !is_incident(piece))
        .filter_map(|piece| hidden_by(piece, a, b))
        .collect();
    hidden.sort_by(|p, q| p[0].total_cmp(&q[0]));
    let mut visible = Vec::new();
    let mut from = 0.0;
    for [start, end] in hidden {
        if start > from {
            visible.push([from, start]);
        }
        from = f64::max(from, end);
    }
    if from < 1.0 {
        visible.push([from, 1.0]);
    }
    visible
}

/// The interval in which a triangle lies in front of the edge from `a` to `b`.
fn hidden_by(piece: &Piece, a: V3, b: V3) -> Option<[f64; 2]> {
    let (mut from, mut to) = (0.0, 1.0);
    for k in 0..3 {
        let [at_a, at_b] = [a, b].map(|p| piece.side(k, xy(p)));
        // A part on a side from end to end is hidden, or two triangles that share it would leave it
        // between them.
        if at_a.abs().max(at_b.abs()) > ON_SIDE {
            narrow(&mut from, &mut to, at_a, at_b)?;
        }
    }
    // Depths are compared only where the edge is inside, so that thin triangles need not be
    // continued far.
    let nearer = |t: f64| {
        let depth = piece.depth_inside(xy(mix(a, b, t)));
        depth - mix(a, b, t)[2] - NEARER * depth.abs()
    };
    let (start, end) = (from, to);
    let (mut s, mut e) = (0.0, 1.0);
    narrow(&mut s, &mut e, nearer(start), nearer(end))?;
    Some([start + s * (end - start), start + e * (end - start)])
}

/// Cuts an interval down to where the affine function with these values at 0 and 1 is positive.
fn narrow(from: &mut f64, to: &mut f64, at_0: f64, at_1: f64) -> Option<()> {
    if at_0 <= 0.0 && at_1 <= 0.0 {
        return None;
    }
    if at_0 < 0.0 {
        *from = from.max(at_0 / (at_0 - at_1));
    } else if at_1 < 0.0 {
        *to = to.min(at_0 / (at_0 - at_1));
    }
    (*from < *to).then_some(())
}

fn xy(p: V3) -> V2 {
    [p[0], p[1]]
}
