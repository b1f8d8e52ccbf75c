//! The set-up of eight triangles at a time, in vector instructions (stage visibility): from their
//! corners it computes the pixels whose samples each may cover, its edge functions and its depth
//! plane.
//!
//! Edge functions of triangles up to [`EXTENT_MAX`] wide and high fit 32 bits. Of these triangles,
//! those with all depths above 0 that touch at most [`SHORT_MAX`] columns and rows of pixels are
//! drawn as a whole. Their values are those of [`visibility`](super::visibility), which sets up one
//! triangle at a time. Others are drawn block by block.

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, i32x4, i32x8, mask32x8};

use super::samples::{SampleBand, SampleGrid};
use super::transform::ScreenVertex;
use super::visibility::Parts;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::isa::LANES;
use crate::plan::sample_offsets;

/// Largest width and height of a triangle that is set up in lanes, 1/256 px. Twice its square, and
/// some, is below 2^31.
pub const EXTENT_MAX: i32 = 64 * 256;

/// Largest width and height of what is drawn without looking which blocks are empty, pixels.
pub const SHORT_MAX: i32 = 16;

/// Rows, and vectors in a row, up to which triangles are drawn together with others of the same size.
pub const SIZES: i32 = 4;

/// Classes of triangles by the way they are drawn: a number below `SIZES * SIZES` for each small
/// size, or one of these.
pub mod class {
    /// Other triangles drawn by lanes.
    pub const SHORT: i32 = super::SIZES * super::SIZES;
    /// Triangles drawn in blocks.
    pub const LONG: i32 = SHORT + 1;
    /// Triangles without samples.
    pub const EMPTY: i32 = LONG + 1;
    /// Number of classes.
    pub const COUNT: usize = EMPTY as usize + 1;
}

/// Corners of eight triangles.
pub struct Corners {
    pub x: [[i32; LANES]; 3],
    pub y: [[i32; LANES]; 3],
}

/// Eight triangles, ready to be drawn. Long ones have their bounds and their depth range alone.
pub struct Setups {
    pub parts: Parts<LANES>,
    /// The class of each triangle, see [`class`].
    pub classes: [i32; LANES],
}

impl Corners {
    /// The corners of triangles by id.
    #[inline(always)]
    pub fn load(context: &RasterContext<'_>, ids: &[u32; LANES]) -> Self {
        let (mut x, mut y) = ([[0; LANES]; 3], [[0; LANES]; 3]);
        for l in 0..LANES {
            let corners = context.screen_triangle(ids[l]);
            for k in 0..3 {
                (x[k][l], y[k][l]) = (corners[k].x, corners[k].y);
            }
        }
        Self { x, y }
    }
}

/// Corners of eight triangles, in vectors.
pub struct CornerLanes<V: Simd> {
    pub x: [i32x8<V>; 3],
    pub y: [i32x8<V>; 3],
    pub z: [f32x8<V>; 3],
}

impl<V: Simd> CornerLanes<V> {
    /// The corners of triangles by the indices of their vertices.
    #[inline(always)]
    pub fn load(simd: V, vertices: &[ScreenVertex], triangles: &[[u32; 3]; LANES]) -> Self {
        let ints = [i32x8::splat(simd, 0); 3];
        let mut corners = Self { x: ints, y: ints, z: [f32x8::splat(simd, 0.0); 3] };
        for k in 0..3 {
            let mut rows = [[i32x4::splat(simd, 0); 4]; 2];
            for l in 0..LANES {
                let vertex = &vertices[triangles[l][k] as usize];
                rows[l / 4][l % 4] = i32x4::simd_from(simd, *bytemuck::must_cast_ref::<_, [i32; 4]>(vertex));
            }
            let z;
            [corners.x[k], corners.y[k], z, _] = transposed(rows);
            corners.z[k] = z.bitcast();
        }
        corners
    }

    /// The nearest depths.
    #[inline(always)]
    pub fn depth_max(&self) -> f32x8<V> {
        self.z[0].max(self.z[1]).max(self.z[2])
    }
}

/// The columns of eight rows of four.
#[inline(always)]
pub fn transposed<V: Simd>([lower, upper]: [[i32x4<V>; 4]; 2]) -> [i32x8<V>; 4] {
    let (lower, upper) = (transposed_half(lower), transposed_half(upper));
    let mut columns = [lower[0].combine(upper[0]); 4];
    for k in 1..4 {
        columns[k] = lower[k].combine(upper[k]);
    }
    columns
}

/// The columns of four rows.
#[inline(always)]
pub fn transposed_half<V: Simd>([a, b, c, d]: [i32x4<V>; 4]) -> [i32x4<V>; 4] {
    let ((ac_low, ac_high), (bd_low, bd_high)) = (a.interleave(c), b.interleave(d));
    let ((x, y), (z, w)) = (ac_low.interleave(bd_low), ac_high.interleave(bd_high));
    [x, y, z, w]
}

/// First and last pixel along an axis of triangles' coordinates from the picture's centre, which is `half` from its corner.
pub struct Extents<V: Simd> {
    pub first: i32x8<V>,
    pub last: i32x8<V>,
    /// True up to [`EXTENT_MAX`].
    pub is_small: mask32x8<V>,
}

impl<V: Simd> Extents<V> {
    /// As `pixels` of the grid.
    #[inline(always)]
    pub fn new(simd: V, grid: SampleGrid, v: &[i32x8<V>; 3], half: i32, [from, to]: [i32; 2]) -> Self {
        let (low, high) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
        let (cells, pixels) = ((8 - grid.shift) as u32, grid.shift as u32);
        let first = (low + (half + grid.border - 1)) >> cells;
        let last = (high + (half - grid.border)) >> cells;
        let is_empty = first.simd_gt(last);
        let last = is_empty.select(i32x8::splat(simd, i32::MIN), last >> pixels);
        Self { first: (first >> pixels).max(from), last: last.min(to - 1), is_small: (high - low).simd_le(EXTENT_MAX) }
    }
}

/// Pixels and nearest depth of eight triangles.
pub struct Boxes {
    /// First and last column, and row; the first beyond the last where there are no samples.
    pub bounds: [[[i32; LANES]; 2]; 2],
    pub depth_max: [f32; LANES],
}

impl Boxes {
    #[inline(always)]
    pub fn new<V: Simd, const S: usize>(
        simd: V,
        context: &RasterContext<'_>,
        ids: &[u32; LANES],
        band: &SampleBand,
    ) -> Self {
        let corners = CornerLanes::load(simd, context.vertices, &context.indices_of(ids));
        let [columns, rows] = extents::<V, S>(simd, &corners, band);
        Self { bounds: bounds(&columns, &rows), depth_max: corners.depth_max().into() }
    }
}

/// Of columns, and of rows.
#[inline(always)]
fn extents<V: Simd, const S: usize>(simd: V, corners: &CornerLanes<V>, band: &SampleBand) -> [Extents<V>; 2] {
    let (grid, [columns, rows]) = (SampleGrid::new(S as u32), band.range());
    let [half_x, half_y] = half(band);
    [Extents::new(simd, grid, &corners.x, half_x, columns), Extents::new(simd, grid, &corners.y, half_y, rows)]
}

#[inline(always)]
fn half(band: &SampleBand) -> [i32; 2] {
    [band.size_px[0] as i32 * 128, band.size_px[1] as i32 * 128]
}

#[inline(always)]
fn bounds<V: Simd>(columns: &Extents<V>, rows: &Extents<V>) -> [[[i32; LANES]; 2]; 2] {
    [[columns.first.into(), columns.last.into()], [rows.first.into(), rows.last.into()]]
}

impl Setups {
    /// Eight triangles without samples.
    pub const EMPTY: Self = Self { parts: Parts::EMPTY, classes: [class::EMPTY; LANES] };

    #[inline(always)]
    pub fn set<V: Simd, const S: usize>(
        &mut self,
        simd: V,
        context: &RasterContext<'_>,
        ids: &[u32; LANES],
        band: &SampleBand,
    ) {
        let corners = CornerLanes::load(simd, context.vertices, &context.indices_of(ids));
        let [columns, rows] = extents::<V, S>(simd, &corners, band);
        let depth_min = corners.z[0].min(corners.z[1]).min(corners.z[2]);
        self.classes = classes::<V, S>(simd, &columns, &rows, depth_min.simd_gt(0.0)).into();
        self.parts.bounds = bounds(&columns, &rows);
        self.parts.depth_range = [depth_min.into(), corners.depth_max().into()];
        let (shift, half) = (sample_offsets(S as u32)[0][0] & 15, half(band));
        // These values may wrap around in lanes that are not short, where nothing reads them.
        self.parts.set(corners, [(columns.first << 8) + (shift - half[0]), (rows.first << 8) + (shift - half[1])]);
    }
}

#[inline(always)]
fn classes<V: Simd, const S: usize>(
    simd: V,
    columns: &Extents<V>,
    rows: &Extents<V>,
    is_deep: mask32x8<V>,
) -> i32x8<V> {
    let is_empty = columns.first.simd_gt(columns.last) | rows.first.simd_gt(rows.last);
    let (width, height) = (columns.last - columns.first, rows.last - rows.first);
    let is_short =
        (columns.is_small & rows.is_small & is_deep) & (width.simd_lt(SHORT_MAX) & height.simd_lt(SHORT_MAX));
    let vectors = width >> (LANES / S).max(1).trailing_zeros();
    let is_small = height.simd_lt(SIZES) & vectors.simd_lt(SIZES);
    let short = is_small.select(height * SIZES + vectors, i32x8::splat(simd, class::SHORT));
    let any = is_short.select(short, i32x8::splat(simd, class::LONG));
    is_empty.select(i32x8::splat(simd, class::EMPTY), any)
}

impl Parts<LANES> {
    /// Edges and depth, as `Setup`, `Edges::new` and `Edges::at` of `visibility` have them.
    #[inline(always)]
    fn set<V: Simd>(&mut self, CornerLanes { x, y, z }: CornerLanes<V>, corner: [i32x8<V>; 2]) {
        let area = cross([x[1] - x[0], y[1] - y[0]], [x[2] - x[0], y[2] - y[0]]);
        let flip = area.simd_lt(0);
        let x = [x[0], flip.select(x[2], x[1]), flip.select(x[1], x[2])];
        let y = [y[0], flip.select(y[2], y[1]), flip.select(y[1], y[2])];
        let z = [z[0], flip.select(z[2], z[1]), flip.select(z[1], z[2])];
        let (dx1, dx2) = (f32x8::float_from(x[1] - x[0]), f32x8::float_from(x[2] - x[0]));
        let (dy1, dy2) = (f32x8::float_from(y[1] - y[0]), f32x8::float_from(y[2] - y[0]));
        let (dz1, dz2) = (z[1] - z[0], z[2] - z[0]);
        let inverse = recip(f32x8::float_from(area.abs()));
        self.depth[0] = z[0].into();
        self.depth[1] = ((dz1 * dy2 - dz2 * dy1) * inverse).into();
        self.depth[2] = ((dz2 * dx1 - dz1 * dx2) * inverse).into();
        for k in 0..3 {
            let (dx, dy) = (x[(k + 1) % 3] - x[k], y[(k + 1) % 3] - y[k]);
            let is_owner = dy.simd_lt(0) | (dy.simd_eq(0) & dx.simd_gt(0));
            let at = cross([dx, dy], [corner[0] - x[k], corner[1] - y[k]]);
            self.edges[k] = (is_owner.select(at, at - 1) >> 4).into();
            self.dx[k] = dx.into();
            self.dy[k] = dy.into();
        }
        self.from = [(corner[0] - x[0]).into(), (corner[1] - y[0]).into()];
    }
}

#[inline(always)]
fn cross<V: Simd>(a: [i32x8<V>; 2], b: [i32x8<V>; 2]) -> i32x8<V> {
    a[0] * b[1] - b[0] * a[1]
}

/// As [`recip`](super::transform::recip).
#[inline(always)]
fn recip<V: Simd>(w: f32x8<V>) -> f32x8<V> {
    let mut r: f32x8<V> = (0x7EF3_11C7 - w.bitcast::<i32x8<V>>()).bitcast();
    for _ in 0..4 {
        r += r * (1.0 - w * r);
    }
    r
}
