//! The distance of points from a shape on screen, from which the accuracy tests know what its
//! outline should cover.

use std::collections::BTreeMap;

use meshsnap_render::plan::Projection;

use crate::oracle::lattice;
use crate::oracle::screen::{Piece, Scene, Screen};
use crate::oracle::surface::visible::{contour, on_screen};
use crate::oracle::vector::{V2, V3, distance_to_segment, dot};

/// The width of an outline, pixels.
#[derive(Clone, Copy, Debug)]
pub struct Width {
    pub px: f64,
    /// The width in units of the box, and how to get 1 / W from depth; None where the width is the
    /// same everywhere.
    pub in_units: Option<[f64; 3]>,
}

impl Width {
    /// As wide as `px` pixels are where `projection` looks at.
    pub fn in_units(projection: &Projection, px: f64) -> Self {
        // z = c (far / W - 1), with both from the row of depth.
        let length = |row: [f32; 4]| (0..3).map(|k| f64::from(row[k]).powi(2)).sum::<f64>().sqrt();
        let (c, distance) = (length(projection.z), f64::from(projection.w[3]));
        let far = f64::from(projection.z[3]) / c + distance;
        Self { px, in_units: Some([px * distance, 1.0 / (c * far), 1.0 / far]) }
    }

    /// At a depth.
    fn at(&self, depth: f64) -> f64 {
        self.in_units.map_or(self.px, |[at_1, slope, offset]| at_1 * (slope * depth + offset))
    }
}

/// Around what a truth puts the circles whose union is an outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Around {
    /// Every point of the contour, as large as the outline is at that point's depth.
    Contour,
    /// Every point of the surface, as large as at its own depth. What comes nearer inside of the
    /// contour may reach beyond what the contour's own points reach.
    Surface,
}

/// The shape on screen, and how far points are from it, as its outline counts: this wide on its
/// border.
pub struct Shadow {
    pieces: Vec<Piece>,
    /// The widened segments: ends with their depth.
    sides: Vec<[V3; 2]>,
    width: Width,
    size_px: [u32; 2],
    /// Of each pixel's middle.
    pub distances: Vec<f64>,
    points: Vec<V2>,
    /// Distances of the points in some pixels, sorted.
    sorted: BTreeMap<usize, Vec<f64>>,
}

/// The least of what a point on the segment is away, less how much wider the outline is there.
fn distance_to_side(width: &Width, p: V2, [a, b]: [V3; 2]) -> f64 {
    let flat = |v: V3| [v[0], v[1]];
    let length = distance_to_segment(flat(a), flat(b), flat(b));
    let widths = [width.at(a[2]), width.at(b[2])];
    if width.in_units.is_none() || length == 0.0 {
        return distance_to_segment(p, flat(a), flat(b)) + width.px - widths[0].max(widths[1]);
    }
    let along = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
    let from = [p[0] - a[0], p[1] - a[1]];
    let (x, y) = (dot(from, along), (from[0] * along[1] - from[1] * along[0]).abs());
    let grows = (widths[1] - widths[0]) / length;
    // Where it points at the viewer, one end's outline surrounds the other's.
    let nearest = if grows.abs() < 1.0 { x + y * grows / (1.0 - grows * grows).sqrt() } else { grows * f64::INFINITY };
    let t = nearest.clamp(0.0, length);
    (x - t).hypot(y) + width.px - (widths[0] + grows * t)
}

/// Of a point from the shape, as far as these tell.
fn distance(width: &Width, p: V2, pieces: &[&Piece], sides: &[[V3; 2]]) -> f64 {
    if pieces.iter().any(|piece| (0..3).all(|k| piece.side(k, p) >= 0.0)) {
        return 0.0;
    }
    sides.iter().map(|side| distance_to_side(width, p, *side)).fold(f64::INFINITY, f64::min)
}

impl Shadow {
    pub fn new(scene: &Scene, around: Around, width: Width) -> Self {
        let pieces = Screen::new(scene).pieces;
        let sides: Vec<[V3; 2]> = match around {
            Around::Contour => contour(scene).into_iter().filter_map(|edge| on_screen(scene, edge)).collect(),
            Around::Surface => {
                pieces.iter().flat_map(|p| [[0, 1], [1, 2], [2, 0]].map(|side| side.map(|k| p.corners[k]))).collect()
            }
        };
        let size_px = scene.camera.size_px;
        let all: Vec<&Piece> = pieces.iter().collect();
        let pixels = 0..(size_px[0] * size_px[1]) as usize;
        let distances = pixels.map(|i| distance(&width, middle(size_px, i), &all, &sides)).collect();
        Self { pieces, sides, width, size_px, distances, points: lattice::points(16), sorted: BTreeMap::new() }
    }

    /// Distances from the shape of points all over a pixel, sorted.
    pub fn sorted(&mut self, pixel: usize) -> &[f64] {
        let Self { pieces, sides, width, size_px, distances, points, sorted } = self;
        sorted.entry(pixel).or_insert_with(|| {
            let [x, y] = middle(*size_px, pixel);
            // A point's nearest side is not farther from the pixel's middle than its own nearest,
            // twice half a diagonal later.
            let reach = distances[pixel] + 1.5;
            let near: Vec<[V3; 2]> =
                sides.iter().copied().filter(|side| distance_to_side(width, [x, y], *side) <= reach).collect();
            let is_near = |piece: &&Piece| (0..3).all(|k| piece_distance(piece, k, [x, y]) > -0.71);
            let around: Vec<&Piece> = pieces.iter().filter(is_near).collect();
            let at = |p: &V2| distance(width, [x - 0.5 + p[0], y - 0.5 + p[1]], &around, &near);
            let mut all: Vec<f64> = points.iter().map(at).collect();
            all.sort_by(f64::total_cmp);
            all
        })
    }
}

/// The distance of a point inside of the line through side `k`, pixels.
fn piece_distance(piece: &Piece, k: usize, p: V2) -> f64 {
    let [a, b] = [1, 2].map(|i| piece.corners[(k + i) % 3]);
    piece.side(k, p) / (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-300)
}

fn middle(size_px: [u32; 2], pixel: usize) -> V2 {
    let width = size_px[0] as usize;
    [pixel % width, pixel / width].map(|v| v as f64 + 0.5)
}
