//! AVX2 versions of two functions of the parent module (stage mixed): whether the points of a mixed
//! pixel lie outside an edge of a triangle, and whether one triangle is nearer than another at
//! them. Eight points are tested at a time. Mixed pixels are drawn a second time, from 64 or 256
//! points each.

use std::arch::x86_64::*;

use bytemuck::must_cast;

use super::Plane;
use crate::backend::cpu::isa::LANES;
use crate::backend::cpu::mixed::points::{Lattice, PointSet};
use crate::backend::sample_partition::{GENERATORS, POINTS};

/// Vectors of a word's points.
const VECTORS: usize = u64::BITS as usize / LANES;

/// From a point to the one that is [`LANES`] later.
struct Steps<const W: usize>;

impl<const W: usize> Steps<W> {
    /// Columns.
    const COLUMNS: i32 = (LANES * Lattice::<W>::STEP * GENERATORS[0]) as i32;

    /// Rows, where the pixel does not end between them.
    const ROWS: i32 = (LANES * Lattice::<W>::STEP * GENERATORS[1] % POINTS) as i32;

    /// By point: all bits if the pixel ends between its row and that of the later point, else none.
    const WRAPS: [[[i32; LANES]; VECTORS]; W] = {
        let mut wraps = [[[0; LANES]; VECTORS]; W];
        let mut i = 0;
        while i < Lattice::<W>::POINTS {
            let (word, bit) = (i / u64::BITS as usize, i % u64::BITS as usize);
            let row = Lattice::<W>::PLACES[1][word][bit];
            wraps[word][bit / LANES][bit % LANES] = if row + Self::ROWS >= POINTS as i32 { -1 } else { 0 };
            i += 1;
        }
        wraps
    };
}

/// As `outside` of the parent. Compilers make much longer code of "a bit for each sign".
#[inline]
#[target_feature(enable = "avx2")]
pub fn outside<const W: usize>([c, dx, dy]: [i32; 3]) -> PointSet<W> {
    // All sums are modulo 2^32.
    let along = |change: i32, places: &[[i32; 64]; W]| {
        _mm256_mullo_epi32(_mm256_set1_epi32(change), must_cast(places[0].as_chunks::<LANES>().0[0]))
    };
    let start = _mm256_sub_epi32(along(dx, &Lattice::<W>::PLACES[1]), along(dy, &Lattice::<W>::PLACES[0]));
    let mut value = _mm256_add_epi32(_mm256_set1_epi32(c), start);
    let step = dx.wrapping_mul(Steps::<W>::ROWS).wrapping_sub(dy.wrapping_mul(Steps::<W>::COLUMNS));
    let (step, pixel) = (_mm256_set1_epi32(step), _mm256_set1_epi32(dx.wrapping_mul(POINTS as i32)));
    let mut set = PointSet::NONE;
    for (word, wraps) in set.0.iter_mut().zip(&Steps::<W>::WRAPS) {
        let mut halves = [0_u32; 2];
        for (bits, wraps) in halves.iter_mut().zip(wraps.as_chunks::<4>().0) {
            let mut four = [value; 4];
            for (own, wraps) in four.iter_mut().zip(wraps) {
                *own = value;
                let wrap = _mm256_and_si256(pixel, must_cast(*wraps));
                value = _mm256_add_epi32(value, _mm256_sub_epi32(step, wrap));
            }
            // Narrowing keeps signs, and interleaves the halves of vectors.
            let [a, b, c, d] = four;
            let bytes = _mm256_packs_epi16(_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d));
            let in_order = _mm256_permutevar8x32_epi32(bytes, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7));
            *bits = _mm256_movemask_epi8(in_order) as u32;
        }
        *word = u64::from(halves[0]) | u64::from(halves[1]) << 32;
    }
    set
}

/// As `Plane::nearer`.
#[inline]
#[target_feature(enable = "avx2")]
pub fn nearer<const W: usize>(own: &Plane, other: &Plane, points: PointSet<W>, wins_ties: bool) -> PointSet<W> {
    let ties = _mm256_castsi256_ps(_mm256_set1_epi32(if wins_ties { -1 } else { 0 }));
    let [columns, rows] = &Lattice::<W>::PLACES;
    let mut nearer = points;
    for ((word, columns), rows) in nearer.0.iter_mut().zip(columns).zip(rows) {
        let mut bits = 0;
        for (i, (columns, rows)) in columns.as_chunks::<LANES>().0.iter().zip(rows.as_chunks::<LANES>().0).enumerate() {
            let asked = *word >> (LANES * i) & 255;
            if asked == 0 {
                continue;
            }
            let places = [must_cast(*columns), must_cast(*rows)];
            let [own, other] = [depths(own, places), depths(other, places)];
            let is_tie = _mm256_and_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(own, other), ties);
            let is_nearer = _mm256_or_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(own, other), is_tie);
            bits |= (asked & _mm256_movemask_ps(is_nearer) as u64) << (LANES * i);
        }
        *word = bits;
    }
    nearer
}

/// As `Plane::at_place` of eight places.
#[inline]
#[target_feature(enable = "avx2")]
fn depths(plane: &Plane, places: [__m256i; 2]) -> __m256 {
    let along = |axis: usize| {
        let place = _mm256_add_epi32(_mm256_set1_epi32(plane.from[axis]), _mm256_slli_epi32::<1>(places[axis]));
        let place = _mm256_mul_ps(_mm256_cvtepi32_ps(place), _mm256_set1_ps(0.5));
        _mm256_mul_ps(_mm256_set1_ps(plane.depth[1 + axis]), place)
    };
    let depth = _mm256_add_ps(_mm256_add_ps(_mm256_set1_ps(plane.depth[0]), along(0)), along(1));
    let depth = _mm256_max_ps(depth, _mm256_set1_ps(plane.range[0]));
    _mm256_min_ps(depth, _mm256_set1_ps(plane.range[1]))
}
