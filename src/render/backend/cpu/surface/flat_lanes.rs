//! SIMD helpers of `flat`, which shades triangles that have one colour all over (stage shade): they gather the
//! normals of eight triangles, store their eight colours in the table, and average the colours of a pixel's samples.
//! They are written with explicit vectors because compilers make slower code from plain loops, with branches and one
//! value at a time.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, i32x8, mask32x4, mask32x8, u32x8};

use crate::backend::cpu::geometry::setups::{transposed, transposed_half};
use crate::backend::cpu::isa::LANES;

/// Samples per pixel, of [`means`].
const SAMPLES: usize = 4;

/// Pixels in a vector of ids.
const PIXELS: usize = LANES / SAMPLES;

/// As `mean` of each pixel, given the ids of its samples. True if no colour is unknown.
#[inline(always)]
pub fn means<V: Simd>(
    simd: V,
    colors: &[[f32; 4]],
    ids: &[[u32; SAMPLES]; LANES],
    out: &mut [[f32; 4]; LANES],
) -> bool {
    let Some(last) = colors.len().checked_sub(1) else { return false };
    let mut unknown = mask32x8::splat(simd, false);
    for (ids, out) in ids.as_chunks::<PIXELS>().0.iter().zip(out.as_chunks_mut::<PIXELS>().0) {
        let weights: [f32; LANES] = weights(simd, u32x8::from_slice(simd, ids.as_flattened())).into();
        let mut sum = f32x8::splat(simd, 0.0);
        for s in 0..SAMPLES {
            let of_first = f32x4::simd_from(simd, colors[(ids[0][s] as usize).min(last)]);
            let of_second = f32x4::simd_from(simd, colors[(ids[1][s] as usize).min(last)]);
            let weight = f32x4::splat(simd, weights[s]).combine(f32x4::splat(simd, weights[SAMPLES + s]));
            sum += weight * of_first.combine(of_second);
        }
        unknown |= sum.is_nan();
        sum.store_slice(out.as_flattened_mut());
    }
    unknown.all_false()
}

/// As `mean` of each pixel, given the ids of its samples: a multiple of [`LANES`], at most 32. True if no colour is
/// unknown.
#[inline(always)]
pub fn means_of_many<V: Simd, const S: usize>(
    simd: V,
    colors: &[[f32; 4]],
    pixels: &[[u32; S]],
    out: &mut [[f32; 4]],
) -> bool {
    const { assert!(S <= u32::BITS as usize) };
    debug_assert!(S.is_multiple_of(LANES));
    let Some(last) = colors.len().checked_sub(1) else { return false };
    let mut unknown = mask32x4::splat(simd, false);
    for (ids, out) in pixels.iter().zip(out) {
        let (mut sum, mut left) = (f32x4::splat(simd, 0.0), u32::MAX >> (u32::BITS - S as u32));
        while left != 0 {
            let id = ids[left.trailing_zeros() as usize % S];
            let same = same_as(simd, id, ids);
            left &= (left - 1) & !same;
            let color = f32x4::simd_from(simd, colors[(id as usize).min(last)]);
            sum += color * (same.count_ones() as f32 * (1.0 / S as f32));
        }
        unknown |= sum.is_nan();
        *out = sum.into();
    }
    unknown.all_false()
}

/// A bit for each sample that has this id.
#[inline(always)]
fn same_as<V: Simd, const S: usize>(simd: V, id: u32, ids: &[u32; S]) -> u32 {
    let mut same = 0;
    for (i, ids) in ids.as_chunks::<LANES>().0.iter().enumerate() {
        same |= (u32x8::simd_from(simd, *ids).simd_eq(id).to_bitmask() as u32) << (LANES * i);
    }
    same
}

/// Normals of triangles, turned to the viewer; None if some id is not below the last normal's.
#[inline(always)]
pub fn normals<V: Simd>(
    simd: V,
    normals: &[[f32; 3]],
    ids: &[u32; LANES],
    is_front: bool,
) -> Option<[[f32; LANES]; 3]> {
    let normals = normals.as_flattened();
    let mut rows = [[f32x4::splat(simd, 0.0).bitcast(); 4]; 2];
    for l in 0..LANES {
        // A normal and a part of the next.
        let row = normals.get(3 * ids[l] as usize..)?.first_chunk::<4>()?;
        rows[l / 4][l % 4] = f32x4::simd_from(simd, *row).bitcast();
    }
    let sign = if is_front { 0 } else { i32::MIN };
    let [x, y, z, _] = transposed(rows);
    let (x, y, z): (f32x8<V>, f32x8<V>, f32x8<V>) = ((x ^ sign).bitcast(), (y ^ sign).bitcast(), (z ^ sign).bitcast());
    Some([x.into(), y.into(), z.into()])
}

/// Writes colours of triangles, whose first is number `first`, if all are finite.
#[inline(always)]
pub fn write<V: Simd>(
    simd: V,
    colors: &[[f32; LANES]; 4],
    ids: &[u32; LANES],
    first: u32,
    out: &mut [[f32; 4]],
) -> bool {
    let mut columns = [f32x8::splat(simd, 0.0); 4];
    for k in 0..4 {
        columns[k] = f32x8::simd_from(simd, colors[k]);
    }
    // What is not finite is not a number after it is multiplied by 0.
    let sum = (columns[0] * 0.0 + columns[1] * 0.0) + (columns[2] * 0.0 + columns[3] * 0.0);
    if sum.is_nan().any_true() {
        return false;
    }
    let [(a, e), (b, f), (c, g), (d, h)] =
        [columns[0].split(), columns[1].split(), columns[2].split(), columns[3].split()];
    let lower = transposed_half([a.bitcast(), b.bitcast(), c.bitcast(), d.bitcast()]);
    let upper = transposed_half([e.bitcast(), f.bitcast(), g.bitcast(), h.bitcast()]);
    for l in 0..LANES {
        let color: f32x4<V> = if l < 4 { lower[l].bitcast() } else { upper[l - 4].bitcast() };
        let Some(out) = out.get_mut(ids[l].wrapping_sub(first) as usize) else { return false };
        *out = color.into();
    }
    true
}

/// As `weights`, of two pixels.
#[inline(always)]
fn weights<V: Simd>(simd: V, ids: u32x8<V>) -> f32x8<V> {
    // Equal to the sample that is so many further on, round and round.
    let same: [i32x8<V>; 3] = [
        ids.simd_eq(ids.slide_within_blocks::<1>(ids)).to_vector(),
        ids.simd_eq(ids.slide_within_blocks::<2>(ids)).to_vector(),
        ids.simd_eq(ids.slide_within_blocks::<3>(ids)).to_vector(),
    ];
    let counts = 1 - (same[0] + same[1] + same[2]);
    // Samples for which the other one comes first.
    let before = [[0, 0, 0, -1], [0, 0, -1, -1], [0, -1, -1, -1]];
    let mut is_later = i32x8::splat(simd, 0);
    for k in 0..3 {
        let [a, b, c, d] = before[k];
        is_later |= same[k] & i32x8::simd_from(simd, [a, b, c, d, a, b, c, d]);
    }
    f32x8::float_from(counts & !is_later) * (1.0 / SAMPLES as f32)
}
