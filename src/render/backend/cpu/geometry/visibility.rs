//! The samples that a triangle covers, and its depth at each (stage visibility). Twin of
//! `shaders/geometry/visibility.wgsl`.
//!
//! Coverage is exact integer arithmetic on vertices that are rounded to 1/256 px, with the top-left rule: a sample on
//! the edge between two triangles belongs to exactly one of them. Depth is evaluated from integer offsets, never
//! incrementally, so it does not depend on where a traversal began.

use super::samples::SampleBand;
use super::transform::{ScreenVertex, recip};
use crate::backend::cpu::isa::LANES;
use crate::plan::{Faces, sample_offsets};

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

/// True if face culling keeps a triangle of this area.
#[inline(always)]
pub fn passes_culling(faces: Faces, area: i64) -> bool {
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

    /// First and last pixel column and row that the triangle may touch, inside the band; None if
    /// none.
    #[inline(always)]
    fn bounds(&self, size_px: [u32; 2], [columns, rows]: [[i32; 2]; 2]) -> Option<[[i32; 2]; 2]> {
        Some([axis_bounds(&self.x, size_px[0], columns)?, axis_bounds(&self.y, size_px[1], rows)?])
    }
}

/// First and last pixel along an axis of `size_px` pixels that the three coordinates span, from
/// `from` to before `to`.
#[inline(always)]
pub fn axis_bounds(v: &[i32; 3], size_px: u32, [from, to]: [i32; 2]) -> Option<[i32; 2]> {
    let half = size_px as i32 * 128;
    let first = ((v[0].min(v[1]).min(v[2]) + half) >> 8).max(from);
    let last = ((v[0].max(v[1]).max(v[2]) + half) >> 8).min(to - 1);
    (first <= last).then_some([first, last])
}

/// The f32 of a wide integer, by the same two roundings as a GPU that has no 64-bit numbers.
#[inline(always)]
pub fn wide_to_f32(v: u64) -> f32 {
    ((v >> 32) as u32 as f32) * 4_294_967_296.0 + (v as u32 as f32)
}

/// Receives the samples of a triangle.
pub trait Target {
    /// Its rows of samples.
    fn band(&self) -> &SampleBand;

    /// Offers triangle `id` to the samples from index `at` on: its depth at each, and which lie
    /// outside it (negative).
    fn offer(&mut self, at: usize, outside: &[i32; LANES], z: &[f32; LANES], id: u32);
}

/// Draws a triangle into a target of `S` samples per pixel. Returns the number of samples tested.
#[inline(always)]
pub fn draw<const S: usize>(setup: &Setup, id: u32, target: &mut impl Target) -> u64 {
    let edges = Edges::new(setup);
    let lanes = [Lanes::new::<S>(&edges, 0), Lanes::new::<S>(&edges, LANES)];
    let size_px = target.band().size_px;
    let Some(bounds) = setup.bounds(size_px, target.band().range()) else { return 0 };
    let mut blocks = Blocks::new::<S>(&edges, bounds, size_px);
    while let Some(block) = blocks.next() {
        block.draw::<S>(setup, &edges, &lanes, id, target);
    }
    let [columns, rows] = bounds;
    (columns[1] - columns[0] + 1) as u64 * (rows[1] - rows[0] + 1) as u64 * S as u64
}

/// Calls `each` with the parts of a triangle in blocks of 8 x 8 pixels that may hold some of it.
#[inline(always)]
pub fn for_each_part<const S: usize>(
    setup: &Setup,
    size_px: [u32; 2],
    range: [[i32; 2]; 2],
    mut each: impl FnMut(&Parts<1>),
) {
    let edges = Edges::new(setup);
    let Some(bounds) = setup.bounds(size_px, range) else { return };
    let mut blocks = Blocks::new::<S>(&edges, bounds, size_px);
    while let Some(block) = blocks.next() {
        let [last_column, last_row] = [block.column + block.size[0] - 1, block.row + block.size[1] - 1];
        each(&Parts {
            bounds: [[[block.column], [last_column]], [[block.row], [last_row]]],
            dx: edges.dx.map(|v| [v]),
            dy: edges.dy.map(|v| [v]),
            edges: block.values.map(|v| [v]),
            from: [[block.corner[0] - setup.x[0]], [block.corner[1] - setup.y[0]]],
            depth: setup.depth.map(|v| [v]),
            depth_range: setup.depth_range.map(|v| [v]),
        });
    }
}

/// `N` rectangles of pixels, and what a triangle is in each.
pub struct Parts<const N: usize> {
    /// First and last column, and row.
    pub bounds: [[[i32; N]; 2]; 2],
    /// Change of the edge functions.
    pub dx: [[i32; N]; 3],
    /// As `dx`.
    pub dy: [[i32; N]; 3],
    /// Edge functions in sixteenths at the first pixel's corner (moved by what the samples leave
    /// modulo 16).
    pub edges: [[i32; N]; 3],
    /// That corner from the triangle's first, 1/256 px.
    pub from: [[i32; N]; 2],
    /// As [`Setup::depth`].
    pub depth: [[f32; N]; 3],
    /// As [`Setup::depth_range`].
    pub depth_range: [[f32; N]; 2],
}

impl<const N: usize> Parts<N> {
    /// Nothing yet.
    pub const EMPTY: Self = Self {
        bounds: [[[0; N]; 2]; 2],
        dx: [[0; N]; 3],
        dy: [[0; N]; 3],
        edges: [[0; N]; 3],
        from: [[0; N]; 2],
        depth: [[0.0; N]; 3],
        depth_range: [[0.0; N]; 2],
    };

    /// First and last column, and row, of rectangle `i`.
    #[inline(always)]
    pub fn bounds_of(&self, i: usize) -> [[i32; 2]; 2] {
        let [[left, right], [top, bottom]] = &self.bounds;
        [[left[i], right[i]], [top[i], bottom[i]]]
    }
}

/// The blocks of 8 x 8 pixels of a rectangle that may hold some of a triangle. A loop over them is no closure, which would
/// be compiled for the baseline.
struct Blocks<'a> {
    edges: &'a Edges,
    columns: [i32; 2],
    last_row: i32,
    /// The next block.
    column: i32,
    row: i32,
    /// The picture's corner from its centre, 1/256 px.
    origin: [i32; 2],
}

impl<'a> Blocks<'a> {
    #[inline(always)]
    fn new<const S: usize>(edges: &'a Edges, [columns, rows]: [[i32; 2]; 2], size_px: [u32; 2]) -> Self {
        // All samples lie multiples of 1/16 px from here.
        let shift = sample_offsets(S as u32)[0][0] & 15;
        let origin = [size_px[0] as i32 * 128 - shift, size_px[1] as i32 * 128 - shift];
        Self { edges, columns, last_row: rows[1], column: columns[0], row: rows[0], origin }
    }

    #[inline(always)]
    fn next(&mut self) -> Option<Block> {
        while self.row <= self.last_row {
            while self.column <= self.columns[1] {
                let (column, row) = (self.column, self.row);
                self.column += BLOCK;
                let corner = [column * 256 - self.origin[0], row * 256 - self.origin[1]];
                if let Some(values) = self.edges.at(corner) {
                    let size = [(self.columns[1] - column + 1).min(BLOCK), (self.last_row - row + 1).min(BLOCK)];
                    return Some(Block { column, row, size, corner, values });
                }
            }
            self.column = self.columns[0];
            self.row += BLOCK;
        }
        None
    }
}

/// Pixels along a side of a block, in which edge functions fit 32 bits.
const BLOCK: i32 = 8;

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

    /// Edge values in sixteenths at a pixel corner, for the 8 x 8 pixels from there; None where
    /// they lie outside an edge.
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

/// Offsets per lane: a vector covers all samples of `LANES / S` neighbouring pixels, or `LANES` of
/// the samples of one.
struct Lanes {
    /// To each edge function.
    edges: [[i32; LANES]; 3],
    /// To the position, in 1/256 px.
    x: [i32; LANES],
    y: [i32; LANES],
}

impl Lanes {
    #[inline(always)]
    fn new<const S: usize>(edges: &Edges, first: usize) -> Self {
        let offsets = sample_offsets(S as u32);
        let (mut x, mut y) = ([0; LANES], [0; LANES]);
        for l in 0..LANES {
            x[l] = 16 * (l / S) as i32 + (offsets[(first + l) % S][0] >> 4);
            y[l] = offsets[(first + l) % S][1] >> 4;
        }
        let mut steps = [[0; LANES]; 3];
        for k in 0..3 {
            for l in 0..LANES {
                steps[k][l] = edges.dx[k] * y[l] - edges.dy[k] * x[l];
            }
        }
        Self { edges: steps, x: x.map(|v| 16 * v), y: y.map(|v| 16 * v) }
    }
}

/// Up to 8 x 8 pixels.
struct Block {
    column: i32,
    row: i32,
    size: [i32; 2],
    corner: [i32; 2],
    values: [i32; 3],
}

impl Block {
    #[inline(always)]
    fn draw<const S: usize>(
        &self,
        setup: &Setup,
        edges: &Edges,
        lanes: &[Lanes; 2],
        id: u32,
        target: &mut impl Target,
    ) {
        let pixels = (LANES / S).max(1) as i32;
        for y in 0..self.size[1] {
            let mut x = 0;
            while x < self.size[0] {
                let at = target.band().index(self.column + x, self.row + y, 0);
                let from = [self.corner[0] + 256 * x - setup.x[0], self.corner[1] + 256 * y - setup.y[0]];
                for part in 0..S.div_ceil(LANES) {
                    let outside = self.outside(edges, &lanes[part], x, y);
                    target.offer(at + LANES * part, &outside, &setup.depth_lanes(&lanes[part], from), id);
                }
                x += pixels;
            }
        }
    }

    /// Negative where a lane's sample lies outside an edge.
    #[inline(always)]
    fn outside(&self, edges: &Edges, lanes: &Lanes, x: i32, y: i32) -> [i32; LANES] {
        let mut outside = [0_i32; LANES];
        for k in 0..3 {
            let base = self.values[k] + 16 * (edges.dx[k] * y - edges.dy[k] * x);
            let steps = &lanes.edges[k];
            for l in 0..LANES {
                outside[l] |= base.wrapping_add(steps[l]);
            }
        }
        outside
    }
}

impl Setup {
    /// Depth at each lane's sample; `from` is the vector's pixel corner relative to corner 0.
    #[inline(always)]
    fn depth_lanes(&self, lanes: &Lanes, from: [i32; 2]) -> [f32; LANES] {
        let mut z = [0.0; LANES];
        for l in 0..LANES {
            let (x, y) = ((from[0] + lanes.x[l]) as f32, (from[1] + lanes.y[l]) as f32);
            z[l] = clamp((self.depth[0] + self.depth[1] * x) + self.depth[2] * y, self.depth_range);
        }
        z
    }
}

/// `min` and `max` in the order that maps to two machine instructions; no input is NaN.
#[inline(always)]
pub fn clamp(v: f32, range: [f32; 2]) -> f32 {
    let v = if v > range[0] { v } else { range[0] };
    if v < range[1] { v } else { range[1] }
}
