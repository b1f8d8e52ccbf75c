//! Culling of triangles in AVX2 instructions, eight at a time, lane for lane as without.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::{Bounds, Kept, Sides, TrianglePass, area_of};
use crate::backend::cpu::bands::lists::{BoxedFace, KeptFaces};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::batch_avx2::{Corners, bits, load, pixels, to_ints, transposed};
use crate::backend::cpu::geometry::setups::EXTENT_MAX;
use crate::backend::cpu::geometry::transform::OUTSIDE;
use crate::backend::cpu::isa::LANES;
use crate::backend::cpu::mixed::thinness::is_thin;

/// By bits of lanes: these lanes first, in their order, a byte each.
static ORDERS: [u64; 256] = orders();

const fn orders() -> [u64; 256] {
    let mut orders = [0; 256];
    let mut bits = 0;
    while bits < 256 {
        let (mut lane, mut place) = (0, 0);
        while lane < LANES as u64 {
            if bits >> lane & 1 != 0 {
                orders[bits] |= lane << (8 * place);
                place += 1;
            }
            lane += 1;
        }
        bits += 1;
    }
    orders
}

/// The vector of lanes by which `_mm256_permutevar8x32` moves those of `bits` to the front.
#[inline]
#[target_feature(enable = "avx2")]
fn order_of(bits: u32) -> __m256i {
    _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(ORDERS[(bits & 255) as usize] as i64))
}

/// As `keep_plainly`, given the pass's triangles.
#[target_feature(enable = "avx2")]
pub fn keep(context: &RasterContext<'_>, bounds: &Bounds, pass: &TrianglePass, triangles: &[[u32; 3]]) -> Kept {
    let mut kept = Kept::with_room_for(triangles.len(), bounds);
    for (first, group) in pass.ids.clone().step_by(LANES).zip(triangles.chunks(LANES)) {
        let mut padded = [group[0]; LANES];
        let triangles = group.first_chunk().unwrap_or_else(|| {
            padded[..group.len()].copy_from_slice(group);
            &padded
        });
        let corners = load(context.vertices, triangles);
        let lanes = Lanes::new(&corners, bounds);
        let drawn = pass.drawn(context.plan, first, group.len());
        let whole = !lanes.outside & ((1 << group.len()) - 1);
        kept.sides.push(Sides { front: (lanes.front & whole) as u8, back: (lanes.back & whole) as u8 });
        let (front, back) = (lanes.front & lanes.seen & drawn[0], lanes.back & lanes.seen & drawn[1]);
        if front != 0 {
            if bounds.has_mixed {
                lanes.put_boxed(first, front, &mut kept.fronts);
            }
            lanes.put(first, front, &mut kept.fronts);
        }
        if back != 0 {
            lanes.put_boxed(first, back, &mut kept.backs);
            lanes.put(first, back, &mut kept.backs);
        }
        if bounds.has_mixed && front | back != 0 {
            let thin = thin(&corners, front | back);
            if thin != 0 {
                lanes.put_boxed(first, thin, &mut kept.thin);
                lanes.put(first, thin, &mut kept.thin);
            }
        }
        let outside = lanes.outside & (drawn[0] | drawn[1]);
        if outside != 0 {
            kept.outside.extend((0..LANES).filter(|l| outside >> l & 1 != 0).map(|l| (first + l) as u32));
        }
    }
    kept
}

/// Bits of the lanes, of some, whose triangles are thin.
#[inline]
#[target_feature(enable = "avx2")]
fn thin(corners: &Corners, lanes: u32) -> u32 {
    let ints = |v: [__m256i; 3]| [to_ints(v[0]), to_ints(v[1]), to_ints(v[2])];
    let (x, y) = (ints(corners.x), ints(corners.y));
    let mut thin = 0;
    for l in 0..LANES {
        let [x, y] = [x, y].map(|axis| [axis[0][l], axis[1][l], axis[2][l]]);
        thin |= u32::from(is_thin(x, y, area_of(x, y))) << l;
    }
    thin & lanes
}

/// Eight triangles on screen.
struct Lanes {
    /// Bits of the lanes that face the viewer, face away, may have samples, lie outside.
    front: u32,
    back: u32,
    seen: u32,
    outside: u32,
    span: __m256i,
    columns: __m256i,
    rows: __m256i,
    depth_max: __m256,
}

impl Lanes {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(corners: &Corners, bounds: &Bounds) -> Self {
        let Corners { x, y, z } = corners;
        let (left, right, is_narrow) = axis(x, bounds, 0);
        let (top, bottom, is_low) = axis(y, bounds, 1);
        let is_at = |v: __m256i| _mm256_cmpeq_epi32(v, _mm256_set1_epi32(OUTSIDE));
        let outside = bits(_mm256_or_si256(_mm256_or_si256(is_at(x[0]), is_at(x[1])), is_at(x[2])));
        let margin = _mm256_set1_epi32(bounds.margin);
        let first_row = _mm256_max_epi32(_mm256_sub_epi32(top, margin), _mm256_setzero_si256());
        let last_row = _mm256_min_epi32(_mm256_add_epi32(bottom, margin), _mm256_set1_epi32(bounds.row_last));
        let is_empty = _mm256_or_si256(_mm256_cmpgt_epi32(left, right), _mm256_cmpgt_epi32(first_row, last_row));
        let [front, back] = if bits(_mm256_and_si256(is_narrow, is_low)) == 255 {
            let area = small_areas(x, y);
            let zero = _mm256_setzero_si256();
            [bits(_mm256_cmpgt_epi32(zero, area)), bits(_mm256_cmpgt_epi32(area, zero))]
        } else {
            sides(x, y)
        };
        Self {
            front,
            back,
            seen: !bits(is_empty) & !outside,
            outside,
            span: pairs(band_of(first_row, bounds), band_of(last_row, bounds)),
            columns: pairs(left, right),
            rows: pairs(top, bottom),
            depth_max: _mm256_max_ps(_mm256_max_ps(z[0], z[1]), z[2]),
        }
    }

    /// Adds the lanes of `bits` to ids and bands.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn put(&self, first: usize, bits: u32, kept: &mut KeptFaces) {
        let (order, count) = (order_of(bits), bits.count_ones() as usize);
        push(&mut kept.ids, count, [_mm256_add_epi32(_mm256_set1_epi32(first as i32), order)]);
        push(&mut kept.spans, count, [_mm256_permutevar8x32_epi32(self.span, order)]);
    }

    /// Adds the lanes of `bits` with their boxes.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn put_boxed(&self, first: usize, bits: u32, kept: &mut KeptFaces) {
        let order = order_of(bits);
        let place = |v: __m256i| _mm256_castsi256_ps(_mm256_permutevar8x32_epi32(v, order));
        let ids = _mm256_castsi256_ps(_mm256_add_epi32(_mm256_set1_epi32(first as i32), order));
        let depth_max = _mm256_permutevar8x32_ps(self.depth_max, order);
        let faces = transposed([ids, place(self.columns), place(self.rows), depth_max]);
        let (low, high) = (
            |k: usize| _mm256_castps_si256(_mm256_permute2f128_ps::<0x20>(faces[k], faces[k + 1])),
            |k: usize| _mm256_castps_si256(_mm256_permute2f128_ps::<0x31>(faces[k], faces[k + 1])),
        );
        push(&mut kept.boxed, bits.count_ones() as usize, [low(0), low(2), high(0), high(2)]);
    }
}

/// Adds the first `count` of the [`LANES`] items that these vectors are.
#[inline]
#[target_feature(enable = "avx2")]
fn push<T: Item, const N: usize>(items: &mut Vec<T>, count: usize, vectors: [__m256i; N]) {
    const { assert!(N * size_of::<__m256i>() == LANES * size_of::<T>()) };
    let count = count.min(LANES);
    items.reserve(LANES);
    let out = items.spare_capacity_mut().as_mut_ptr().cast::<__m256i>();
    // SAFETY: there is room for `LANES` items, which have the size of these vectors, and any bits make
    // an item. The first `count` of them are written. Stores need no alignment.
    unsafe {
        for (k, v) in vectors.into_iter().enumerate() {
            _mm256_storeu_si256(out.add(k), v);
        }
        items.set_len(items.len() + count);
    }
}

/// A type of which any bits are a value.
///
/// # Safety
///
/// The type has neither padding nor invalid values.
unsafe trait Item {}

// SAFETY: a number.
unsafe impl Item for u32 {}

// SAFETY: four numbers of four bytes, in C's layout.
unsafe impl Item for BoxedFace {}

/// First and last pixel along an axis, and which triangles are small along it.
#[inline]
#[target_feature(enable = "avx2")]
fn axis(v: &[__m256i; 3], bounds: &Bounds, k: usize) -> (__m256i, __m256i, __m256i) {
    let low = _mm256_min_epi32(_mm256_min_epi32(v[0], v[1]), v[2]);
    let high = _mm256_max_epi32(_mm256_max_epi32(v[0], v[1]), v[2]);
    let [first, last] = pixels([low, high], bounds.half[k], bounds.grid, bounds.ranges[k]);
    (first, last, _mm256_cmpgt_epi32(_mm256_set1_epi32(EXTENT_MAX + 1), _mm256_sub_epi32(high, low)))
}

/// Twice the signed areas, of triangles up to [`EXTENT_MAX`].
#[inline]
#[target_feature(enable = "avx2")]
fn small_areas(x: &[__m256i; 3], y: &[__m256i; 3]) -> __m256i {
    let d = |v: &[__m256i; 3], k: usize| _mm256_sub_epi32(v[k], v[0]);
    _mm256_sub_epi32(_mm256_mullo_epi32(d(x, 1), d(y, 2)), _mm256_mullo_epi32(d(x, 2), d(y, 1)))
}

/// Bits of the lanes that face the viewer, and that face away.
#[cold]
#[inline(never)]
#[target_feature(enable = "avx2")]
fn sides(x: &[__m256i; 3], y: &[__m256i; 3]) -> [u32; 2] {
    let (x, y) = ([to_ints(x[0]), to_ints(x[1]), to_ints(x[2])], [to_ints(y[0]), to_ints(y[1]), to_ints(y[2])]);
    let mut sides = [0; 2];
    for l in 0..LANES {
        let area = area_of([x[0][l], x[1][l], x[2][l]], [y[0][l], y[1][l], y[2][l]]);
        sides = [sides[0] | u32::from(area < 0) << l, sides[1] | u32::from(area > 0) << l];
    }
    sides
}

/// Bands of rows. f32 divides exactly enough: rows are below 2^13.
#[inline]
#[target_feature(enable = "avx2")]
fn band_of(row: __m256i, bounds: &Bounds) -> __m256i {
    let middle = _mm256_add_ps(_mm256_cvtepi32_ps(row), _mm256_set1_ps(0.5));
    _mm256_cvttps_epi32(_mm256_mul_ps(middle, _mm256_set1_ps(1.0 / bounds.rows as f32)))
}

/// As `pair` of `lists`.
#[inline]
#[target_feature(enable = "avx2")]
fn pairs(first: __m256i, last: __m256i) -> __m256i {
    _mm256_blend_epi16::<0b1010_1010>(first, _mm256_slli_epi32::<16>(last))
}
