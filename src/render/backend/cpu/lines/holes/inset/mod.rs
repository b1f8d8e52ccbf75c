//! The inset of a face, which is the part of it that the lines along its sides leave free, and the inset's area in a
//! pixel (stage lines). Twin of `shaders/lines/holes/inset.wgsl`.
//!
//! A face's inset is what lies at least half a line's width from its three sides. It is the triangle scaled about its
//! incentre by `(r - w/2) / r`, r being the radius of the inscribed circle and w the line's width, and is empty where
//! r is not larger than w/2.

#[cfg(target_arch = "x86_64")]
mod avx2;

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::setups::Corners;
use crate::backend::cpu::geometry::transform::{recip, rsqrt};
use crate::backend::cpu::isa::{Isa, LANES};

/// Steps to the pixel of a hole's area.
pub const HOLE_UNIT: f32 = 65_536.0;

/// Distance from a face's sides from which a sample counts as inside, 1/256 px. Closer to a side,
/// rounding decides which face it shows.
pub const INSIDE: f32 = 16.0;

/// Sides of an inset that are narrower than this add no area, pixels.
pub const NARROW_PX: f32 = 1e-4;

/// Sides that rise less than this within a pixel count as straight there, pixels.
pub const LEVEL_PX: f32 = 1.0 / 1024.0;

/// Faces up to this width and height, 1/256 px, are small: outside of [`Inset::open_pixels`] their areas
/// are 0. Corners are rounded to 2^-21 px there, and sides that are not narrow rise at most 7 / 1e-4, so
/// that a side is nowhere more than .04 px too high or too low. In a pixel that is farther from it, what the
/// sides add cancels out, up to far less than half of a [`HOLE_UNIT`].
pub const SMALL: i32 = 7 * 256;

/// Most columns, and rows, of pixels that a small face touches.
pub const SMALL_PIXELS: usize = SMALL as usize / 256 + 1;

/// Eight faces' insets, still in lanes.
#[derive(Debug, PartialEq)]
pub struct Insets {
    corners: [[[i32; LANES]; 2]; 3],
    /// Per side, from corner k to the next, the unit vector along it, turned so that the inside lies on
    /// the same hand for all faces.
    units: [[[f32; LANES]; 2]; 3],
    /// Corners of the insets, pixels from the corner of the pixel that corner 0 lies in.
    insets: [[[f32; LANES]; 2]; 3],
    slopes: [[f32; LANES]; 3],
    turn: [f32; LANES],
    /// 1 where there is an inset.
    pub is_open: [u32; LANES],
}

/// A face's inset.
pub struct Inset {
    /// Pixel of the first corner.
    base: [i32; 2],
    sides: [InsetSide; 3],
    /// 1 or -1: the hand of the face.
    turn: f32,
    /// Least and greatest coordinates of the face, 1/256 px from the picture's corner.
    pub bounds: [[i32; 2]; 2],
}

/// A side of a face and of its inset.
#[derive(Clone, Copy, Default)]
struct InsetSide {
    /// The face's corner at its start, 1/256 px from the picture's centre.
    corner: [f32; 2],
    unit: [f32; 2],
    /// Ends of the inset's side, pixels from the base.
    ends: [[f32; 2]; 2],
    slope: f32,
}

impl Insets {
    /// No insets, and room for eight.
    #[cfg(target_arch = "x86_64")]
    const EMPTY: Self = Self {
        corners: [[[0; LANES]; 2]; 3],
        units: [[[0.0; LANES]; 2]; 3],
        insets: [[[0.0; LANES]; 2]; 3],
        slopes: [[0.0; LANES]; 3],
        turn: [0.0; LANES],
        is_open: [0; LANES],
    };

    /// The insets of faces by id, see [`new`](Self::new).
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn of(context: &RasterContext<'_>, ids: &[u32; LANES], half: [i32; 2], half_width: f32) -> Self {
        #[cfg(target_arch = "x86_64")]
        if context.isa.has_avx2() {
            // SAFETY: the processor has AVX2, as `isa` says.
            return unsafe { avx2::insets(context, ids, half, half_width) };
        }
        Self::new(&Corners::load(context, ids), half, half_width)
    }

    /// The insets of faces under lines whose half width is `half_width`; `half` is half the picture's size. All in
    /// 1/256 px.
    #[inline(always)]
    pub fn new(faces: &Corners, half: [i32; 2], half_width: f32) -> Self {
        let corners: [[[i32; LANES]; 2]; 3] = std::array::from_fn(|k| [faces.x[k], faces.y[k]]);
        let zero = [0.0; LANES];
        let (mut units, mut insets, mut slopes) = ([[zero; 2]; 3], [[zero; 2]; 3], [zero; 3]);
        let (mut turn, mut is_open) = (zero, [0; LANES]);
        for l in 0..LANES {
            // Vectors along the sides; the coordinates' differences are exact.
            let mut along = [[0.0_f32; 2]; 3];
            let (mut length, mut inverse) = ([0.0_f32; 3], [0.0_f32; 3]);
            for k in 0..3 {
                for axis in 0..2 {
                    along[k][axis] = corners[(k + 1) % 3][axis][l].wrapping_sub(corners[k][axis][l]) as f32;
                }
                // A side without length, of a face without area, may have any direction.
                let squared = (along[k][0] * along[k][0] + along[k][1] * along[k][1]).max(1.0);
                inverse[k] = rsqrt(squared);
                length[k] = squared * inverse[k];
            }
            let area = along[0][0] * along[1][1] - along[0][1] * along[1][0];
            let inverse_around = recip((length[0] + length[1]) + length[2]);
            let radius = area.abs() * inverse_around;
            let is_clear = radius > half_width;
            is_open[l] = u32::from(is_clear);
            turn[l] = if area < 0.0 { -1.0 } else { 1.0 };
            let share = 1.0 - half_width * recip(if is_clear { radius } else { 1.0 });
            for axis in 0..2 {
                // From the first corner. The weight of a corner is the length of the side facing it.
                let (to_second, to_third) = (along[0][axis], -along[2][axis]);
                let centre = (length[2] * to_second + length[0] * to_third) * inverse_around;
                let corner = corners[0][axis][l].wrapping_add(half[axis]) & 255;
                for (k, from_first) in [0.0, to_second, to_third].into_iter().enumerate() {
                    let at = centre + (from_first - centre) * share;
                    insets[k][axis][l] = (at + corner as f32) * (1.0 / 256.0);
                }
            }
            for k in 0..3 {
                for axis in 0..2 {
                    units[k][axis][l] = along[k][axis] * (inverse[k] * turn[l]);
                }
                let next = (k + 1) % 3;
                let (right, down) = (insets[next][0][l] - insets[k][0][l], insets[next][1][l] - insets[k][1][l]);
                let is_narrow = right.abs() < NARROW_PX;
                let inverse = recip(if is_narrow { 1.0 } else { right.abs() });
                let slope = if right < 0.0 { -(down * inverse) } else { down * inverse };
                slopes[k][l] = if is_narrow { 0.0 } else { slope };
            }
        }
        Self { corners, units, insets, slopes, turn, is_open }
    }

    /// Face l's.
    #[inline(always)]
    pub fn get(&self, l: usize, half: [i32; 2]) -> Inset {
        let corner = |k: usize| [self.corners[k][0][l], self.corners[k][1][l]];
        let [a, b, c] = [corner(0), corner(1), corner(2)];
        let end = |k: usize| [self.insets[k][0][l], self.insets[k][1][l]];
        let side = |k: usize| InsetSide {
            corner: corner(k).map(|v| v as f32),
            unit: [self.units[k][0][l], self.units[k][1][l]],
            ends: [end(k), end((k + 1) % 3)],
            slope: self.slopes[k][l],
        };
        let place = |v: i32, axis: usize| v + half[axis];
        Inset {
            base: [place(a[0], 0) >> 8, place(a[1], 1) >> 8],
            sides: [side(0), side(1), side(2)],
            turn: self.turn[l],
            bounds: std::array::from_fn(|axis| {
                let (low, high) = (a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis]));
                [place(low, axis), place(high, axis)]
            }),
        }
    }
}

impl Inset {
    /// True if a sample, in 1/256 px from the picture's centre, lies well inside the face.
    #[inline(always)]
    pub fn contains(&self, [x, y]: [f32; 2]) -> bool {
        let mut is_inside = true;
        for k in 0..3 {
            is_inside &= self.distance(k, [x, y]) >= INSIDE;
        }
        is_inside
    }

    /// The unit vector that points inwards from side k.
    #[inline(always)]
    pub fn normal(&self, k: usize) -> [f32; 2] {
        let [right, down] = self.sides[k].unit;
        [-down, right]
    }

    /// Distance of a point, both in 1/256 px from the picture's centre, inwards from side k of the
    /// face.
    #[inline(always)]
    pub fn distance(&self, k: usize, [x, y]: [f32; 2]) -> f32 {
        let side = &self.sides[k];
        side.unit[0] * (y - side.corner[1]) - side.unit[1] * (x - side.corner[0])
    }

    /// The face's corner at the start of each side, 1/256 px from the picture's centre, and the unit
    /// vector along the side, as [`distance`](Self::distance) takes them.
    #[inline(always)]
    pub fn sides_of_face(&self) -> [([f32; 2], [f32; 2]); 3] {
        self.sides.map(|side| (side.corner, side.unit))
    }

    /// True if the face is at most [`SMALL`] wide and high.
    #[inline(always)]
    pub fn is_small(&self) -> bool {
        self.bounds.iter().all(|[low, high]| high - low <= SMALL)
    }

    /// First and last column, and row, of the pixels in which a small face's inset has an area.
    #[inline(always)]
    pub fn open_pixels(&self) -> [[i32; 2]; 2] {
        let [a, b, c] = [self.sides[0].ends[0], self.sides[1].ends[0], self.sides[2].ends[0]];
        // More than a side may be too high or too low.
        const SLACK: f32 = 1.0 / 16.0;
        // Rounds towards zero, so numbers are made positive for it.
        const POSITIVE: i32 = 16;
        let pixel = |v: f32| (v + POSITIVE as f32) as i32 - POSITIVE;
        std::array::from_fn(|k| {
            let (low, high) = (a[k].min(b[k]).min(c[k]) - SLACK, a[k].max(b[k]).max(c[k]) + SLACK);
            [self.base[k] + pixel(low), self.base[k] + pixel(high)]
        })
    }

    /// Area of the inset in each of eight pixels of row `y`, from column `first` on.
    #[inline(always)]
    pub fn areas(&self, isa: Isa, first: i32, y: i32) -> [u32; LANES] {
        let (left, top) = ((first - self.base[0]) as f32, (y - self.base[1]) as f32);
        let mut lefts = [left; LANES];
        for l in 0..LANES {
            lefts[l] += l as f32;
        }
        self.areas_at(isa, &lefts, &[top; LANES])
    }

    /// Area of the inset in each of four pixels of row `y`, from column `first` on, and in the four below
    /// them.
    #[inline(always)]
    pub fn areas_in_two_rows(&self, isa: Isa, first: i32, y: i32) -> [u32; LANES] {
        let (left, top) = ((first - self.base[0]) as f32, (y - self.base[1]) as f32);
        let (mut lefts, mut tops) = ([left; LANES], [top; LANES]);
        for l in 0..LANES {
            lefts[l] += (l % 4) as f32;
            tops[l] += (l / 4) as f32;
        }
        self.areas_at(isa, &lefts, &tops)
    }

    /// Area of the inset in each of eight pixels, given the places of their upper left corners, in pixels
    /// from the base.
    #[inline(always)]
    #[allow(unsafe_code)]
    fn areas_at(&self, isa: Isa, lefts: &[f32; LANES], tops: &[f32; LANES]) -> [u32; LANES] {
        #[cfg(target_arch = "x86_64")]
        if isa.has_avx2() {
            // SAFETY: the processor has AVX2, as `isa` says.
            return unsafe { avx2::areas(self, lefts, tops) };
        }
        let _ = isa;
        self.areas_plainly(lefts, tops)
    }

    /// The area of a polygon in the unit square is the sum, over its sides, of the signed area that
    /// lies inside the square between the side and the square's upper border.
    #[inline(always)]
    fn areas_plainly(&self, lefts: &[f32; LANES], tops: &[f32; LANES]) -> [u32; LANES] {
        let mut areas = [0.0_f32; LANES];
        for side in &self.sides {
            let [[x0, y0], [x1, _]] = side.ends;
            for l in 0..LANES {
                let y0 = y0 - tops[l];
                let start = x0 - lefts[l];
                let (from, to) = (clamp(start), clamp(x1 - lefts[l]));
                let width = to - from;
                let (high, low) = (y0 + (from - start) * side.slope, y0 + (to - start) * side.slope);
                areas[l] -= width * mean_clamped(high, low);
            }
        }
        let mut units = [0; LANES];
        for l in 0..LANES {
            units[l] = (clamp(areas[l] * self.turn) * HOLE_UNIT + 0.5) as i32 as u32;
        }
        units
    }
}

#[inline(always)]
fn clamp(v: f32) -> f32 {
    v.clamp(0.0, 1.0)
}

/// Mean of what grows evenly from `a` to `b`, clamped to 0 to 1.
#[inline(always)]
fn mean_clamped(a: f32, b: f32) -> f32 {
    let (low, high) = (clamp(a), clamp(b));
    // An integral of the clamped function.
    let integral = |v: f32, clamped: f32| 0.5 * clamped * clamped + (v - 1.0).max(0.0);
    let rise = b - a;
    let mean = (integral(b, high) - integral(a, low)) / rise;
    let middle = 0.5 * (low + high);
    // Between the clamped ends, however the difference of the integrals was rounded.
    let mean = mean.max(low.min(high)).min(low.max(high));
    if rise.abs() > LEVEL_PX { mean } else { middle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::CpuRenderer;
    use crate::backend::cpu::stopwatch::Stopwatch;
    use crate::limits::Deadline;
    use crate::plan::{DrawPlan, Projection};

    const HALF: [i32; 2] = [64 * 128; 2];

    /// xorshift64
    fn random(state: &mut u64, below: i32) -> i32 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        ((*state >> 33) % below as u64) as i32
    }

    fn inset_of(corners: [[i32; 2]; 3], width_px: f32) -> Option<Inset> {
        let lanes = |axis: usize| std::array::from_fn(|k| [corners[k][axis]; LANES]);
        let insets = Insets::new(&Corners { x: lanes(0), y: lanes(1) }, HALF, width_px * 128.0);
        (insets.is_open[5] != 0).then(|| insets.get(5, HALF))
    }

    /// Keeps what of a polygon lies where `distance` is not negative.
    fn clip(polygon: &[[f64; 2]], distance: impl Fn([f64; 2]) -> f64) -> Vec<[f64; 2]> {
        let mut kept = Vec::new();
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (at_p, at_q) = (distance(p), distance(q));
            if at_p >= 0.0 {
                kept.push(p);
            }
            if (at_p >= 0.0) != (at_q >= 0.0) {
                let t = at_p / (at_p - at_q);
                kept.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
            }
        }
        kept
    }

    /// Area of a pixel that lies at least half the width inside of all sides.
    fn truth(corners: [[i32; 2]; 3], width_px: f64, [x, y]: [i32; 2]) -> f64 {
        let px = corners.map(|c| std::array::from_fn(|k| f64::from(c[k] + HALF[k]) / 256.0));
        let [a, b, c]: [[f64; 2]; 3] = px;
        let turn = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).signum();
        let (x, y) = (f64::from(x), f64::from(y));
        let mut rest = vec![[x, y], [x + 1.0, y], [x + 1.0, y + 1.0], [x, y + 1.0]];
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let way = [q[0] - p[0], q[1] - p[1]];
            let length = way[0].hypot(way[1]);
            rest = clip(&rest, |v| turn * (way[0] * (v[1] - p[1]) - way[1] * (v[0] - p[0])) / length - 0.5 * width_px);
        }
        let twice = |i: usize| {
            let (p, q) = (rest[i], rest[(i + 1) % rest.len()]);
            p[0] * q[1] - p[1] * q[0]
        };
        0.5 * (0..rest.len()).map(twice).sum::<f64>().abs()
    }

    #[test]
    fn areas_are_those_of_the_clipped_face() {
        let mut state = 0x9E37_79B9_7F4A_7C15;
        let (mut open, mut partial, mut farthest) = (0, 0, 0.0_f64);
        for case in 0..4000 {
            // From a pixel to the whole picture, level and steep sides among them.
            let size = [400, 1500, 5000, 16_000][case % 4];
            let mut corners: [[i32; 2]; 3] =
                std::array::from_fn(|_| std::array::from_fn(|_| random(&mut state, size) - size / 2));
            if case % 5 == 0 {
                corners[1][case % 2] = corners[0][case % 2] + (case as i32 % 3);
            }
            let width_px = [0.4, 1.0, 2.5][case % 3];
            let Some(inset) = inset_of(corners, width_px) else {
                let all: f64 = (0..64)
                    .flat_map(|y| (0..64).map(move |x| [x, y]))
                    .map(|at| truth(corners, f64::from(width_px), at))
                    .sum();
                assert!(all < 1e-3, "{case}: {all} is left of {corners:?}");
                continue;
            };
            open += 1;
            for y in (0..64).step_by(1 + case % 3) {
                for first in (0..64).step_by(LANES) {
                    for (x, area) in (first..).zip(inset.areas(Isa::detect(), first, y)) {
                        let (area, want) =
                            (f64::from(area) / f64::from(HOLE_UNIT), truth(corners, f64::from(width_px), [x, y]));
                        partial += usize::from(want > 0.01 && want < 0.99);
                        farthest = farthest.max((area - want).abs());
                        assert!((area - want).abs() < 1e-3, "{case}: {area} is not {want} at {x} {y} of {corners:?}");
                    }
                }
            }
        }
        assert!(open > 2000 && partial > 20_000, "{open} faces, {partial} pixels; off by {farthest}");
    }

    /// Small faces of all shapes, needles among them. An area outside of the open pixels would be left out.
    #[test]
    fn small_insets_have_areas_in_their_open_pixels_alone() {
        let mut state = 0x1234_5678_9ABC_DEF1;
        let (mut open, mut empty_pixels) = (0, 0);
        for case in 0..60_000 {
            let size = [300, 900, SMALL + 1][case % 3];
            let place = [random(&mut state, 8000) - 4000, random(&mut state, 8000) - 4000];
            let mut corners: [[i32; 2]; 3] =
                std::array::from_fn(|_| std::array::from_fn(|axis| place[axis] + random(&mut state, size)));
            if case % 4 == 0 {
                corners[1][case / 4 % 2] = corners[0][case / 4 % 2] + (case as i32 / 8 % 3);
            }
            let Some(inset) = inset_of(corners, [0.05, 0.4, 1.0][case / 3 % 3]) else { continue };
            assert!(inset.is_small());
            open += 1;
            let [columns, rows] = inset.open_pixels();
            let [[left, right], [top, bottom]] = inset.bounds.map(|b| b.map(|v| v >> 8));
            for y in top - 1..=bottom + 1 {
                let by_row = inset.areas(Isa::baseline(), left - 1, y);
                for (x, area) in (left - 1..=right + 1).zip(by_row) {
                    let is_open = (columns[0]..=columns[1]).contains(&x) && (rows[0]..=rows[1]).contains(&y);
                    assert!(is_open || area == 0, "{case}: {area} at {x} {y} of {corners:?}");
                    empty_pixels += usize::from(!is_open);
                }
                for isa in Isa::available() {
                    assert_eq!(inset.areas(isa, left - 1, y), by_row, "{case}, {isa:?}");
                    let (upper, lower) = (inset.areas(isa, left, y), inset.areas(isa, left, y + 1));
                    let both = inset.areas_in_two_rows(isa, left, y);
                    assert_eq!(both, std::array::from_fn(|l| if l < 4 { upper[l] } else { lower[l - 4] }), "{case}");
                }
            }
        }
        assert!(open > 20_000 && empty_pixels > 100_000, "{open} faces, {empty_pixels} pixels");
    }

    #[test]
    fn every_instruction_set_finds_the_same_insets() {
        let mut state = 0xFEDC_BA98_7654_3211;
        let mut chance = || random(&mut state, 1 << 20) as f32 / (1 << 20) as f32;
        let positions: Vec<[f32; 3]> = (0..9000)
            .map(|i| {
                let size = [0.002, 0.02, 1.0][i / 3 % 3];
                [0.8 * (i / 9) as f32 / 1000.0 - 0.4 + size * chance(), 0.5 * size * chance(), chance()]
            })
            .collect();
        let triangles: Vec<[u32; 3]> = (0..3000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let (half, deadline, watch) = ([256 * 128; 2], Deadline::default(), Stopwatch::default());
        let plan = DrawPlan::new([256, 256], &positions, &triangles, Projection::for_tests());
        let mut open = 0;
        for isa in Isa::available() {
            let mut cpu = CpuRenderer::with_isa(1, isa);
            cpu.transform(&plan, None);
            let context = cpu.context(&plan, &deadline, &watch);
            for first in (0..3000).step_by(LANES) {
                let ids = std::array::from_fn(|l| (first + l) as u32);
                let want = Insets::new(&Corners::load(&context, &ids), half, 128.0);
                assert_eq!(Insets::of(&context, &ids, half, 128.0), want, "{isa:?}, face {first}");
                open += want.is_open.iter().sum::<u32>();
            }
        }
        assert!((600..5400).contains(&open), "{open}");
    }

    #[test]
    fn samples_well_inside_are_those_far_from_every_side() {
        let corners = [[0, 0], [2000, 100], [300, 1700]];
        let mut inside = 0;
        for turned in [corners, [corners[0], corners[2], corners[1]]] {
            let inset = inset_of(turned, 1.0).unwrap();
            for (x, y) in (-10..210).flat_map(|x| (-10..210).map(move |y| (10 * x, 10 * y))) {
                let nearest = [0, 1, 2].map(|k| {
                    let (p, q) = (corners[k], corners[(k + 1) % 3]);
                    let way = [f64::from(q[0] - p[0]), f64::from(q[1] - p[1])];
                    (way[0] * f64::from(y - p[1]) - way[1] * f64::from(x - p[0])) / way[0].hypot(way[1])
                });
                let nearest = nearest.into_iter().fold(f64::INFINITY, f64::min);
                if (nearest - f64::from(INSIDE)).abs() > 0.01 {
                    let is_inside = inset.contains([x as f32, y as f32]);
                    assert_eq!(is_inside, nearest > f64::from(INSIDE), "{x} {y}");
                    inside += usize::from(is_inside);
                }
            }
        }
        assert!(inside > 10_000, "{inside}");
    }
}
