//! The share of each pixel that lines cover, by many points per pixel.

use rayon::prelude::*;

use super::super::lattice;
use super::super::surface::visible::Segment;
use super::super::vector::{V2, distance_to_segment, dot, mix, sub};

/// The share of each pixel, row by row, that lies within half of `width` of a segment; `side *
/// side` points per pixel.
pub fn ink(size_px: [u32; 2], segments: &[Segment], width: f64, side: u32) -> Vec<f64> {
    let points = lattice::points(side);
    let rows = segments_by_row(size_px, segments, 0.5 * width);
    let row = |(y, near): (usize, &Vec<u32>)| -> Vec<f64> {
        let near: Vec<Segment> = near.iter().map(|&i| segments[i as usize]).collect();
        (0..size_px[0]).map(|x| pixel([f64::from(x), y as f64], &near, 0.5 * width, &points)).collect()
    };
    rows.par_iter().enumerate().flat_map_iter(row).collect()
}

/// True if a point lies within `radius` of a segment.
pub fn is_inked(p: V2, segments: &[Segment], radius: f64) -> bool {
    segments.iter().any(|[a, b]| {
        let (along, from) = (sub(*b, *a), sub(p, *a));
        let squared = dot(along, along);
        let t = if squared > 0.0 { (dot(from, along) / squared).clamp(0.0, 1.0) } else { 0.0 };
        let way = sub(p, mix(*a, *b, t));
        dot(way, way) <= radius * radius
    })
}

/// The segments that come within `radius` of a pixel's square, `corner` being its upper left
/// corner.
pub fn near_pixel(corner: V2, segments: &[Segment], radius: f64) -> Vec<Segment> {
    let center = [corner[0] + 0.5, corner[1] + 0.5];
    let reach = radius + std::f64::consts::FRAC_1_SQRT_2;
    segments.iter().copied().filter(|[a, b]| distance_to_segment(center, *a, *b) <= reach).collect()
}

/// For each row of pixels the segments that may come within `radius` of it.
pub fn segments_by_row(size_px: [u32; 2], segments: &[Segment], radius: f64) -> Vec<Vec<u32>> {
    let mut rows = vec![Vec::new(); size_px[1] as usize];
    for (i, [a, b]) in segments.iter().enumerate() {
        let first = (a[1].min(b[1]) - radius).floor().max(0.0);
        let last = (a[1].max(b[1]) + radius).floor().min(f64::from(size_px[1]) - 1.0);
        if first <= last {
            rows[first as usize..=last as usize].iter_mut().for_each(|row| row.push(i as u32));
        }
    }
    rows
}

fn pixel(corner: V2, segments: &[Segment], radius: f64, points: &[V2]) -> f64 {
    let near = near_pixel(corner, segments, radius);
    if near.is_empty() {
        return 0.0;
    }
    let inked = points.iter().filter(|p| is_inked([corner[0] + p[0], corner[1] + p[1]], &near, radius));
    inked.count() as f64 / points.len() as f64
}
