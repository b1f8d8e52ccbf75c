//! The picture that any scene should have, by many points per pixel: the nearest surface at a point,
//! each triangle's share of a pixel, and whole pictures, with lines over the surfaces.

use rayon::prelude::*;

use super::super::lattice;
use super::super::lines::coverage::{is_inked, near_pixel, segments_by_row};
use super::super::screen::{Piece, Screen};
use super::super::vector::V2;
use super::visible::Segment;

/// The nearest of some pieces at a point, and its depth; of equal ones the first.
pub fn nearest<'a>(pieces: &[&'a Piece], p: V2) -> Option<(&'a Piece, f64)> {
    let mut best: Option<(&Piece, f64)> = None;
    for piece in pieces {
        if let Some(depth) = piece.depth(p)
            && depth > 0.0
            && best.is_none_or(|(_, nearest)| depth > nearest)
        {
            best = Some((piece, depth));
        }
    }
    best
}

/// The share of a pixel that each triangle shows, nearest surfaces only.
pub fn shares(screen: &Screen, pixel: [u32; 2], side: u32) -> Vec<(u32, f64)> {
    let corner = pixel.map(f64::from);
    let near = screen.near(&[corner, [corner[0] + 1.0, corner[1] + 1.0]]);
    let points = lattice::points(side);
    let mut shares: Vec<(u32, f64)> = Vec::new();
    for p in &points {
        let Some((piece, _)) = nearest(&near, [corner[0] + p[0], corner[1] + p[1]]) else { continue };
        match shares.iter_mut().find(|(triangle, _)| *triangle == piece.triangle) {
            Some((_, share)) => *share += 1.0 / points.len() as f64,
            None => shares.push((piece.triangle, 1.0 / points.len() as f64)),
        }
    }
    shares
}

/// Opaque lines over a scene.
pub struct Pen<'a> {
    pub segments: &'a [Segment],
    pub width: f64,
    pub color: [f64; 3],
}

/// A picture in linear light, row by row: lines over the surface, whose colour `shade` tells by
/// triangle and point, over a background.
pub fn picture(
    screen: &Screen,
    pen: &Pen<'_>,
    background: [f64; 3],
    side: u32,
    shade: impl Fn(u32, V2) -> [f64; 3] + Sync,
) -> Vec<[f64; 3]> {
    let points = lattice::points(side);
    let size = screen.camera.size_px;
    let rows = segments_by_row(size, pen.segments, 0.5 * pen.width);
    let color = |corner: V2, row: &[Segment]| {
        let pieces = screen.near(&[corner, [corner[0] + 1.0, corner[1] + 1.0]]);
        let pieces: Vec<&Piece> = pieces.into_iter().filter(|piece| touches(piece, corner)).collect();
        let lines = near_pixel(corner, row, 0.5 * pen.width);
        let mut sum = [0.0; 3];
        for p in &points {
            let p = [corner[0] + p[0], corner[1] + p[1]];
            let seen = if is_inked(p, &lines, 0.5 * pen.width) {
                pen.color
            } else {
                nearest(&pieces, p).map_or(background, |(piece, _)| shade(piece.triangle, p))
            };
            sum = std::array::from_fn(|k| sum[k] + seen[k]);
        }
        sum.map(|v| v / points.len() as f64)
    };
    let row = |(y, near): (usize, &Vec<u32>)| -> Vec<[f64; 3]> {
        let near: Vec<Segment> = near.iter().map(|&i| pen.segments[i as usize]).collect();
        (0..size[0]).map(|x| color([f64::from(x), y as f64], &near)).collect()
    };
    rows.par_iter().enumerate().flat_map_iter(row).collect()
}

/// True if a piece may touch a pixel: none of its sides has all of the pixel's corners outside.
fn touches(piece: &Piece, corner: V2) -> bool {
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|d| [corner[0] + d[0], corner[1] + d[1]]);
    (0..3).all(|k| corners.iter().any(|&p| piece.side(k, p) >= 0.0))
}
