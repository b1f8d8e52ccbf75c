//! The columns of pixels that a triangle may touch in a row of pixels (stage mixed). For a large
//! slanted triangle these are about half of the pixels of its bounding box or fewer. So fewer of
//! the mixed pixels, which are drawn a second time from many points, have to test it.

use crate::backend::cpu::geometry::transform::ScreenVertex;

/// By so much a border's place may be rounded, 1/256 px. Coordinates have up to 22 bits, and f32 keeps 24.
const SLACK: f32 = 4.0;

/// The borders of a triangle.
pub struct Spans([Border; 3]);

/// An edge from its upper end to its lower one, 1/256 px from the picture's corner.
#[derive(Clone, Copy)]
struct Border {
    x: f32,
    y: f32,
    y_end: f32,
    /// Columns per row; 0 for edges along a row, whose ends belong to the other two.
    slope: f32,
}

impl Spans {
    /// Those of a triangle in a picture of this size.
    #[inline(always)]
    pub fn new(corners: &[ScreenVertex; 3], size_px: [u32; 2]) -> Self {
        let half = [128.0 * size_px[0] as f32, 128.0 * size_px[1] as f32];
        let mut borders = [Border { x: 0.0, y: 0.0, y_end: 0.0, slope: 0.0 }; 3];
        for k in 0..3 {
            let (a, b) = (&corners[k], &corners[(k + 1) % 3]);
            let (upper, lower) = if a.y <= b.y { (a, b) } else { (b, a) };
            let height = (lower.y - upper.y) as f32;
            borders[k] = Border {
                x: upper.x as f32 + half[0],
                y: upper.y as f32 + half[1],
                y_end: lower.y as f32 + half[1],
                slope: if height > 0.0 { (lower.x - upper.x) as f32 / height } else { 0.0 },
            };
        }
        Self(borders)
    }

    /// First and last column in a row of pixels; the first is beyond the last if there are none.
    #[inline(always)]
    pub fn columns(&self, row: i32) -> [i32; 2] {
        let (top, bottom) = (256.0 * row as f32, 256.0 * (row + 1) as f32);
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for border in &self.0 {
            let from = if border.y > top { border.y } else { top };
            let to = if border.y_end < bottom { border.y_end } else { bottom };
            let (a, b) = (border.x + border.slope * (from - border.y), border.x + border.slope * (to - border.y));
            let (least, most) = if a < b { (a, b) } else { (b, a) };
            low = if (from <= to) & (least < low) { least } else { low };
            high = if (from <= to) & (most > high) { most } else { high };
        }
        [(low - SLACK) as i32 >> 8, (high + SLACK) as i32 >> 8]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::mixed::points::{ALL_WORDS, PointSet};
    use crate::backend::cpu::mixed::triangle::PointTriangle;
    use crate::backend::cpu::{Isa, geometry::visibility::area};

    /// Triangles of all sizes, in a picture that most of them leave.
    #[test]
    fn columns_have_all_points_and_few_others() {
        let mut state = 9_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as i32 - (1 << 23)
        };
        let size = [60_u32, 40];
        let (mut touched, mut listed, mut boxed) = (0, 0, 0);
        for round in 0..3_000 {
            let shift = 2 + round % 14;
            let center = [next() >> 11, next() >> 11];
            let corners = [0; 3].map(|_| ScreenVertex {
                x: center[0] + (next() >> shift),
                y: if round % 5 == 0 { center[1] & !255 } else { center[1] + (next() >> shift) },
                z: 0.5,
                ..ScreenVertex::default()
            });
            let mut corners = corners;
            corners[2].y += 300;
            let Some(triangle) = PointTriangle::new(0, &corners).filter(|_| area(&corners) != 0) else { continue };
            let spans = Spans::new(&corners, size);
            let of_x = corners.map(|v| v.x + 128 * size[0] as i32);
            let box_of_x = [of_x.into_iter().min().unwrap() >> 8, of_x.into_iter().max().unwrap() >> 8];
            for y in 0..size[1] as i32 {
                let [left, right] = spans.columns(y);
                for x in 0..size[0] as i32 {
                    let corner = [256 * x - 128 * size[0] as i32, 256 * y - 128 * size[1] as i32];
                    let points: PointSet<ALL_WORDS> =
                        triangle.at(corner).map_or(PointSet::NONE, |outline| outline.inside(Isa::detect()));
                    let is_listed = (left..=right).contains(&x);
                    assert!(is_listed || points.is_empty(), "{corners:?} {x} {y} {left} {right}");
                    touched += usize::from(!points.is_empty());
                    listed += usize::from(is_listed);
                    boxed += usize::from(is_listed || left <= right && (box_of_x[0]..=box_of_x[1]).contains(&x));
                }
            }
        }
        assert!(touched > 20_000 && listed < touched * 5 / 4 && boxed > listed * 5 / 4, "{touched} {listed} {boxed}");
    }
}
