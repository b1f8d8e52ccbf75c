//! Stage mixed, per triangle: those that are so thin that samples miss them, as hairs and slivers.
//!
//! Each is followed along its longer side, and every pixel that it touches is marked where some sample sees what lies
//! behind it, and colours break off from there to it. That pixel alone is mixed then, and not its neighbours.

use super::look::Pairs;
use super::{MixedPixels, breaks};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::mixed::band_triangles::ScreenTriangle;
use crate::backend::cpu::mixed::points::POINT_GRID;
use crate::backend::cpu::mixed::triangle::PointTriangle;

/// Pixels on each side of the longer side's line in which a thin triangle may lie, at most.
pub const REACH_PX: i32 = 2;

/// Marks the pixels of a band in which a thin triangle may be seen.
#[inline(never)]
pub fn mark_thin(
    context: &RasterContext<'_>,
    band: &SampleBand,
    ScreenTriangle { id, corners, .. }: &ScreenTriangle,
    pairs: &mut Pairs,
    mixed: &mut MixedPixels,
) {
    let nearest = corners.iter().map(|v| v.z).fold(0.0, f32::max);
    // Made for the first pixel in which it may be seen: most thin triangles lie behind others.
    let mut points: Option<PointTriangle> = None;
    let half = band.size_px.map(|size| 128 * size as i32);
    let places = corners.each_ref().map(|v| [v.x + half[0], v.y + half[1]]);
    let extent = |axis: usize| {
        let all = places.map(|place| place[axis]);
        [all[0].min(all[1]).min(all[2]), all[0].max(all[1]).max(all[2])]
    };
    let shown = [[0, band.size_px[0] as i32], band.shown.map(|row| row as i32)];
    let bounds = [0, 1].map(|axis| POINT_GRID.pixels(extent(axis), shown[axis]));
    let sizes = [0, 1].map(|axis| extent(axis)[1] - extent(axis)[0]);
    let along = usize::from(sizes[0] < sizes[1]);
    let across = 1 - along;
    // The ends of the side that is as long as the triangle.
    let by_place = |a: &[i32; 2], b: &[i32; 2]| a[along].cmp(&b[along]);
    let (Some(from), Some(to)) = (places.into_iter().min_by(by_place), places.into_iter().max_by(by_place)) else {
        return;
    };
    let rise = (to[across] - from[across]) as f32 / sizes[along] as f32;
    for step in bounds[along][0]..=bounds[along][1] {
        let ahead = (256 * step + 128 - from[along]).clamp(0, sizes[along]);
        let middle = (from[across] + (ahead as f32 * rise) as i32) >> 8;
        let [low, high] = [middle - REACH_PX, middle + REACH_PX];
        for beside in low.max(bounds[across][0])..=high.min(bounds[across][1]) {
            let pixel = if along == 0 { [step, beside] } else { [beside, step] };
            let corner = [256 * pixel[0] - half[0], 256 * pixel[1] - half[1]];
            let (ids, depths) = band.pixel(pixel[0], pixel[1]);
            let may_be_seen = depths.iter().any(|depth| nearest > *depth);
            if !may_be_seen {
                continue;
            }
            let Some(points) =
                points.take().or_else(|| PointTriangle::new(*id, corners)).map(|own| &*points.insert(own))
            else {
                return;
            };
            if points.at(corner).is_none() {
                continue;
            }
            let mut found = 0;
            for (&seen, _) in ids.iter().zip(depths).filter(|(_, depth)| nearest > **depth) {
                found |= pairs.step(context, seen, *id).breaks(breaks::THIN);
            }
            let row = (pixel[1] - shown[1][0]) as usize;
            mixed.thin[row * band.size_px[0] as usize + pixel[0] as usize] |= found;
        }
    }
}
