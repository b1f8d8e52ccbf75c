//! Culling of eight triangles at a time, in vector instructions: it finds those that can show in the picture, and the
//! bands (ranges of pixel rows) that they touch. The parent module says which triangles are left out.

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, i32x4, i32x8, mask32x8};

use super::{Bounds, Kept, Sides, TrianglePass, area_of};
use crate::backend::cpu::bands::lists::{BoxedFace, KeptFaces};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::setups::{CornerLanes, Extents, transposed_half};
use crate::backend::cpu::geometry::transform::OUTSIDE;
use crate::backend::cpu::isa::LANES;
use crate::backend::cpu::lines::fringes::FRINGED_MAX;
use crate::backend::cpu::mixed::thinness::is_thin;

/// As `keep` of the parent, given the pass's triangles.
#[inline(always)]
pub fn keep<V: Simd>(
    simd: V,
    context: &RasterContext<'_>,
    bounds: &Bounds,
    pass: &TrianglePass,
    triangles: &[[u32; 3]],
) -> Kept {
    let mut kept = Kept::with_room_for(triangles.len(), bounds);
    for (first, group) in pass.ids.clone().step_by(LANES).zip(triangles.chunks(LANES)) {
        let mut padded = [group[0]; LANES];
        let triangles = match group.first_chunk() {
            Some(triangles) => triangles,
            None => {
                padded[..group.len()].copy_from_slice(group);
                &padded
            }
        };
        let corners = CornerLanes::load(simd, context.vertices, triangles);
        let lanes = Lanes::new(simd, &corners, bounds);
        let drawn = pass.drawn(context.plan, first, group.len());
        let whole = !lanes.outside & ((1 << group.len()) - 1);
        kept.sides.push(Sides {
            front: (lanes.front & whole) as u8,
            back: (lanes.back & whole) as u8,
            unfringed: (lanes.wide | !(lanes.front | lanes.back)) as u8,
        });
        let (front, back) = (lanes.front & lanes.seen & drawn[0], lanes.back & lanes.seen & drawn[1]);
        if front != 0 {
            if bounds.has_mixed {
                lanes.put_boxed(simd, first, front, &mut kept.fronts);
            }
            lanes.put(simd, first, front, &mut kept.fronts);
        }
        if back != 0 {
            lanes.put_boxed(simd, first, back, &mut kept.backs);
            lanes.put(simd, first, back, &mut kept.backs);
        }
        if bounds.has_mixed && front | back != 0 {
            let thin = thin(&corners, front | back);
            if thin != 0 {
                lanes.put_boxed(simd, first, thin, &mut kept.thin);
                lanes.put(simd, first, thin, &mut kept.thin);
            }
        }
        let mut outside = lanes.outside & (drawn[0] | drawn[1]);
        while outside != 0 {
            kept.outside.push(first as u32 + outside.trailing_zeros());
            outside &= outside - 1;
        }
    }
    kept
}

/// Bits of the lanes, of some, whose triangles are thin.
#[inline(always)]
fn thin<V: Simd>(corners: &CornerLanes<V>, lanes: u32) -> u32 {
    let mut thin = 0;
    for l in 0..LANES {
        let [x, y] = corner_of(corners, l);
        thin |= u32::from(is_thin(x, y, area_of(x, y))) << l;
    }
    thin & lanes
}

/// The corners' columns, and rows, of a lane.
#[inline(always)]
fn corner_of<V: Simd>(CornerLanes { x, y, .. }: &CornerLanes<V>, l: usize) -> [[i32; 3]; 2] {
    [[x[0][l], x[1][l], x[2][l]], [y[0][l], y[1][l], y[2][l]]]
}

/// Eight triangles on screen.
struct Lanes<V: Simd> {
    /// Bits of the lanes that face the viewer, face away, may have samples, lie outside, are wide or lie outside.
    front: u32,
    back: u32,
    seen: u32,
    outside: u32,
    wide: u32,
    span: i32x8<V>,
    columns: i32x8<V>,
    rows: i32x8<V>,
    depth_max: f32x8<V>,
}

impl<V: Simd> Lanes<V> {
    #[inline(always)]
    fn new(simd: V, corners: &CornerLanes<V>, bounds: &Bounds) -> Self {
        let CornerLanes { x, y, .. } = corners;
        let columns = Extents::new(simd, bounds.grid, x, bounds.half[0], bounds.ranges[0]);
        let rows = Extents::new(simd, bounds.grid, y, bounds.half[1], bounds.ranges[1]);
        let outside = bits(x[0].simd_eq(OUTSIDE) | x[1].simd_eq(OUTSIDE) | x[2].simd_eq(OUTSIDE));
        let first_row = (rows.first - bounds.margin).max(0);
        let last_row = (rows.last + bounds.margin).min(bounds.row_last);
        let is_empty = columns.first.simd_gt(columns.last) | first_row.simd_gt(last_row);
        let [front, back] = if (columns.is_small & rows.is_small).all_true() {
            let area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
            [bits(area.simd_lt(0)), bits(area.simd_gt(0))]
        } else {
            sides(corners)
        };
        Self {
            front,
            back,
            seen: !bits(is_empty) & !outside,
            outside,
            wide: bits(extent(x).simd_gt(FRINGED_MAX) | extent(y).simd_gt(FRINGED_MAX)) | outside,
            span: pairs(band_of(first_row, bounds), band_of(last_row, bounds)),
            columns: pairs(columns.first, columns.last),
            rows: pairs(rows.first, rows.last),
            depth_max: corners.depth_max(),
        }
    }

    /// Adds the lanes of `bits` to ids and bands.
    #[inline(always)]
    fn put(&self, simd: V, first: usize, bits: u32, kept: &mut KeptFaces) {
        let (mask, count) = (mask32x8::from_bitmask(simd, bits.into()), bits.count_ones() as usize);
        push(&mut kept.ids, count, as_words(ids(simd, first).compress(mask)));
        push(&mut kept.spans, count, as_words(self.span.compress(mask)));
    }

    /// Adds the lanes of `bits` with their boxes.
    #[inline(always)]
    fn put_boxed(&self, simd: V, first: usize, bits: u32, kept: &mut KeptFaces) {
        let mask = mask32x8::from_bitmask(simd, bits.into());
        let (ids_low, ids_high) = ids(simd, first).compress(mask).split();
        let (columns_low, columns_high) = self.columns.compress(mask).split();
        let (rows_low, rows_high) = self.rows.compress(mask).split();
        let (depth_low, depth_high) = self.depth_max.compress(mask).bitcast::<i32x8<V>>().split();
        let low: [i32x4<V>; 4] = transposed_half([ids_low, columns_low, rows_low, depth_low]);
        let high: [i32x4<V>; 4] = transposed_half([ids_high, columns_high, rows_high, depth_high]);
        let mut faces = [[0_i32; 4]; LANES];
        for l in 0..LANES {
            faces[l] = if l < 4 { low[l].into() } else { high[l - 4].into() };
        }
        push(&mut kept.boxed, bits.count_ones() as usize, bytemuck::must_cast::<_, [BoxedFace; LANES]>(faces));
    }
}

/// The distance between the least and the greatest of three. Only what lies outside wraps.
#[inline(always)]
fn extent<V: Simd>(v: &[i32x8<V>; 3]) -> i32x8<V> {
    v[0].max(v[1]).max(v[2]) - v[0].min(v[1]).min(v[2])
}

/// A bit for each lane.
#[inline(always)]
fn bits<V: Simd>(mask: mask32x8<V>) -> u32 {
    mask.to_bitmask() as u32
}

/// Ids in succession.
#[inline(always)]
fn ids<V: Simd>(simd: V, first: usize) -> i32x8<V> {
    i32x8::simd_from(simd, [0, 1, 2, 3, 4, 5, 6, 7]) + first as i32
}

#[inline(always)]
fn as_words<V: Simd>(v: i32x8<V>) -> [u32; LANES] {
    bytemuck::must_cast::<[i32; LANES], _>(v.into())
}

/// Adds the first `count` items.
#[inline(always)]
fn push<T: Copy>(items: &mut Vec<T>, count: usize, all: [T; LANES]) {
    // All are written, which is a vector at a time, and those beyond are left.
    let len = items.len() + count.min(LANES);
    items.extend_from_slice(&all);
    items.truncate(len);
}

/// Bits of the lanes that face the viewer, and that face away.
#[cold]
#[inline(never)]
fn sides<V: Simd>(corners: &CornerLanes<V>) -> [u32; 2] {
    let mut sides = [0; 2];
    for l in 0..LANES {
        let [x, y] = corner_of(corners, l);
        let area = area_of(x, y);
        sides = [sides[0] | u32::from(area < 0) << l, sides[1] | u32::from(area > 0) << l];
    }
    sides
}

/// Bands of rows. f32 divides exactly enough: rows are below 2^13.
#[inline(always)]
fn band_of<V: Simd>(row: i32x8<V>, bounds: &Bounds) -> i32x8<V> {
    ((f32x8::float_from(row) + 0.5) * (1.0 / bounds.rows as f32)).to_int()
}

/// As `pair` of `lists`.
#[inline(always)]
fn pairs<V: Simd>(first: i32x8<V>, last: i32x8<V>) -> i32x8<V> {
    (first & 0xFFFF) | (last << 16)
}
