//! The coverage points (256 per pixel) that lines leave free, in most of the pixels in which a sum
//! of areas does not tell how much is free (stage lines). Twin of
//! `shaders/lines/holes/free_points.wgsl`.
//!
//! If all edges of a surface are lines, each face is free only in its inset, the part that is at
//! least half a line's width from all its sides. Areas of insets do not tell how much is free where
//! a surface ends, because some of a face may be hidden. Points do: each of a pixel's points
//! belongs to a [sample](crate::backend::sample_partition). It is free if that sample shows
//! nothing, or if the point lies in the inset of the face that the sample shows. Lines of rims, the
//! edges at which the surface ends on screen or turns away, are drawn one by one; they cover the
//! free points that they touch.
//!
//! This is exact for a point that is farther from all rims than half a line's width: if the point
//! is free, the disc of that radius around it shows one face, or nothing, and contains the point's
//! sample. Points that are nearer are covered by the rim's own line. For a few points the sample is
//! a little farther away (docs/rasterizer.md, "Holes").

use super::inset::{Inset, Insets};
use super::{Holes, half_width};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::backend::cpu::geometry::setups::Corners;
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::backend::cpu::lines::coverage::{BandStrokes, points_of_sample};
use crate::backend::cpu::lines::stroke::{
    Amount, HalfPlane, Mask, POINTS, WORDS, count, is_point_within, points_within, units, units_of,
};
use crate::plan::LinePass;

dispatch! {
    /// Adds what lines cover of each marked pixel, by points.
    pub fn add_points(
        context: &RasterContext<'_>,
        pass: &LinePass,
        band: &SampleBand,
        holes: &Holes,
        target: (&mut BandStrokes, &mut [u32]),
    ) = points_kernel
}

/// As `add_points`, each point by itself.
pub fn add_points_plainly(
    context: &RasterContext<'_>,
    pass: &LinePass,
    band: &SampleBand,
    holes: &Holes,
    target: (&mut BandStrokes, &mut [u32]),
) {
    let test = PointTest::new(context, pass, band);
    let mut covered = Covered { pixel: [0; 2], mask: Mask::default(), holes, target };
    for [x, y] in holes.marked() {
        let ids = band.pixel(x, y).0;
        let mut mask = Mask::default();
        for (&id, cell) in ids.iter().zip(&test.cells).filter(|&(&id, _)| id != NOTHING) {
            let insets = Insets::new(&Corners::load(context, &[id; LANES]), test.half, test.half_width);
            let sides = test.sides(&insets.get(0, test.half), [x, y]);
            for point in 0..POINTS as usize {
                let is_free = insets.is_open[0] != 0 && sides.iter().all(|side| is_point_within(side, point));
                let bit = 0x8000 >> (point / WORDS);
                mask[point % WORDS] |= if is_free { 0 } else { cell[point % WORDS] & bit };
            }
        }
        covered.add([x, y], &mask);
    }
    covered.finish();
}

#[inline(always)]
fn points_kernel(
    context: &RasterContext<'_>,
    pass: &LinePass,
    band: &SampleBand,
    holes: &Holes,
    target: (&mut BandStrokes, &mut [u32]),
) {
    let test = PointTest::new(context, pass, band);
    let mut poll = DeadlinePoll::new(context.deadline);
    let mut waiting = Waiting { ids: [0; LANES], pixels: [[0; 2]; LANES], len: 0 };
    let mut covered = Covered { pixel: [0; 2], mask: Mask::default(), holes, target };
    for pixel in holes.marked() {
        let ids = band.pixel(pixel[0], pixel[1]).0;
        for (s, &id) in ids.iter().enumerate() {
            if id == NOTHING || ids[..s].contains(&id) {
                continue;
            }
            waiting.push(id, pixel);
            if waiting.len == LANES {
                waiting.add_covered(context, band, &test, &mut covered);
            }
        }
        if poll.is_expired(u64::from(POINTS)) {
            return;
        }
    }
    waiting.add_covered(context, band, &test, &mut covered);
    covered.finish();
}

/// Faces that pixels show, which wait until there are eight. Those of a pixel follow each other.
struct Waiting {
    ids: [u32; LANES],
    pixels: [[i32; 2]; LANES],
    len: usize,
}

impl Waiting {
    #[inline(always)]
    fn push(&mut self, id: u32, pixel: [i32; 2]) {
        (self.ids[self.len], self.pixels[self.len]) = (id, pixel);
        self.len += 1;
    }

    /// Adds the points of the faces' samples that are not free.
    #[inline(always)]
    fn add_covered(
        &mut self,
        context: &RasterContext<'_>,
        band: &SampleBand,
        test: &PointTest,
        covered: &mut Covered<'_>,
    ) {
        if self.len == 0 {
            return;
        }
        // Those after `len` are of the mesh, too: it has the first triangle if it has any.
        let insets = Insets::of(context, &self.ids, test.half, test.half_width);
        for l in 0..std::mem::take(&mut self.len) {
            let [x, y] = self.pixels[l];
            let mut cell = test.cell_of(band.pixel(x, y).0, self.ids[l]);
            if insets.is_open[l] != 0 {
                let free = points_within(&test.sides(&insets.get(l, test.half), [x, y]));
                for w in 0..WORDS {
                    cell[w] &= !free[w];
                }
            }
            covered.add([x, y], &cell);
        }
    }
}

/// The covered points of the pixel whose faces are looked at.
struct Covered<'a> {
    pixel: [i32; 2],
    mask: Mask,
    holes: &'a Holes,
    target: (&'a mut BandStrokes, &'a mut [u32]),
}

impl Covered<'_> {
    #[inline(always)]
    fn add(&mut self, pixel: [i32; 2], mask: &Mask) {
        if pixel != self.pixel {
            self.finish();
            self.pixel = pixel;
        }
        for w in 0..WORDS {
            self.mask[w] |= mask[w];
        }
    }

    /// Adds the points to the strokes of the pixel.
    #[inline(always)]
    fn finish(&mut self) {
        let mask = std::mem::take(&mut self.mask);
        let points = count(&mask);
        let Some(at) = self.holes.index(self.pixel).filter(|_| points > 0) else { return };
        // Only lines without a ramp have holes.
        let (strokes, owners) = &mut self.target;
        strokes.add(at, Amount { area: points as f32 * (1.0 / POINTS as f32), points }, &mask, 1.0);
        if let Some(owner) = owners.get_mut(at) {
            // The light is that of the samples; any face will do.
            *owner = (*owner).max(1);
        }
    }
}

/// The samples' points and the lines' width, the same for all pixels of a band.
struct PointTest {
    half: [i32; 2],
    half_width: f32,
    /// Per sample, the points that are assigned to it.
    cells: Vec<Mask>,
}

impl PointTest {
    fn new(context: &RasterContext<'_>, pass: &LinePass, band: &SampleBand) -> Self {
        let plan = context.plan;
        Self {
            half: [plan.width_px as i32 * 128, plan.height_px as i32 * 128],
            half_width: half_width(pass),
            cells: (0..band.samples).map(|s| points_of_sample(band.samples, s)).collect(),
        }
    }

    /// The points of the samples that show a face.
    #[inline(always)]
    fn cell_of(&self, ids: &[u32], id: u32) -> Mask {
        let mut all = Mask::default();
        for (cell, &seen) in self.cells.iter().zip(ids) {
            let is_own = 0_u16.wrapping_sub(u16::from(seen == id));
            for w in 0..WORDS {
                all[w] |= cell[w] & is_own;
            }
        }
        all
    }

    /// The sides of an inset, as the points of a pixel are compared with them.
    #[inline(always)]
    fn sides(&self, inset: &Inset, [x, y]: [i32; 2]) -> [HalfPlane; 3] {
        let center = [(x * 256 - self.half[0] + 128) as f32, (y * 256 - self.half[1] + 128) as f32];
        let mut sides = [HalfPlane::default(); 3];
        for k in 0..3 {
            let least = (self.half_width - inset.distance(k, center)) * (1.0 / 256.0);
            sides[k] = HalfPlane { normal: units_of(inset.normal(k)), least: units(least) };
        }
        sides
    }
}
