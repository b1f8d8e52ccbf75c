//! The search for pixels with triangles so thin that samples miss them, such as hairs and slivers
//! (stage mixed). Such pixels are marked as mixed: they are drawn a second time, from more points.
//!
//! A thin triangle is followed along its longer side. A pixel that it touches is marked if no
//! sample shows the triangle, and a sample shows something that is farther away than the triangle's
//! nearest corner and differs from it in colour. Neighbours of these pixels are not marked.

use super::breaks;
use super::pairs::Pairs;
use crate::backend::cpu::bands::lists::{BoxedFace, unpair};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::backend::cpu::mixed::band_triangles::ScreenTriangle;
use crate::backend::cpu::mixed::points::POINT_GRID;
use crate::backend::cpu::mixed::triangle::PointTriangle;

/// By so much a line's place may be rounded, 1/256 px. Back-ends may round it differently: more pixels do no harm,
/// since integers decide which of them the triangle touches.
pub const SLACK: i32 = 4;

/// Pixels of a box that are few enough to be looked at in advance.
const FEW: i32 = 16;

/// True if a thin triangle may change marks. If its box has few pixels they are looked at: a mark stays as it is where it
/// is hard already, where a sample sees the triangle, and where all samples see what is nearer.
#[inline(always)]
pub fn may_mark(band: &SampleBand, face: &BoxedFace, marks: &[u8]) -> bool {
    let [[left, right], [top, bottom]] = [face.columns, face.rows].map(unpair);
    let [left, right] = [left.max(0), right.min(band.size_px[0] as i32 - 1)];
    let [top, bottom] = [top.max(band.shown[0] as i32), bottom.min(band.shown[1] as i32 - 1)];
    if (right - left + 1) * (bottom - top + 1) > FEW {
        return true;
    }
    for y in top..=bottom {
        for x in left..=right {
            if is_hard(marks[index(band, x, y)]) {
                continue;
            }
            let (ids, depths) = band.pixel(x, y);
            if is_before(face.depth_max, depths) && !ids.contains(&face.id) {
                return true;
            }
        }
    }
    false
}

/// The index of a pixel of the shown rows in a list of all of them.
#[inline(always)]
fn index(band: &SampleBand, x: i32, y: i32) -> usize {
    (y - band.shown[0] as i32) as usize * band.size_px[0] as usize + x as usize
}

/// True for the mark of a pixel that has all points already: others do not change it.
#[inline(always)]
fn is_hard(mark: u8) -> bool {
    mark >> breaks::HARD != 0
}

#[inline(always)]
fn is_before(nearest: f32, depths: &[f32]) -> bool {
    depths.iter().any(|depth| nearest > *depth)
}

/// Marks the pixels of a band's shown rows in which a thin triangle may be seen. Returns the number of samples that
/// were looked at.
#[inline(never)]
pub fn mark_thin(
    context: &RasterContext<'_>,
    band: &SampleBand,
    triangle: &ScreenTriangle,
    pairs: &mut Pairs<'_>,
    marks: &mut [u8],
) -> usize {
    let ScreenTriangle { id, corners } = triangle;
    let nearest = corners.iter().map(|v| v.z).fold(0.0, f32::max);
    // Made for the first pixel in which it may be seen: most thin triangles lie behind others.
    let mut points: Option<PointTriangle> = None;
    let [width, height] = band.size_px.map(|size| size as i32);
    let mut looked_at = 0;
    for_each_pixel(corners, [width, height], band.shown.map(|row| row as i32), |[x, y]| {
        looked_at += band.samples as usize;
        let mark = &mut marks[index(band, x, y)];
        if is_hard(*mark) {
            return;
        }
        let (ids, depths) = band.pixel(x, y);
        if !is_before(nearest, depths) || ids.contains(id) {
            return;
        }
        if points.is_none() {
            points = PointTriangle::new(*id, corners);
        }
        let corner = [256 * x - 128 * width, 256 * y - 128 * height];
        if points.as_ref().is_none_or(|points| points.at(corner).is_none()) {
            return;
        }
        let mut found = 0;
        for (&seen, _) in ids.iter().zip(depths).filter(|(_, depth)| nearest > **depth) {
            found |= pairs.step(context, seen, *id).breaks(breaks::THIN);
        }
        *mark |= found;
    });
    looked_at
}

/// Calls `each` with all pixels of some rows that a thin triangle touches, and with a few beside it.
#[inline(always)]
fn for_each_pixel(corners: &[ScreenVertex; 3], size_px: [i32; 2], rows: [i32; 2], mut each: impl FnMut([i32; 2])) {
    let places = corners.each_ref().map(|v| [v.x + 128 * size_px[0], v.y + 128 * size_px[1]]);
    let extent = |axis: usize| {
        let all = places.map(|place| place[axis]);
        [all[0].min(all[1]).min(all[2]), all[0].max(all[1]).max(all[2])]
    };
    let bounds = [POINT_GRID.pixels(extent(0), [0, size_px[0]]), POINT_GRID.pixels(extent(1), rows)];
    let sizes = [0, 1].map(|axis| extent(axis)[1] - extent(axis)[0]);
    let along = usize::from(sizes[0] < sizes[1]);
    let across = 1 - along;
    // The side that is as long as the triangle: its ends, and on which side of it the third corner lies.
    let at_end = |end: usize| places.iter().position(|place| place[along] == extent(along)[end]).unwrap_or_default();
    let (first, last) = (at_end(0), at_end(1));
    let (start, end, third) = (places[first], places[last], places[3 - first - last]);
    let slope = (end[across] - start[across]) as f32 / sizes[along] as f32;
    let line_at = |ahead: i32| start[across] + (ahead as f32 * slope) as i32;
    let aside = third[across] - line_at(third[along] - start[along]);
    let slack = (128.0 * slope.abs()) as i32 + SLACK;
    for step in bounds[along][0]..=bounds[along][1] {
        let middle = line_at((256 * step + 128 - start[along]).clamp(0, sizes[along]));
        let low = (middle + aside.min(0) - slack) >> 8;
        let high = (middle + aside.max(0) + slack) >> 8;
        for beside in low.max(bounds[across][0])..=high.min(bounds[across][1]) {
            each(if along == 0 { [step, beside] } else { [beside, step] });
        }
    }
}
