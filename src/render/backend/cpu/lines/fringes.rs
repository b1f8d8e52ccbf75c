//! Fringes: what lines along all edges of a mesh cover inside its faces, seen or hidden (stage lines). Twin of
//! `shaders/lines/fringes.wgsl`.
//!
//! The fringe of a face is the part of it that is less than half a line's width from one of its sides. If all edges
//! are lines, they cover the fringes of all faces, and beyond these only what lies beside rims, the edges at which the
//! surface ends on screen or turns back (docs/rasterizer.md, "Hidden parts that fade", says why). So the points of
//! fringes and the strokes of rims are what the lines cover, and most edges need no stroke. It does not matter what
//! hides what.
//!
//! Wide faces have no fringes, because few of their pixels would be in them, and neither have clipped faces and those
//! seen edge-on. All of their sides get strokes.

use super::holes::dig::padded;
use super::holes::half_width;
use super::holes::inset::{Inset, Insets};
use super::stroke::{LATTICE, Mask, POINTS, PerPoint, WORDS, place, places_kernel, push};
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::setups::Corners;
use crate::backend::cpu::geometry::transform::round_to_i32;
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::backend::cpu::lines::coverage::BandStrokes;
use crate::plan::LinePass;

/// Steps to the pixel in which distances from sides are measured.
pub const FRINGE_UNIT: f32 = 4096.0;

/// Largest distance of a pixel's centre from a side that is told apart, pixels. The points of a pixel that is farther are
/// farther than half the width of any line that has fringes.
pub const FRINGE_FAR_PX: f32 = 5.0;

/// A pixel is passed over only if its points are this much too far from a side, [`FRINGE_UNIT`]s: more than rounding.
pub const FRINGE_SLACK: i32 = 32;

/// Greatest width and height of a face with a fringe, 1/256 px.
pub const FRINGED_MAX: i32 = 16 * 256;

dispatch! {
    /// Adds the points of the fringes of a band's faces.
    pub fn add_fringes(
        context: &RasterContext<'_>,
        pass: &LinePass,
        lists: (&[TriangleBin], usize),
        band: &SampleBand,
        strokes: &mut BandStrokes,
    ) = fringes_kernel
}

/// As `add_fringes`, each point by itself.
pub fn add_fringes_plainly(
    context: &RasterContext<'_>,
    pass: &LinePass,
    (bins, number): (&[TriangleBin], usize),
    band: &SampleBand,
    strokes: &mut BandStrokes,
) {
    let fringes = Fringes::new(context, pass, band);
    for id in bins.iter().flat_map(|bin| bin.whole_in(number)).filter(|&id| (id as usize) < fringes.faces) {
        let insets = Insets::new(&Corners::load(context, &[id; LANES]), fringes.half, fringes.half_width);
        let inset = insets.get(0, fringes.half);
        let Some([columns, rows]) = fringes.pixels_of(&inset) else { continue };
        let normals = normals_of(&inset);
        for (y, x) in (rows[0]..=rows[1]).flat_map(|y| (columns[0]..=columns[1]).map(move |x| (y, x))) {
            let center = fringes.center_of([x, y]);
            let offsets: [i16; 3] = std::array::from_fn(|k| offset_of(inset.distance(k, center)) as i16);
            let mut mask = Mask::default();
            for (j, l) in (0..POINTS as usize).map(|point| (point / WORDS, point % WORDS)) {
                let at = |k: usize| place(normals[k], [LATTICE[0][j][l], LATTICE[1][j][l]]) + offsets[k];
                let least = at(0).min(at(1)).min(at(2));
                mask[l] |= u16::from(least >= 0 && least < fringes.limit) << (15 - j);
            }
            strokes.add_points(fringes.index([x, y]), &mask);
        }
    }
}

#[inline(always)]
fn fringes_kernel(
    context: &RasterContext<'_>,
    pass: &LinePass,
    (bins, number): (&[TriangleBin], usize),
    band: &SampleBand,
    strokes: &mut BandStrokes,
) {
    let mut fringes = Fringes::new(context, pass, band);
    let mut poll = DeadlinePoll::new(context.deadline);
    for lists in bins.iter().flat_map(|bin| [&bin.fronts, &bin.backs]) {
        let (listed, tall) = lists.items_in(number);
        for faces in listed.chunks(LANES).chain(tall.chunks(LANES)) {
            // The outline mesh's ids follow the surface's, in chunks of their own.
            if faces.iter().any(|&id| id as usize >= fringes.faces) {
                continue;
            }
            let insets = Insets::of(context, &padded(faces), fringes.half, fringes.half_width);
            for l in 0..faces.len() {
                fringes.add(&insets.get(l, fringes.half), strokes);
            }
            if poll.is_expired_after(faces.len() as u64, std::mem::take(&mut fringes.pixels)) {
                return;
            }
        }
    }
}

/// Adds the fringes of faces to the pixels of a band.
struct Fringes {
    half: [i32; 2],
    half_width: f32,
    /// Half the lines' width, [`FRINGE_UNIT`]s.
    limit: i16,
    /// Number of the surface's faces.
    faces: usize,
    width_px: i32,
    /// Rows that are shown.
    rows: [i32; 2],
    /// Of each side of a face, the places of all points along the normal.
    places: [PerPoint; 3],
    /// Pixels looked at since the last poll of the deadline.
    pixels: u64,
}

impl Fringes {
    fn new(context: &RasterContext<'_>, pass: &LinePass, band: &SampleBand) -> Self {
        let half_width = half_width(pass);
        Self {
            half: [context.plan.width_px as i32 * 128, context.plan.height_px as i32 * 128],
            half_width,
            limit: round_to_i32(half_width * (FRINGE_UNIT / 256.0)) as i16,
            faces: context.plan.triangles.len(),
            width_px: band.size_px[0] as i32,
            rows: band.shown.map(|row| row as i32),
            places: [[[0; WORDS]; WORDS]; 3],
            pixels: 0,
        }
    }

    /// First and last column, and row, of the band's pixels in the box around a face; None if there are none, or the face
    /// is wide.
    #[inline(always)]
    fn pixels_of(&self, inset: &Inset) -> Option<[[i32; 2]; 2]> {
        let ends = [[0, self.width_px], self.rows];
        let is_wide = inset.bounds.iter().any(|[low, high]| high - low > FRINGED_MAX);
        let pixels = |k: usize| {
            let [low, high] = inset.bounds[k];
            [(low >> 8).max(ends[k][0]), ((high - 1) >> 8).min(ends[k][1] - 1)]
        };
        let [columns, rows] = [pixels(0), pixels(1)];
        (!is_wide && columns[0] <= columns[1] && rows[0] <= rows[1]).then_some([columns, rows])
    }

    /// The centre of a pixel, 1/256 px from the picture's.
    #[inline(always)]
    fn center_of(&self, [x, y]: [i32; 2]) -> [f32; 2] {
        [(x * 256 + 128 - self.half[0]) as f32, (y * 256 + 128 - self.half[1]) as f32]
    }

    /// The index of a shown pixel.
    #[inline(always)]
    fn index(&self, [x, y]: [i32; 2]) -> usize {
        (y - self.rows[0]) as usize * self.width_px as usize + x as usize
    }

    /// Adds the fringe of a face.
    #[inline(always)]
    fn add(&mut self, inset: &Inset, strokes: &mut BandStrokes) {
        let Some([columns, rows]) = self.pixels_of(inset) else { return };
        self.pixels += u64::from((columns[0].abs_diff(columns[1]) + 1) * (rows[0].abs_diff(rows[1]) + 1));
        for (normal, places) in normals_of(inset).into_iter().zip(&mut self.places) {
            places_kernel(normal, places);
        }
        let extents: [i32; 3] = std::array::from_fn(|k| {
            let [right, down] = inset.normal(k);
            round_to_i32((0.5 * FRINGE_UNIT) * (right.abs() + down.abs())) + FRINGE_SLACK
        });
        for y in rows[0]..=rows[1] {
            for first in (columns[0]..=columns[1]).step_by(LANES) {
                let [x, y_at] = self.center_of([first, y]);
                let mut offsets = [[0_i32; LANES]; 3];
                let (mut inside, mut beside) = ([u32::MAX; LANES], [0_u32; LANES]);
                for k in 0..3 {
                    for l in 0..LANES {
                        let offset = offset_of(inset.distance(k, [x + 256.0 * l as f32, y_at]));
                        offsets[k][l] = offset;
                        inside[l] &= 0_u32.wrapping_sub(u32::from(offset > -extents[k]));
                        beside[l] |= 0_u32.wrapping_sub(u32::from(offset < i32::from(self.limit) + extents[k]));
                    }
                }
                let mut touched = 0;
                for l in 0..LANES {
                    touched |= (inside[l] & beside[l] & 1) << l;
                }
                touched &= (2 << (columns[1] - first).min(LANES as i32 - 1)) - 1;
                while touched != 0 {
                    let l = touched.trailing_zeros() as usize % LANES;
                    touched &= touched - 1;
                    let mask = self.mask([0, 1, 2].map(|k| offsets[k][l] as i16));
                    strokes.add_points(self.index([first + l as i32, y]), &mask);
                }
            }
        }
    }

    /// The points of a pixel in a fringe, given what its centre's distances from the sides add to their places.
    #[inline(always)]
    fn mask(&self, offsets: [i16; 3]) -> Mask {
        let [a, b, c] = &self.places;
        // Moved so far that what is below 0 wraps around to above all else: then one comparison finds what is outside.
        let last = (self.limit - 1).wrapping_add(i16::MIN);
        let mut outside = [0_u16; WORDS];
        for j in 0..WORDS {
            for l in 0..WORDS {
                let at = |places: &PerPoint, k: usize| places[j][l].wrapping_add(offsets[k]);
                let least = at(a, 0).min(at(b, 1)).min(at(c, 2));
                push(&mut outside[l], least.wrapping_add(i16::MIN) > last);
            }
        }
        outside.map(|word| !word)
    }
}

/// The unit vectors inwards from a face's sides, [`FRINGE_UNIT`]s.
#[inline(always)]
fn normals_of(inset: &Inset) -> [[i16; 2]; 3] {
    std::array::from_fn(|k| inset.normal(k).map(|v| round_to_i32(v * FRINGE_UNIT) as i16))
}

/// A distance from a side, in 1/256 px, in [`FRINGE_UNIT`]s.
#[inline(always)]
fn offset_of(distance: f32) -> i32 {
    const FAR: f32 = FRINGE_FAR_PX * FRINGE_UNIT;
    round_to_i32((distance * (FRINGE_UNIT / 256.0)).clamp(-FAR, FAR))
}
