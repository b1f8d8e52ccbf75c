//! The search for the pixels of a row whose samples show more than one face: their own samples, or one of
//! them and the closest sample of the pixel on the left or above (stage mixed). Only the samples of these
//! pixels have to be compared by colour, to find the pixels that are drawn a second time from more points.
//! This search is for pictures with four samples per pixel.

#[cfg(target_arch = "x86_64")]
mod avx2;

use crate::backend::cpu::isa::Isa;
use crate::plan::OutermostSamples;

/// The samples closest to the sides of a pixel of four.
pub const OUTERMOST: OutermostSamples = OutermostSamples::OF_FOUR;

/// Ids of a pixel's samples.
pub type Ids = [u32; 4];

/// Pixels of a word.
pub const WORD: usize = u64::BITS as usize;

/// Sets a bit of `words` for each such pixel of a row, given the row above. The first pixel is not compared with one on
/// its left.
#[inline(always)]
pub fn find_differing(isa: Isa, own: &[Ids], above: &[Ids], words: &mut Vec<u64>) {
    words.clear();
    // The pixels of a word, and the one on their left.
    let mut padded = [own.first().copied().unwrap_or_default(); WORD + 1];
    for (i, above) in above.chunks(WORD).enumerate() {
        let first = i * WORD;
        let own = match own.get(first.wrapping_sub(1)..).and_then(<[Ids]>::first_chunk) {
            Some(own) => own,
            None => {
                let rest = own.get(first..).unwrap_or_default();
                let len = rest.len().min(WORD);
                padded[0] = if first == 0 { padded[0] } else { own[first - 1] };
                padded[1..=len].copy_from_slice(&rest[..len]);
                &padded
            }
        };
        words.push(word(isa, own, above));
    }
}

#[inline(always)]
#[allow(unsafe_code)]
fn word(isa: Isa, own: &[Ids; WORD + 1], above: &[Ids]) -> u64 {
    #[cfg(target_arch = "x86_64")]
    if let (true, Some(above)) = (isa.has_avx2(), above.first_chunk()) {
        // SAFETY: `has_avx2` is true where the processor has AVX2.
        return unsafe { avx2::word(own, above) };
    }
    let _ = isa;
    let mut word = 0;
    for (x, above) in above.iter().enumerate() {
        let (left, [a, b, c, d]) = (own[x][OUTERMOST.right], own[x + 1]);
        let difference = (a ^ b) | (a ^ c) | (a ^ d) | (a ^ left) | (a ^ above[OUTERMOST.bottom]);
        word |= u64::from(difference != 0) << x;
    }
    word
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_instruction_set_finds_the_pixels_that_differ() {
        let mut state = 7_u32;
        for width in [1, 2, 63, 64, 65, 127, 128, 129, 500] {
            for rarity in [2, 40, 4000] {
                let mut id = || {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    u32::from((state >> 8).is_multiple_of(rarity))
                };
                let mut row = || (0..width).map(|_| [id(), id(), id(), id()]).collect::<Vec<Ids>>();
                let (own, above) = (row(), row());
                let differs = |x: usize| {
                    let first = own[x][0];
                    own[x] != [first; 4] || above[x][3] != first || x > 0 && own[x - 1][1] != first
                };
                let want: Vec<bool> = (0..width).map(differs).collect();
                for isa in Isa::available() {
                    let mut words = Vec::new();
                    find_differing(isa, &own, &above, &mut words);
                    assert_eq!(words.len(), width.div_ceil(WORD));
                    let found: Vec<bool> = (0..width).map(|x| words[x / WORD] >> (x % WORD) & 1 != 0).collect();
                    assert_eq!(found, want, "{isa:?}, {width} pixels");
                }
            }
        }
    }
}
