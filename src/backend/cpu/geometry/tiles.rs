//! Stage visibility: the farthest depth in each tile of a band. A triangle behind that depth is hidden
//! in the whole tile.

use super::samples::SampleBand;
use crate::backend::cpu::isa::LANES;

/// Pixels along a tile's side.
const TILE: usize = 8;

/// The smallest depth (reversed: the farthest) of each tile of 8 x 8 pixels.
#[derive(Default)]
pub struct Tiles {
    columns: usize,
    /// First column and row that have samples.
    first: [i32; 2],
    depth_min: Vec<f32>,
}

impl Tiles {
    /// The tiles of a band, from the depths that it has now.
    #[inline(always)]
    pub fn new(band: &SampleBand) -> Self {
        let [columns, rows] = band.range();
        let count = |[from, to]: [i32; 2]| from.abs_diff(to).div_ceil(TILE as u32) as usize;
        let mut tiles = Self {
            columns: count(columns),
            first: [columns[0], rows[0]],
            depth_min: vec![f32::INFINITY; count(columns) * count(rows)],
        };
        let samples = TILE * band.samples as usize;
        for (y, row) in band.depth.chunks_exact(band.stride).take(band.rows as usize).enumerate() {
            let mins = &mut tiles.depth_min[y / TILE * tiles.columns..][..tiles.columns];
            // What lies beyond the last pixel has depth 0, so the last tile may count as empty.
            for (min, depths) in mins.iter_mut().zip(row.chunks(samples)) {
                *min = min.min(smallest(depths));
            }
        }
        tiles
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
}
