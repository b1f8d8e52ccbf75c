//! The farthest depth in each tile of 8 x 8 pixels, of the triangles that are drawn so far (stage visibility). A
//! sample without a triangle counts as infinitely far. A triangle behind a tile's farthest depth is hidden in the
//! whole tile, and if it is hidden in all tiles that it touches, it need not be drawn.

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, i32x4, i32x8, u32x8};

use super::samples::SampleBand;
use super::setups::transposed;
use crate::backend::cpu::bands::lists::{BoxedFace, unpair};
use crate::backend::cpu::isa::{Isa, LANES, with_simd};

/// Pixels along a tile's side.
const TILE: usize = 1 << TILE_SHIFT;

/// Its binary logarithm.
const TILE_SHIFT: u32 = 3;

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
    pub fn seen(&self, isa: Isa, faces: &[BoxedFace], rows: [i32; 2]) -> u32 {
        let at_once =
            faces.first_chunk().and_then(|faces| with_simd!(isa, simd => self.seen_at_once(simd, faces, rows)));
        match at_once {
            Some(seen) => seen,
            None => self.seen_one_by_one(faces, rows),
        }
    }

    /// None if one of the faces touches more than two tiles along an axis.
    #[inline(always)]
    fn seen_at_once<V: Simd>(&self, simd: V, faces: &[BoxedFace; LANES], [from, to]: [i32; 2]) -> Option<u32> {
        let mut of_faces = [[i32x4::splat(simd, 0); 4]; 2];
        for l in 0..LANES {
            of_faces[l / 4][l % 4] = i32x4::simd_from(simd, *bytemuck::must_cast_ref::<_, [i32; 4]>(&faces[l]));
        }
        let [_, columns, rows, depth_max] = transposed(of_faces);
        let (top, bottom) = (((rows << 16) >> 16).max(from), (rows >> 16).min(to - 1));
        let is_empty = top.simd_gt(bottom);
        let (left, right) = (self.tile_of((columns << 16) >> 16, 0), self.tile_of(columns >> 16, 0));
        let (top, bottom) = (self.tile_of(top, 1), self.tile_of(bottom, 1));
        let is_large = (right - left).simd_gt(1) | (bottom - top).simd_gt(1);
        if (is_large & !is_empty).any_true() {
            return None;
        }
        let (top, bottom) = (top * self.columns as i32, bottom * self.columns as i32);
        let upper = self.depths_of(top + left)?.min(self.depths_of(top + right)?);
        let lower = self.depths_of(bottom + left)?.min(self.depths_of(bottom + right)?);
        let is_hidden = depth_max.bitcast::<f32x8<V>>().simd_lt(upper.min(lower));
        Some((!(is_empty | is_hidden)).to_bitmask() as u32)
    }

    /// The tiles in which columns (0) or rows (1) of pixels lie.
    #[inline(always)]
    fn tile_of<V: Simd>(&self, v: i32x8<V>, axis: usize) -> i32x8<V> {
        ((v - self.first[axis]).bitcast::<u32x8<V>>() >> TILE_SHIFT).bitcast()
    }

    /// The farthest depths in eight tiles; of those beyond the last, its depth.
    #[inline(always)]
    fn depths_of<V: Simd>(&self, tiles: i32x8<V>) -> Option<f32x8<V>> {
        let last = self.depth_min.len().checked_sub(1)? as u32;
        let simd = tiles.token();
        let tiles: [u32; LANES] = tiles.bitcast::<u32x8<V>>().min(last).into();
        let mut depths = [0.0; LANES];
        for l in 0..LANES {
            depths[l] = self.depth_min[tiles[l] as usize];
        }
        Some(f32x8::simd_from(simd, depths))
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
