//! Two inner loops of [`dig`](super), which finds the areas of faces that lines leave free, in AVX2 instructions.
//! One finds the pixels of a row that show a face. The other tests whether something hides the face there. The
//! results are the same as without AVX2.

use std::arch::x86_64::*;

use bytemuck::must_cast;

use super::Samples;
use crate::backend::cpu::isa::LANES;
use crate::backend::cpu::lines::holes::avx2::bits;
use crate::backend::cpu::lines::holes::inset::{INSIDE, Inset};

/// As `shown_plainly`, of at most ten pixels.
#[target_feature(enable = "avx2")]
pub fn shown<const S: usize>(ids: &[u32], id: u32) -> u32 {
    let lanes = _mm256_set1_epi32(id as i32);
    let (groups, rest) = ids.as_chunks::<LANES>();
    let mut shown = 0_u64;
    for (i, group) in groups.iter().enumerate() {
        let equal = u64::from(bits(_mm256_cmpeq_epi32(must_cast(*group), lanes)));
        shown |= match S {
            1 | 4 => equal << (LANES * i),
            _ => u64::from(equal != 0) << (i * LANES / S),
        };
    }
    // With 8 and 16 samples no id is left, with 4 those of one pixel.
    for (i, &other) in rest.iter().enumerate() {
        shown |= u64::from(other == id) << (LANES * groups.len() + i);
    }
    if S == 4 { of_pixels(shown) } else { shown as u32 }
}

/// Bits of pixels, of which each has four bits of samples. Any of them counts.
#[inline(always)]
fn of_pixels(samples: u64) -> u32 {
    let pairs = samples | samples >> 1;
    let mut bits = (pairs | pairs >> 2) & 0x1111_1111_1111_1111;
    bits = (bits | bits >> 3) & 0x0303_0303_0303_0303;
    bits = (bits | bits >> 6) & 0x000F_000F_000F_000F;
    bits = (bits | bits >> 12) & 0x0000_00FF_0000_00FF;
    (bits | bits >> 24) as u32 & 0xFFFF
}

/// As `hides_plainly`.
#[target_feature(enable = "avx2")]
pub fn hides<'s>(inset: &Inset, id: u32, corner: [f32; 2], samples: impl Iterator<Item = Samples<'s>>) -> bool {
    let sides = inset.sides_of_face();
    let (left, top) = (_mm256_set1_ps(corner[0]), _mm256_set1_ps(corner[1]));
    let mut hides = _mm256_setzero_ps();
    for (right, down, ids) in samples {
        let x = _mm256_add_ps(left, must_cast(*right));
        let y = _mm256_add_ps(top, must_cast(*down));
        let is_own = _mm256_cmpeq_epi32(must_cast(*ids), _mm256_set1_epi32(id as i32));
        let mut is_outside = _mm256_castsi256_ps(is_own);
        for (corner, unit) in &sides {
            let across = _mm256_mul_ps(_mm256_set1_ps(unit[0]), _mm256_sub_ps(y, _mm256_set1_ps(corner[1])));
            let along = _mm256_mul_ps(_mm256_set1_ps(unit[1]), _mm256_sub_ps(x, _mm256_set1_ps(corner[0])));
            let distance = _mm256_sub_ps(across, along);
            // Not a number counts as outside.
            is_outside = _mm256_or_ps(is_outside, _mm256_cmp_ps::<_CMP_NGE_UQ>(distance, _mm256_set1_ps(INSIDE)));
        }
        hides = _mm256_or_ps(hides, _mm256_andnot_ps(is_outside, _mm256_castsi256_ps(_mm256_set1_epi32(-1))));
    }
    _mm256_movemask_ps(hides) != 0
}
