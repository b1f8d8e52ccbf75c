//! The depth of the farthest corner of all triangles that are visible in a pixel (stage lines). It counts as
//! infinitely far if a sample shows no triangle, or one that is clipped. An edge whose nearest point is farther away
//! than this in every pixel along it is hidden, and no triangle has to be tested.

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::backend::cpu::geometry::transform::ScreenVertex;

/// The least depth, per pixel of a band, of any corner of the triangles in its samples. A pixel's
/// depth is found when it is first asked for, because most are not.
#[derive(Default)]
pub struct Farthest {
    depths: Vec<f32>,
    /// First column and row.
    first: [i32; 2],
    columns: usize,
}

/// The depth of a pixel that was not asked for yet.
const UNKNOWN: f32 = f32::INFINITY;

/// The depth of a pixel in which something is missing: a triangle, or one of its corners on screen. It is farther than
/// any edge.
const MISSING: f32 = f32::NEG_INFINITY;

impl Farthest {
    /// Allocated bytes.
    pub fn bytes(&self) -> usize {
        self.depths.capacity() * size_of::<f32>()
    }

    /// Forgets all depths, and takes on the size of a band whose samples are filled.
    pub fn clear(&mut self, band: &SampleBand) {
        let [columns, rows] = band.range();
        self.first = [columns[0], rows[0]];
        self.columns = columns[0].abs_diff(columns[1]) as usize;
        self.depths.clear();
        self.depths.resize(self.columns * rows[0].abs_diff(rows[1]) as usize, UNKNOWN);
    }

    /// The depth of a pixel of the band.
    #[inline(always)]
    pub fn at(&mut self, (context, band): (&RasterContext<'_>, &SampleBand), [x, y]: [i32; 2]) -> f32 {
        let at = (y - self.first[1]) as usize * self.columns + (x - self.first[0]) as usize;
        let depth = &mut self.depths[at];
        if *depth == UNKNOWN {
            *depth = of_pixel(context, band.pixel(x, y).0);
        }
        *depth
    }
}

fn of_pixel(context: &RasterContext<'_>, ids: &[u32]) -> f32 {
    let mut last = (NOTHING, MISSING);
    let mut depth = UNKNOWN;
    for &id in ids {
        if id == NOTHING {
            return MISSING;
        }
        if id != last.0 {
            last = (id, of_triangle(context, id));
        }
        depth = depth.min(last.1);
    }
    depth
}

#[inline(always)]
fn of_triangle(context: &RasterContext<'_>, id: u32) -> f32 {
    let corners = &context.screen_triangle(id);
    if corners.iter().any(ScreenVertex::is_outside) {
        return MISSING;
    }
    let [a, b, c] = corners;
    a.z.min(b.z).min(c.z)
}
