//! Stage visibility: the farthest depth in each tile of a band. A triangle behind that depth is hidden
//! in the whole tile.

#[cfg(target_arch = "x86_64")]
mod avx2;

use super::samples::SampleBand;
use crate::backend::cpu::bands::lists::{BoxedFace, unpair};
use crate::backend::cpu::isa::{Isa, LANES};

/// Pixels along a tile's side.
const TILE: usize = 1 << TILE_SHIFT;

/// Its binary logarithm.
const TILE_SHIFT: i32 = 3;

/// The smallest depth (reversed: the farthest) of each tile of 8 x 8 pixels.
#[derive(Default)]
pub struct Tiles {
    columns: usize,
    /// First column and row that have samples.
    first: [i32; 2],
    /// Row by row.
    depth_min: Vec<f32>,
}

impl Tiles {
    /// The tiles of a band, from the depths that it has now.
    #[inline(always)]
    pub fn new(band: &SampleBand) -> Self {
        Self::with_border(band, 0)
    }

    /// As [`new`](Self::new), each tile with so many pixels around it.
    #[inline(always)]
    pub fn with_border(band: &SampleBand, border_px: usize) -> Self {
        let [columns, rows] = band.range();
        let count = |[from, to]: [i32; 2]| from.abs_diff(to).div_ceil(TILE as u32) as usize;
        let mut tiles = Self {
            columns: count(columns),
            first: [columns[0], rows[0]],
            depth_min: vec![f32::INFINITY; count(columns) * count(rows)],
        };
        let samples = band.samples as usize;
        let tile_rows = count(rows);
        let mut of_row = vec![f32::INFINITY; tiles.columns];
        for (y, row) in band.depth.chunks_exact(band.stride).take(band.rows as usize).enumerate() {
            // What lies beyond the last pixel may have any depth. It can only make the last tile farther.
            for (i, min) in of_row.iter_mut().enumerate() {
                let [from, to] = [(i * TILE).saturating_sub(border_px), (i + 1) * TILE + border_px];
                *min = smallest(&row[from * samples..(to * samples).min(row.len())]);
            }
            let [first, last] = [y.saturating_sub(border_px) / TILE, ((y + border_px) / TILE).min(tile_rows - 1)];
            for mins in tiles.depth_min.chunks_exact_mut(tiles.columns).take(last + 1).skip(first) {
                for (min, of_row) in mins.iter_mut().zip(&of_row) {
                    *min = min.min(*of_row);
                }
            }
        }
        tiles
    }

    /// Bits of up to eight faces that the tiles do not hide, in these rows of samples.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn seen(&self, isa: Isa, faces: &[BoxedFace], rows: [i32; 2]) -> u32 {
        #[cfg(target_arch = "x86_64")]
        if isa.has_avx2() {
            // SAFETY: the processor has AVX2, as `isa` says.
            if let Some(seen) = unsafe { avx2::seen(self, faces, rows) } {
                return seen;
            }
        }
        let _ = isa;
        self.seen_one_by_one(faces, rows)
    }

    #[inline(never)]
    fn seen_one_by_one(&self, faces: &[BoxedFace], [from, to]: [i32; 2]) -> u32 {
        let mut seen = 0;
        for (l, face) in faces.iter().enumerate().take(LANES) {
            let [top, bottom] = unpair(face.rows);
            let rows = [top.max(from), bottom.min(to - 1)];
            let is_seen = rows[0] <= rows[1] && !self.hide(unpair(face.columns), rows, face.depth_max);
            seen |= u32::from(is_seen) << l;
        }
        seen
    }

    /// True if every sample of the tiles that touch these columns and rows is nearer than
    /// `depth_max`.
    #[inline(always)]
    pub fn hide(&self, columns: [i32; 2], rows: [i32; 2], depth_max: f32) -> bool {
        let tile = |v: i32, first: i32| (v - first) as u32 as usize / TILE;
        let (left, right) = (tile(columns[0], self.first[0]), tile(columns[1], self.first[0]));
        let (top, bottom) = (tile(rows[0], self.first[1]), tile(rows[1], self.first[1]));
        for y in top..=bottom {
            let Some(mins) = self.depth_min.get(y * self.columns + left..=y * self.columns + right) else {
                return false;
            };
            for &min in mins {
                if depth_max >= min {
                    return false;
                }
            }
        }
        true
    }
}

#[inline(always)]
fn smallest(depths: &[f32]) -> f32 {
    let mut lanes = [f32::INFINITY; LANES];
    let (groups, rest) = depths.as_chunks::<LANES>();
    for group in groups {
        for l in 0..LANES {
            lanes[l] = if group[l] < lanes[l] { group[l] } else { lanes[l] };
        }
    }
    lanes.iter().chain(rest).fold(f32::INFINITY, |least, &v| if v < least { v } else { least })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::bands::lists::pair;

    #[test]
    fn tiles_hide_what_lies_behind_all_of_their_samples() {
        let mut hidden = 0;
        for samples in [1, 4, 8, 16] {
            let mut band = SampleBand::new([20, 9], 3, 16, samples);
            band.first_row = -3;
            band.depth.fill(0.5);
            let full = Tiles::new(&band);
            assert!(full.hide([-3, 3], [-3, 11], 0.4), "{samples} samples");
            assert!(!full.hide([-3, 3], [-3, 11], 0.5), "equal depths may show");
            // The second tile of the first row has a sample in which nothing lies.
            let empty = band.index(6, 4, samples - 1);
            band.depth[empty] = 0.0;
            let tiles = Tiles::new(&band);
            let hides = |columns, rows| tiles.hide(columns, rows, 0.4);
            assert!(hides([-3, 4], [-3, 12]) && hides([5, 12], [5, 12]), "tiles beside it hide");
            assert!(!hides([5, 5], [-3, -3]) && !hides([-3, 5], [4, 5]), "it does not");
            hidden += 1;
        }
        assert_eq!(hidden, 4);
    }

    /// Boxes of all sizes at all places, between tiles of chance depths.
    #[test]
    fn every_instruction_set_sees_the_same_faces() {
        let mut band = SampleBand::new([40, 30], 5, 36, 4);
        band.first_row = -3;
        let mut state = 1_u32;
        let mut chance = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        band.depth.iter_mut().for_each(|depth| *depth = 0.5 + chance(100) as f32 / 1000.0);
        let tiles = Tiles::new(&band);
        let mut found = [0; 2];
        for round in 0..4000 {
            let most = if round % 2 == 0 { 9 } else { 25 };
            let mut faces = [BoxedFace::default(); LANES];
            for face in &mut faces {
                let mut interval = |first: i32, len: u32| {
                    let from = chance(len) as i32;
                    pair([first + from, first + (from + chance(most) as i32).min(len as i32 - 1)])
                };
                (face.columns, face.rows) = (interval(-5, 50), interval(-3, 36));
                face.depth_max = 0.49 + chance(30) as f32 / 1000.0;
            }
            let range = [chance(10) as i32 - 3, 33 - chance(10) as i32];
            let want = tiles.seen_one_by_one(&faces, range);
            for isa in Isa::available() {
                assert_eq!(tiles.seen(isa, &faces, range), want, "round {round}, {isa:?}");
            }
            found = [found[0] + want.count_ones(), found[1] + want.count_zeros() - 24];
        }
        assert!(found.iter().all(|&count| count > 3000), "{found:?}");
    }
}
