//! The area that a hull (an outline that is drawn as a mesh) should cover: all points
//! within its width of a silhouette edge, on the side away from the surface, and nearer than any
//! surface there. The code calls a silhouette edge with its hull a rim.
//!
//! At a corner, the area of an edge reaches around to the next silhouette edge. If a face of the
//! corner hides one of the two edges, the surface continues between them, and the area leaves out
//! the faces of the corner.
//!
//! Beyond its edge, a hull recedes from the viewer. At its outer border it lies half its width
//! behind the edge: what is next to the edge hides it, and what is far behind does not. Where the
//! plane of the edge's face recedes faster, up to five times, the hull follows that plane, a
//! twentieth of its width behind it. Another face in the same plane, such as the next tooth of a
//! gear, then hides the hull. From the edge to the border, depth is linear.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::super::camera::{Camera, Homogeneous, project};
use super::super::lattice;
use super::super::screen::{Piece, Scene, Screen};
use super::super::surface::rays::nearest;
use super::super::surface::visible::contour;
use super::super::vector::{V2, V3, cross2, dot, length, mix, sub};

/// The distance by which a hull recedes, as shares of its width in units of the model.
const RECEDES: f64 = 0.5;
const FOLLOWS_UP_TO: f64 = 2.5;
const BEHIND_WHAT_IT_FOLLOWS: f64 = 0.05;

/// An edge where the surface ends, and the hull beyond.
#[derive(Clone, Debug)]
pub struct Rim {
    /// x and y in pixels, and depth, of both ends.
    ends: [V3; 2],
    /// Depths of the hull where it ends, beyond both.
    far: [f64; 2],
    /// Away from the surface that ends here, at right angles.
    outward: V2,
    /// By end: what is around it.
    around: [Around; 2],
}

/// The surroundings of an edge's end where the surface ends.
#[derive(Clone, Debug)]
struct Around {
    /// True if a face with this corner hides the edge.
    is_hidden: bool,
    /// In which directions other edges leave where the surface ends too, and whether such a face
    /// hides them.
    others: Vec<(V2, bool)>,
    /// In which directions the two edges leave of each face.
    faces: Vec<[V2; 2]>,
}

/// Everywhere that a scene's surface ends; for hulls so many pixels wide.
pub fn rims(scene: &Scene, width: f64) -> Vec<Rim> {
    let camera = &scene.camera;
    let at = |v: u32| camera.homogeneous(scene.positions[v as usize]);
    let thirds = thirds(scene);
    let edges = contour(scene);
    let mut at_vertex: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &[a, b] in &edges {
        at_vertex.entry(a).or_default().push(b);
        at_vertex.entry(b).or_default().push(a);
    }
    let mut opposite: BTreeMap<u32, Vec<[u32; 2]>> = BTreeMap::new();
    for t in &scene.triangles {
        for k in (0..3).filter(|&k| at_vertex.contains_key(&t[k])) {
            opposite.entry(t[k]).or_default().push([t[(k + 1) % 3], t[(k + 2) % 3]]);
        }
    }
    let mut rims = Vec::new();
    for edge in edges {
        let [a, b] = match camera.in_front(&edge.map(at))[..] {
            [a, b] => [a, b],
            _ => continue,
        };
        let ends = [project(a), project(b)];
        let along = sub([ends[1][0], ends[1][1]], [ends[0][0], ends[0][1]]);
        let thirds: Vec<V3> =
            thirds[&edge].iter().map(|&v| at(v)).filter(|h| h[3] >= camera.near_w).map(project).collect();
        let side = [along[1], -along[0]].map(|v| v / length(along));
        let across = |third: &V3| dot(side, sub([third[0], third[1]], [ends[0][0], ends[0][1]]));
        // Of a face that is seen edge on, rounding says on which side it is.
        let farthest = thirds.iter().map(across).max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let (Some(inner), true) = (farthest, length(along) > 0.0) else { continue };
        let sign = if inner < 0.0 { 1.0 } else { -1.0 };
        let outward = side.map(|v| sign * v);
        let far = [0, 1].map(|k| {
            let beyond = [0, 1].map(|axis| ends[k][axis] + width * outward[axis]);
            let planes = thirds.iter().filter_map(|&third| plane_at([ends[0], ends[1], third], beyond));
            far_depth(camera, [a, b][k], width, planes.fold(f64::INFINITY, f64::min))
        });
        let around = [0, 1].map(|k| {
            let on_screen = |v: u32| Some(at(v)).filter(|h| h[3] >= camera.near_w).map(project);
            let (here, other_end) = (ends[k], ends[1 - k]);
            let faces: Vec<[V3; 2]> =
                opposite[&edge[k]].iter().filter_map(|&[b, c]| Some([on_screen(b)?, on_screen(c)?])).collect();
            let others = at_vertex[&edge[k]].iter().filter(|v| !edge.contains(v)).filter_map(|&v| on_screen(v));
            Around {
                is_hidden: is_hidden(here, other_end, &faces),
                others: others.map(|v| (way(here, v), is_hidden(here, v, &faces))).collect(),
                faces: faces.iter().map(|face| face.map(|v| way(here, v))).collect(),
            }
        });
        rims.push(Rim { ends, far, outward, around });
    }
    rims
}

/// From one point to another on screen.
fn way(from: V3, to: V3) -> V2 {
    sub([to[0], to[1]], [from[0], from[1]])
}

/// True if one of the faces around a corner lies nearer than an edge that leaves it.
fn is_hidden(here: V3, end: V3, faces: &[[V3; 2]]) -> bool {
    let along = way(here, end);
    faces.iter().any(|&[b, c]| {
        let sides = [way(here, b), way(here, c)];
        let is_over =
            is_between(along, sides) || sides.iter().any(|s| cross2(*s, along) == 0.0 && dot(*s, along) > 0.0);
        let depth = plane_at([here, b, c], [end[0], end[1]]);
        is_over && depth.is_some_and(|depth| depth - end[2] > 1e-9 * (depth - here[2]).abs())
    })
}

/// True if a direction lies between two that are less than half a turn apart.
fn is_between(way: V2, [a, b]: [V2; 2]) -> bool {
    let turn = cross2(a, b);
    turn != 0.0 && cross2(a, way) / turn > 0.0 && cross2(way, b) / turn > 0.0
}

/// Depth where a hull ends that begins at `edge`; of what continues its farther face there,
/// `plane`.
fn far_depth(camera: &Camera, edge: Homogeneous, width: f64, plane: f64) -> f64 {
    let gradient = |row: [f64; 4]| [row[0], row[1], row[2]];
    let nearer = gradient(camera.z);
    let change = |row: [f64; 4]| dot(gradient(row), nearer) / length(nearer);
    let units = width * edge[3] / length(gradient(camera.x));
    let receded = |share: f64| {
        let away = share * units;
        (edge[2] - away * change(camera.z)) / (edge[3] - away * change(camera.w))
    };
    let follows = plane < receded(RECEDES) && plane > receded(FOLLOWS_UP_TO);
    if follows { plane - (receded(0.0) - receded(BEHIND_WHAT_IT_FOLLOWS)) } else { receded(RECEDES) }
}

/// Depth of a triangle's plane at a point on screen; None of one that is seen edge on.
fn plane_at(corners: [V3; 3], p: V2) -> Option<f64> {
    let [a, b, c] = corners.map(|v| [v[0], v[1]]);
    let area = cross2(sub(b, a), sub(c, a));
    let weights = [cross2(sub(b, p), sub(c, p)), cross2(sub(c, p), sub(a, p)), cross2(sub(a, p), sub(b, p))];
    (area != 0.0).then(|| (0..3).map(|k| weights[k] / area * corners[k][2]).sum())
}

/// The share of each pixel, row by row, that a hull covers; `side * side` points per pixel.
pub fn ink(screen: &Screen, rims: &[Rim], width: f64, side: u32) -> Vec<f64> {
    let points = lattice::points(side);
    let [columns, rows] = screen.camera.size_px;
    let pixel = |x: u32, y: u32| {
        let corner = [f64::from(x), f64::from(y)];
        let center = corner.map(|v| v + 0.5);
        let near: Vec<&Rim> = rims.iter().filter(|rim| rim.nearest(center).0 < width + 0.71).collect();
        if near.is_empty() {
            return 0.0;
        }
        let pieces = screen.near(&[corner, corner.map(|v| v + 1.0)]);
        let inked = points.iter().filter(|p| is_inked([corner[0] + p[0], corner[1] + p[1]], &near, &pieces, width));
        inked.count() as f64 / points.len() as f64
    };
    (0..rows).into_par_iter().flat_map_iter(|y| (0..columns).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
}

fn is_inked(p: V2, near: &[&Rim], pieces: &[&Piece], width: f64) -> bool {
    // Before nothing it is seen however far it recedes.
    let surface = nearest(pieces, p).map_or(f64::NEG_INFINITY, |(_, depth)| depth);
    near.iter().any(|rim| {
        let (distance, t) = rim.nearest(p);
        let [x, y, depth] = mix(rim.ends[0], rim.ends[1], t);
        let far = rim.far[0] + t * (rim.far[1] - rim.far[0]);
        let way = sub(p, [x, y]);
        let along = sub([rim.ends[1][0], rim.ends[1][1]], [rim.ends[0][0], rim.ends[0][1]]);
        let is_free = match t {
            _ if t <= 0.0 => rim.around[0].is_free(along, way),
            _ if t >= 1.0 => rim.around[1].is_free(along.map(|v| -v), way),
            _ => true,
        };
        let is_beyond = dot(rim.outward, way) >= 0.0 && is_free;
        distance <= width && is_beyond && depth + distance / width * (far - depth) > surface
    })
}

impl Around {
    /// True if the hull of an edge that leaves in direction `own` goes around its end as far as to
    /// another one.
    fn is_free(&self, own: V2, way: V2) -> bool {
        let turning = cross2(own, way).signum();
        let turned = |v: V2| (turning * cross2(own, v)).atan2(dot(own, v)).rem_euclid(std::f64::consts::TAU);
        let next = self.others.iter().min_by(|a, b| turned(a.0).total_cmp(&turned(b.0)));
        if next.is_some_and(|(next, _)| is_between(*next, [own, way])) {
            return false;
        }
        let goes_on = self.is_hidden || next.is_some_and(|(_, is_hidden)| *is_hidden);
        !goes_on || !self.faces.iter().any(|face| is_between(way, *face))
    }
}

impl Rim {
    /// A point's distance from it on screen, and its place along it.
    fn nearest(&self, p: V2) -> (f64, f64) {
        let [a, b] = self.ends.map(|end| [end[0], end[1]]);
        let along = sub(b, a);
        let squared = dot(along, along);
        let t = if squared > 0.0 { (dot(sub(p, a), along) / squared).clamp(0.0, 1.0) } else { 0.0 };
        (length(sub(p, mix(a, b, t))), t)
    }
}

/// By edge: the third vertices of the faces that have it.
fn thirds(scene: &Scene) -> BTreeMap<[u32; 2], Vec<u32>> {
    let mut thirds: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for t in &scene.triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            thirds.entry([a.min(b), a.max(b)]).or_default().push(t[(k + 2) % 3]);
        }
    }
    thirds
}
