//! Part 3e: what a pushed-out hull should show: the outer half of a contour, the strip beside the silhouette on the side where
//! its surface is not.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::camera::project;
use super::lattice;
use super::rays::nearest;
use super::screen::{Piece, Scene, Screen, is_front};
use super::vector::{V2, dot, mix, sub};
use super::visible::{contour, on_screen, visible_parts};

/// A visible piece of the silhouette.
#[derive(Clone, Copy, Debug)]
pub struct Rim {
    /// x and y in pixels, and depth, of both ends.
    ends: [[f64; 3]; 2],
    /// Away from the surface that ends here, at right angles.
    outward: V2,
    /// Of the whole edge.
    vertices: [u32; 2],
}

/// All visible pieces of a scene's silhouette.
pub fn rims(scene: &Scene, screen: &Screen) -> Vec<Rim> {
    let inner = inner_vertices(scene);
    let mut rims = Vec::new();
    for vertices in contour(scene) {
        let (Some([a, b]), Some(&inner)) = (on_screen(scene, vertices), inner.get(&vertices)) else { continue };
        let [x, y, _] = project(scene.camera.homogeneous(scene.positions[inner as usize]));
        let side = [a[1] - b[1], b[0] - a[0]];
        let sign = if dot(side, sub([x, y], [a[0], a[1]])) < 0.0 { 1.0 } else { -1.0 };
        let outward = side.map(|v| sign * v);
        let parts = visible_parts(screen, vertices, [a, b]);
        rims.extend(parts.into_iter().map(|part| Rim { ends: part.map(|t| mix(a, b, t)), outward, vertices }));
    }
    rims
}

/// The share of each pixel, row by row, that lies within `thickness` of a rim, beyond it, and not behind another surface;
/// `side * side` points a pixel.
pub fn ink(screen: &Screen, rims: &[Rim], thickness: f64, side: u32) -> Vec<f64> {
    let points = lattice::points(side);
    let [width, height] = screen.camera.size_px;
    let pixel = |x: u32, y: u32| {
        let corner = [f64::from(x), f64::from(y)];
        let center = corner.map(|v| v + 0.5);
        let near: Vec<&Rim> = rims.iter().filter(|rim| rim.distance(center).0 < thickness + 0.71).collect();
        if near.is_empty() {
            return 0.0;
        }
        let pieces = screen.near(&[corner, corner.map(|v| v + 1.0)]);
        let inked = points.iter().filter(|p| is_inked([corner[0] + p[0], corner[1] + p[1]], &near, &pieces, thickness));
        inked.count() as f64 / points.len() as f64
    };
    (0..height).into_par_iter().flat_map_iter(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
}

fn is_inked(p: V2, near: &[&Rim], pieces: &[&Piece], thickness: f64) -> bool {
    let surface = nearest(pieces, p);
    near.iter().any(|rim| {
        let (distance, depth) = rim.distance(p);
        let is_beyond = dot(rim.outward, sub(p, [rim.ends[0][0], rim.ends[0][1]])) >= 0.0;
        let is_free = surface
            .is_none_or(|(piece, nearest)| nearest < depth && !piece.vertices.iter().any(|v| rim.vertices.contains(v)));
        distance <= thickness && is_beyond && is_free
    })
}

impl Rim {
    /// How far a point is from it on screen, and the depth of its nearest point.
    fn distance(&self, p: V2) -> (f64, f64) {
        let [a, b] = self.ends;
        let along = [b[0] - a[0], b[1] - a[1]];
        let squared = dot(along, along);
        let t = if squared > 0.0 { (dot(sub(p, [a[0], a[1]]), along) / squared).clamp(0.0, 1.0) } else { 0.0 };
        let [x, y, depth] = mix(a, b, t);
        ((p[0] - x).hypot(p[1] - y), depth)
    }
}

/// By edge: the third vertex of a face that has it, of one that looks at the viewer if there is one.
fn inner_vertices(scene: &Scene) -> BTreeMap<[u32; 2], u32> {
    let mut inner = BTreeMap::new();
    for wanted in [false, true] {
        for t in &scene.triangles {
            if (is_front(&scene.camera, t.map(|v| scene.positions[v as usize])) == Some(true)) == wanted {
                for k in 0..3 {
                    let (a, b) = (t[k], t[(k + 1) % 3]);
                    inner.insert([a.min(b), a.max(b)], t[(k + 2) % 3]);
                }
            }
        }
    }
    inner
}
