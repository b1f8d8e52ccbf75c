//! Stage 2, a triangle: which samples it owns, and how near it is there. Twin of `shaders/visibility.wgsl`.
//!
//! Coverage is exact integer arithmetic on snapped vertices with the top-left rule: of two triangles that share an edge,
//! every sample belongs to exactly one. Depth is evaluated from integer offsets, never incrementally, so it does not
//! depend on where a traversal began.

use super::isa::LANES;
use super::transform::{ScreenVertex, recip};
use crate::plan::{Faces, sample_offsets};

/// No triangle.
pub const NOTHING: u32 = u32::MAX;

/// Rows of samples of one horizontal band of the picture.
pub struct SampleBand {
    /// Picture size, pixels.
    pub size_px: [u32; 2],
    /// First row of the band.
    pub first_row: u32,
    /// Rows in the band.
    pub rows: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Distance between rows of samples, which are padded so that a vector may hang over the right edge.
    pub stride: usize,
    /// Reversed depth at `(row * samples + s) * stride + x`; 0 where there is nothing.
    pub depth: Vec<f32>,
    /// Triangle id, laid out likewise.
    pub ids: Vec<u32>,
}

impl SampleBand {
    /// An empty band.
    pub fn new(size_px: [u32; 2], first_row: u32, rows: u32, samples: u32) -> Self {
        let stride = (size_px[0] as usize + LANES).next_multiple_of(LANES);
        let len = stride * rows as usize * samples as usize;
        Self { size_px, first_row, rows, samples, stride, depth: vec![0.0; len], ids: vec![NOTHING; len] }
    }

    /// Empties the band.
    pub fn clear(&mut self) {
        self.depth.fill(0.0);
        self.ids.fill(NOTHING);
    }

    /// Index of sample `s` of the pixel at column `x`, row `y` of the picture.
    #[inline(always)]
    pub fn index(&self, x: u32, y: u32, s: u32) -> usize {
        ((y - self.first_row) * self.samples + s) as usize * self.stride + x as usize
    }
}

/// A triangle, ready to be drawn and to have its depth evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// Snapped corners, in an order that makes the area positive.
    pub x: [i32; 3],
    /// As `x`.
    pub y: [i32; 3],
    /// Depth at corner 0, and its change per 1/256 px.
    pub depth: [f32; 3],
    /// Smallest and largest depth of the corners.
    pub depth_range: [f32; 2],
}

/// Twice the signed area in 1/65536 px; negative is counter-clockwise on screen, the front.
#[inline(always)]
pub fn area(v: &[ScreenVertex; 3]) -> i64 {
    let d = |a: i32, b: i32| i64::from(a) - i64::from(b);
    d(v[1].x, v[0].x) * d(v[2].y, v[0].y) - d(v[2].x, v[0].x) * d(v[1].y, v[0].y)
}

/// Whether `faces` wants a triangle of this area.
#[inline(always)]
pub fn is_wanted(faces: Faces, area: i64) -> bool {
    match faces {
        Faces::Both => area != 0,
        Faces::Front => area < 0,
        Faces::Back => area > 0,
    }
}

impl Setup {
    /// None where the triangle has no area.
    #[inline(always)]
    pub fn new(corners: &[ScreenVertex; 3]) -> Option<Self> {
        let area = area(corners);
        if area == 0 {
            return None;
        }
        let [a, b, c] = if area > 0 { *corners } else { [corners[0], corners[2], corners[1]] };
        let (dx1, dy1) = ((b.x - a.x) as f32, (b.y - a.y) as f32);
        let (dx2, dy2) = ((c.x - a.x) as f32, (c.y - a.y) as f32);
        let (dz1, dz2) = (b.z - a.z, c.z - a.z);
        let inverse = recip(wide_to_f32(area.unsigned_abs()));
        Some(Self {
            x: [a.x, b.x, c.x],
            y: [a.y, b.y, c.y],
            depth: [a.z, (dz1 * dy2 - dz2 * dy1) * inverse, (dz2 * dx1 - dz1 * dx2) * inverse],
            depth_range: [a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z)],
        })
    }

    /// Depth at a point, clamped to what the corners span: beyond that a sliver's gradient is noise.
    #[inline(always)]
    pub fn depth_at(&self, x: i32, y: i32) -> f32 {
        let z = (self.depth[0] + self.depth[1] * (x - self.x[0]) as f32) + self.depth[2] * (y - self.y[0]) as f32;
        clamp(z, self.depth_range)
    }

    /// First and last pixel column and row that the triangle may touch, inside the band; None if none.
    #[inline(always)]
    fn bounds(&self, band: &SampleBand) -> Option<[[i32; 2]; 2]> {
        let columns = axis_bounds(&self.x, band.size_px[0], 0, band.size_px[0])?;
        let rows = axis_bounds(&self.y, band.size_px[1], band.first_row, band.first_row + band.rows)?;
        Some([columns, rows])
    }
}

/// First and last pixel along an axis of `size_px` pixels that the three coordinates span, within `from..to`.
#[inline(always)]
pub fn axis_bounds(v: &[i32; 3], size_px: u32, from: u32, to: u32) -> Option<[i32; 2]> {
    let half = size_px as i32 * 128;
    let first = ((v[0].min(v[1]).min(v[2]) + half) >> 8).max(from as i32);
    let last = ((v[0].max(v[1]).max(v[2]) + half) >> 8).min(to as i32 - 1);
    (first <= last).then_some([first, last])
}

/// The f32 of a wide integer, by the same two roundings as a GPU that has no 64-bit numbers.
#[inline(always)]
pub fn wide_to_f32(v: u64) -> f32 {
    ((v >> 32) as u32 as f32) * 4_294_967_296.0 + (v as u32 as f32)
}

/// Draws a triangle into the band. With `TIES`, of equal depths the lowest id wins whatever the order of drawing; without,
/// the caller promises ascending ids.
#[inline(always)]
pub fn draw<const TIES: bool>(setup: &Setup, id: u32, band: &mut SampleBand) {
    let Some([columns, rows]) = setup.bounds(band) else { return };
    let edges = Edges::new(setup);
    let origin = [band.size_px[0] as i32 * 128, band.size_px[1] as i32 * 128];
    let mut row = rows[0];
    while row <= rows[1] {
        let height = (rows[1] - row + 1).min(LANES as i32);
        let mut column = columns[0];
        while column <= columns[1] {
            let corner = [column * 256 - origin[0], row * 256 - origin[1]];
            if let Some(values) = edges.at(corner) {
                let block = Block { column, row, height, corner, values };
                block.draw::<TIES>(setup, &edges, id, band);
            }
            column += LANES as i32;
        }
        row += LANES as i32;
    }
}

/// Edge functions of a triangle: `dx`, `dy` and the top-left bias of each edge.
struct Edges {
    dx: [i32; 3],
    dy: [i32; 3],
    start: [[i32; 2]; 3],
    bias: [i64; 3],
}

impl Edges {
    #[inline(always)]
    fn new(s: &Setup) -> Self {
        let dx = std::array::from_fn(|k| s.x[(k + 1) % 3] - s.x[k]);
        let dy: [i32; 3] = std::array::from_fn(|k| s.y[(k + 1) % 3] - s.y[k]);
        let bias = std::array::from_fn(|k| if dy[k] < 0 || (dy[k] == 0 && dx[k] > 0) { 0 } else { -1 });
        Self { dx, dy, start: std::array::from_fn(|k| [s.x[k], s.y[k]]), bias }
    }

    /// Edge values in sixteenths at a pixel corner, for the 8 x 8 pixels from there; None where they lie outside an edge.
    #[inline(always)]
    fn at(&self, corner: [i32; 2]) -> Option<[i32; 3]> {
        const SPAN: i64 = 127; // (8 pixels) * 16 - 1
        let mut values = [0; 3];
        for k in 0..3 {
            let (dx, dy) = (i64::from(self.dx[k]), i64::from(self.dy[k]));
            let (px, py) = (i64::from(corner[0] - self.start[k][0]), i64::from(corner[1] - self.start[k][1]));
            let c = (dx * py - dy * px + self.bias[k]) >> 4;
            if c + (dx * SPAN).max(0) + (-dy * SPAN).max(0) < 0 {
                return None;
            }
            values[k] = c.clamp(-(1 << 30), 1 << 30) as i32;
        }
        Some(values)
    }
}

/// Eight columns and up to eight rows of pixels.
struct Block {
    column: i32,
    row: i32,
    height: i32,
    corner: [i32; 2],
    values: [i32; 3],
}

impl Block {
    #[inline(always)]
    fn draw<const TIES: bool>(&self, setup: &Setup, edges: &Edges, id: u32, band: &mut SampleBand) {
        // How much each edge function changes from lane to lane: 16 sixteenths of a pixel to the right.
        let steps: [[i32; LANES]; 3] = std::array::from_fn(|k| std::array::from_fn(|l| -edges.dy[k] * 16 * l as i32));
        let offsets = sample_offsets(band.samples);
        for y in 0..self.height {
            for (s, &[sx, sy]) in offsets.iter().enumerate() {
                let j = 16 * y + sy;
                let base: [i32; 3] = std::array::from_fn(|k| self.values[k] + edges.dx[k] * j - edges.dy[k] * sx);
                let mut inside = [0_i32; LANES];
                for l in 0..LANES {
                    inside[l] = (base[0] + steps[0][l]) | (base[1] + steps[1][l]) | (base[2] + steps[2][l]);
                }
                let x0 = self.corner[0] + 16 * sx - setup.x[0];
                let row_depth = setup.depth[2] * (self.corner[1] + 16 * j - setup.y[0]) as f32;
                let at = band.index(self.column as u32, (self.row + y) as u32, s as u32);
                let depths: &mut [f32] = &mut band.depth[at..at + LANES];
                let ids: &mut [u32] = &mut band.ids[at..at + LANES];
                for l in 0..LANES {
                    let z = (setup.depth[0] + setup.depth[1] * (x0 + 256 * l as i32) as f32) + row_depth;
                    let z = clamp(z, setup.depth_range);
                    let nearer = if TIES {
                        (z > depths[l]) | ((z == depths[l]) & (z > 0.0) & (id < ids[l]))
                    } else {
                        z > depths[l]
                    };
                    let take = (inside[l] >= 0) & nearer;
                    depths[l] = if take { z } else { depths[l] };
                    ids[l] = if take { id } else { ids[l] };
                }
            }
        }
    }
}

/// `min` and `max` in the order that maps to two machine instructions; no input is NaN.
#[inline(always)]
fn clamp(v: f32, range: [f32; 2]) -> f32 {
    let v = if v > range[0] { v } else { range[0] };
    if v < range[1] { v } else { range[1] }
}
