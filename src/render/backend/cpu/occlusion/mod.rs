//! The stage occlusion, which is screen-space ambient occlusion: it finds how much less light hollows get, from the
//! depths of the whole picture.
//!
//! `grid` keeps the depth of each pixel's first sample as a distance in pixels. `gather` adds up the light that
//! surfaces around a pixel block. `spread` smooths this by means over neighbours at about the same depth.

pub mod gather;
pub mod grid;
pub mod spread;

use self::gather::gather_rows;
use self::grid::Grid;
use self::spread::spread_rows;
use super::isa::{Isa, LANES};
use super::threads::map;
use crate::limits::Deadline;
use crate::plan::OcclusionPass;

/// Rows that a thread takes at a time.
const ROWS: usize = 16;

/// The light that each pixel goes without, in a picture whose depths are known.
#[derive(Default)]
pub struct Occlusion {
    /// Depths.
    pub grid: Grid,
    /// Results of single pixels, in the grid's layout: whole numbers of 1/255.
    gathered: Vec<f32>,
    /// The same, spread over neighbours, row by row.
    spread: Vec<u8>,
}

impl Occlusion {
    /// Memory for a picture, bytes.
    pub fn bytes(pass: &OcclusionPass, size_px: [u32; 2]) -> usize {
        let grid = Grid::len(pass, size_px);
        2 * grid * size_of::<f32>() + (size_px[0] * size_px[1]) as usize
    }

    /// Allocated memory, bytes.
    pub fn allocated(&self) -> usize {
        self.grid.bytes() + self.gathered.capacity() * size_of::<f32>() + self.spread.capacity()
    }

    /// Finds what each pixel goes without, in a picture of so many samples per pixel.
    pub fn find(
        &mut self,
        isa: Isa,
        samples: u32,
        pass: &OcclusionPass,
        deadline: &Deadline,
        pool: Option<&rayon::ThreadPool>,
    ) {
        let Self { grid, gathered, spread } = self;
        gathered.resize(grid.depths().len(), 0.0);
        spread.resize((grid.width_px * grid.height_px) as usize, 0);
        let grid = &*grid;
        let picture = grid.picture();
        let rows: Vec<_> = (0..).step_by(ROWS).zip(gathered[picture].chunks_mut(ROWS * grid.stride())).collect();
        let is_on = || deadline.check().is_ok();
        let gather = |(first, out): (u32, &mut [f32])| {
            if is_on() {
                gather_rows(isa, pass, grid, samples, first, out);
            }
        };
        map(pool, rows, gather);
        let gathered = &gathered[..];
        let rows = (0..).step_by(ROWS).zip(spread.chunks_mut(ROWS * grid.width_px as usize)).collect();
        map(pool, rows, |(first, out): (u32, &mut [u8])| {
            if is_on() {
                spread_rows(isa, pass, grid, gathered, first, out);
            }
        });
    }

    /// As [`Self::open_share`] for eight neighbours in a row. Returns a bit, from the lowest, for each that shows another
    /// surface: its share is not found here.
    #[inline(always)]
    pub fn open_shares(
        &self,
        pass: &OcclusionPass,
        [x, y]: [u32; 2],
        (z, own_z): (&[f32; LANES], &[f32; LANES]),
        open: &mut [f32; LANES],
    ) -> u32 {
        let shut = self.spread.get((y * self.grid.width_px + x) as usize..).and_then(|shut| shut.first_chunk());
        let shut: &[u8; LANES] = shut.unwrap_or(&[0; LANES]);
        let mut far = 0;
        for l in 0..LANES {
            open[l] = 1.0 - (pass.strength * (1.0 / 255.0)) * f32::from(shut[l]);
            let is_near = ((z[l] - own_z[l]).abs() <= pass.near_depth) & (own_z[l] > 0.0);
            far |= u32::from(!is_near) << l;
        }
        far
    }

    /// The share of light that reaches a surface of depth `z` in a pixel whose first sample has the
    /// depth `own_z`.
    #[inline(always)]
    pub fn open_share(&self, pass: &OcclusionPass, [x, y]: [u32; 2], z: f32, own_z: f32) -> f32 {
        let at = if (z - own_z).abs() <= pass.near_depth && own_z > 0.0 {
            [x, y]
        } else {
            match self.grid.nearest_neighbour(pass, [x, y], z) {
                Some(pixel) => pixel,
                None => return 1.0,
            }
        };
        let shut = self.spread[(at[1] * self.grid.width_px + at[0]) as usize];
        1.0 - (pass.strength * (1.0 / 255.0)) * f32::from(shut)
    }
}
