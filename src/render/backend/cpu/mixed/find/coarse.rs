//! A quick test in the search for the pixels that are drawn a second time (stage mixed): it finds pixels whose faces
//! all look alike, and like the closest ones on the left and above. The samples of such a pixel need no further
//! comparison. Most pixels that show several faces pass the test.
//!
//! A face's [`Look`] says what decides its colour. This module remembers the looks of recent faces, rounded to bytes.
//! A pixel passes if all its faces are remembered and their bytes differ so little that the looks themselves are
//! certainly alike. For the other pixels the caller compares the looks.

use super::look::{ALIKE, Look, kinds};
use crate::backend::cpu::geometry::samples::NOTHING;

/// Faces that are remembered: a power of two.
const COUNT: usize = 4096;

/// The id in an empty slot. [`NOTHING`] is never remembered, so pixels that show the background do not pass.
const FREE: u32 = NOTHING - 1;

/// Steps of a byte per unit of the square root of a value.
const STEPS: f32 = 79.0;

/// Largest difference of bytes that tells that values are alike.
///
/// Values a and b are alike if (a - b)^2 <= [`ALIKE`] (a + b). With u and v for their square roots, (a - b)^2 is
/// (u - v)^2 (u + v)^2, which is at most (u - v)^2 times 2 (a + b). So (u - v)^2 <= [`ALIKE`] / 2 suffices. Bytes are
/// rounded down: where they differ by 7 steps, u and v differ by less than 8. A hundredth is left for what f32 rounds.
const ALIKE_STEPS: u8 = 7;

/// The bits of the three values' ranges and of the key's range that are all 0 if faces are alike.
const UNLIKE_BITS: u32 = !u32::from_le_bytes([ALIKE_STEPS, ALIKE_STEPS, ALIKE_STEPS, 0]);

const _: () = {
    // A difference has none of these bits just where it is at most `ALIKE_STEPS`.
    assert!((ALIKE_STEPS + 1).is_power_of_two());
    let difference = (ALIKE_STEPS as f32 + 1.0) / STEPS;
    assert!(difference * difference < ALIKE / 2.0 * 0.99);
};

/// Key byte of the outline's triangles. A material with a lower index has that index as its key. Faces of other
/// materials never pass.
const BY_COLOR: u8 = 254;

/// A look in bytes. The lower four are the minimum of each of three values, and the key. The higher four are 255
/// minus the maximum of each, and 255 minus the key. So the bytewise minimum of two looks has the range of both.
type Bytes = u64;

/// Bytes of a face that is like no other: its values and key range from 0 to 255, together with those of any face.
const UNLIKE: Bytes = 0;

/// The looks of faces that were looked at last.
pub struct CoarseLooks {
    ids: Box<[u32; COUNT]>,
    looks: Box<[Bytes; COUNT]>,
}

impl Default for CoarseLooks {
    fn default() -> Self {
        Self { ids: Box::new([FREE; COUNT]), looks: Box::new([UNLIKE; COUNT]) }
    }
}

impl CoarseLooks {
    /// Allocated memory, bytes.
    pub const BYTES: usize = COUNT * (size_of::<u32>() + size_of::<Bytes>());

    /// Forgets all faces: another picture has others.
    pub fn reset(&mut self) {
        self.ids.fill(FREE);
    }

    /// True if the face is remembered.
    #[inline(always)]
    pub fn has(&self, id: u32) -> bool {
        self.ids[id as usize % COUNT] == id
    }

    /// Remembers a face.
    #[inline(always)]
    pub fn put(&mut self, id: u32, look: &Look) {
        let place = id as usize % COUNT;
        (self.ids[place], self.looks[place]) = (id, in_bytes(look));
    }

    /// True if all these faces are remembered and each pair of them certainly looks alike.
    #[inline(always)]
    pub fn are_alike<const N: usize>(&self, ids: [u32; N]) -> bool {
        let mut least = u64::MAX;
        let mut is_known = true;
        for id in ids {
            let place = id as usize % COUNT;
            is_known &= self.ids[place] == id;
            least = smallest_bytes(least, self.looks[place]);
        }
        // The smallest value is not above the largest. So no sum of two bytes is more than 255, and none carries.
        let ranges = !(least as u32).wrapping_add((least >> 32) as u32);
        is_known & (ranges & UNLIKE_BITS == 0)
    }
}

/// The bytewise minimum of two numbers.
#[inline(always)]
#[allow(unsafe_code)]
fn smallest_bytes(a: u64, b: u64) -> u64 {
    // Compilers take the bytes one by one.
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_mm_cvtsi64_si128, _mm_cvtsi128_si64, _mm_min_epu8};
        // SAFETY: every processor of this architecture has SSE2.
        unsafe { _mm_cvtsi128_si64(_mm_min_epu8(_mm_cvtsi64_si128(a as i64), _mm_cvtsi64_si128(b as i64))) as u64 }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        let (mut a, b) = (a.to_ne_bytes(), b.to_ne_bytes());
        for k in 0..8 {
            a[k] = a[k].min(b[k]);
        }
        u64::from_ne_bytes(a)
    }
}

#[inline(always)]
fn in_bytes(look: &Look) -> Bytes {
    let index = look.keys[0] & !(3 << 30);
    let key = match look.keys[0] & 3 << 30 {
        kinds::BY_NORMAL if index < u32::from(BY_COLOR) => index as u8,
        kinds::BY_COLOR => BY_COLOR,
        _ => return UNLIKE,
    };
    let mut bytes = [key, key, key, key, !key, !key, !key, !key];
    for k in 0..3 {
        let (low, high) = (look.low[k].sqrt() * STEPS, look.high[k].sqrt() * STEPS);
        // No range contains NaN.
        if !(0.0..255.0).contains(&low) || !(0.0..255.0).contains(&high) {
            return UNLIKE;
        }
        (bytes[k], bytes[4 + k]) = (low as u8, !(high as u8));
    }
    u64::from_le_bytes(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::mixed::find::look::{NORMAL_SHIFT, Step};

    #[test]
    fn faces_that_pass_look_alike() {
        let mut state = 3_u32;
        let mut chance = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let (mut passed, mut alike) = (0, 0);
        for round in 0..20_000_u32 {
            let center = [0; 3].map(|_| 2.0 * chance() - 1.0);
            let spread = [0.02, 0.1, 0.2, 0.4][round as usize % 4];
            let mut looks = [Look::NOTHING; 3];
            for (i, look) in looks.iter_mut().enumerate() {
                let [a, b] = [0; 2].map(|_| center.map(|v| v + NORMAL_SHIFT + spread * (chance() - 0.5)));
                let material = if round % 16 == 0 { i as u32 / 2 } else { round % 300 };
                *look = Look { low: a, high: a, keys: [kinds::BY_NORMAL | material; 2] };
                for k in 0..3 {
                    (look.low[k], look.high[k]) = (a[k].min(b[k]), a[k].max(b[k]));
                }
            }
            let mut coarse = CoarseLooks::default();
            let ids = [round, round + 1, round + 70_000];
            // Colours of the outline, down to black.
            if round % 5 == 0 {
                for look in &mut looks {
                    let shift = |v: f32| (v - 0.5).max(0.0) * [1.0, 0.1, 0.001][round as usize / 5 % 3];
                    *look = Look { low: look.low.map(shift), high: look.high.map(shift), keys: [kinds::BY_COLOR; 2] };
                }
            }
            for (id, look) in ids.iter().zip(&looks) {
                coarse.put(*id, look);
            }
            let is_alike = (0..3).all(|i| looks[i].step_to(&looks[(i + 1) % 3]) == Step::None);
            let is_passed = coarse.are_alike(ids);
            assert!(is_alike || !is_passed, "{looks:?}");
            assert!(!coarse.are_alike([ids[0], round + 7]), "a face that is not known");
            assert!(!coarse.are_alike([ids[0], NOTHING]), "nothing");
            (passed, alike) = (passed + usize::from(is_passed), alike + usize::from(is_alike));
        }
        assert!(passed > 5_000 && passed < alike && 2 * passed > alike, "{passed} of {alike}");
    }

    #[test]
    fn faces_like_no_other_do_not_pass() {
        let normal = |v: f32, material: u32| Look { low: [v; 3], high: [v; 3], keys: [kinds::BY_NORMAL | material; 2] };
        let is_passed = |look: Look| {
            let mut coarse = CoarseLooks::default();
            coarse.put(5, &look);
            coarse.put(6, &look);
            coarse.are_alike([5, 6])
        };
        assert!(is_passed(normal(1.5, 0)) && is_passed(normal(1.5, 253)));
        assert!(!is_passed(normal(1.5, 254)) && !is_passed(normal(1.5, 70_000)), "more materials than bytes");
        assert!(!is_passed(normal(f32::NAN, 0)) && !is_passed(normal(-1.0, 0)) && !is_passed(normal(640.0, 0)));
        assert!(!is_passed(Look { keys: [kinds::UNIQUE | 5; 2], ..normal(1.5, 0) }));
        assert!(is_passed(Look { keys: [kinds::BY_COLOR; 2], ..normal(0.5, 0) }));
        assert!(is_passed(normal(10.4, 0)) && !is_passed(normal(10.5, 0)), "more than a byte");
    }

    #[test]
    fn what_was_remembered_is_forgotten() {
        let look = Look { low: [1.5; 3], high: [1.5; 3], keys: [kinds::BY_NORMAL; 2] };
        let mut coarse = CoarseLooks::default();
        // Where nothing has its place, too.
        let ids = [NOTHING % COUNT as u32, 7];
        ids.iter().for_each(|id| coarse.put(*id, &look));
        assert!(coarse.are_alike(ids) && !coarse.are_alike([ids[1], NOTHING]));
        coarse.reset();
        assert!(!coarse.are_alike(ids) && !coarse.are_alike([NOTHING, NOTHING]) && !coarse.has(ids[0]));
    }
}
