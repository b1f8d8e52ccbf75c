//! The share of a pixel that lines cover, and the compositing of their colour over the pixel (stage lines). Twin of
//! `shaders/lines/coverage.wgsl`.
//!
//! A stroke is the area that the line along one part of an edge covers, and a pixel is covered by the union of its
//! strokes. A pixel has 256 coverage points, which show where strokes overlap. Four values per pixel describe all its
//! strokes: the sum of their areas, the sum of the numbers of points in them, the mask of the points that any of them
//! covers, and the largest difference between a stroke's area and its points. All are integers or bits, so the result
//! does not depend on the order of the strokes.
//!
//! If strokes do not overlap, the coverage is the sum of their areas. If they overlap, the sum is scaled by the
//! number of points that any stroke covers over the sum of the strokes' points. The result may differ from the
//! union's points by at most four times that largest difference ([`LineCoverage::covered_share`]). Where
//! [`holes`](super::holes) tell the coverage, there are no strokes of visible parts. Where hidden parts fade, what whole
//! edges cover beyond the visible parts counts a quarter.

use super::holes::Holes;
use super::stroke::{Amount, Mask, POINTS, WORDS, count};
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::backend::cpu::geometry::transform::recip;
use crate::backend::cpu::isa::dispatch;
use crate::backend::cpu::peeling::state::PeelBand;
use crate::backend::cpu::resolve::{is_composited, over_background};
use crate::backend::cpu::surface::light::Light;
use crate::backend::sample_partition::sample_partition;
use crate::plan::{ALPHA_MIN, DrawPlan, FADE, LinePass};

/// The mask of a pixel without strokes.
const NO_POINTS: Mask = [0; WORDS];

/// Steps to the pixel of a sum of areas.
pub const AREA_UNIT: f32 = 65_536.0;

/// A union of strokes is taken to differ from its points by at most this many times the largest
/// difference between a stroke and its points. Of more strokes in one pixel, some overlap.
pub const STROKES_SIDE_BY_SIDE: f32 = 4.0;

/// The strokes of a pixel.
#[derive(Clone, Copy, Default)]
pub struct LineCoverage {
    mask: Mask,
    /// Sum of the strokes' areas; 64 bits hold any number of them.
    area: u64,
    /// Sum of the strokes' points. It saturates; then `slack` bounds the result.
    count: u32,
    /// Largest difference between the area of a stroke and that of its points.
    slack: u32,
}

impl LineCoverage {
    /// True if all points are covered: further strokes change nothing. One stroke may cover all
    /// points and yet miss a corner of the pixel, so that at least two must.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.count > POINTS && self.mask == [u16::MAX; WORDS]
    }

    /// Adds a stroke of a line with this peak.
    #[inline(always)]
    pub fn add(&mut self, amount: Amount, mask: &Mask, peak: f32) {
        for l in 0..WORDS {
            self.mask[l] |= mask[l];
        }
        let (area, count) = ((amount.area * AREA_UNIT + 0.5) as u32, amount.points);
        self.area += u64::from(area);
        self.count = self.count.saturating_add(count);
        self.slack = self.slack.max(area.abs_diff((count as f32 * (peak * (AREA_UNIT / POINTS as f32)) + 0.5) as u32));
    }

    /// Covered share of the pixel, 0 to the lines' `peak`: `area * points of the union / sum of the
    /// strokes' points`, a ratio estimate whose error is that of the overlap alone. However often a
    /// stroke is drawn that covers but a corner of the pixel, and none of its points or few, the
    /// union is as far from its points as a few strokes are from theirs.
    #[inline(always)]
    pub fn covered_share(&self, peak: f32) -> f32 {
        if self.area == 0 {
            return 0.0;
        }
        if self.is_full() {
            return peak;
        }
        let union = count(&self.mask);
        let area = to_f32(self.area) * (1.0 / AREA_UNIT);
        let share = if self.count > union { union as f32 / self.count as f32 } else { 1.0 };
        let points = union as f32 * (peak * (1.0 / POINTS as f32));
        let slack = self.slack as f32 * (STROKES_SIDE_BY_SIDE / AREA_UNIT);
        (area * share).max(points - slack).min(points + slack).min(peak)
    }
}

/// The strokes of a band's pixels. Most pixels have none: room for theirs is reserved, but not
/// touched.
#[derive(Default)]
pub struct BandStrokes {
    /// Per pixel, 1 more than its index in `coverage`; 0 where there are none.
    places: Vec<u32>,
    coverage: Vec<LineCoverage>,
}

impl BandStrokes {
    /// Bytes of a pixel, if it has strokes.
    pub const PIXEL_BYTES: usize = size_of::<u32>() + size_of::<LineCoverage>();

    /// Allocated bytes.
    pub fn bytes(&self) -> usize {
        self.places.capacity() * size_of::<u32>() + self.coverage.capacity() * size_of::<LineCoverage>()
    }

    /// Forgets all strokes, and takes on a number of pixels.
    pub fn reset(&mut self, pixels: usize) {
        self.places.clear();
        self.places.reserve_exact(pixels);
        self.places.resize(pixels, 0);
        self.coverage.clear();
        // What is not touched takes no memory.
        self.coverage.reserve_exact(pixels);
    }

    /// The strokes of a pixel, if it has any.
    #[inline(always)]
    pub fn of(&self, pixel: usize) -> Option<&LineCoverage> {
        self.coverage.get((self.places[pixel] as usize).wrapping_sub(1))
    }

    /// Adds covered points of [fringes](super::fringes), without an area.
    #[inline(always)]
    pub fn add_points(&mut self, pixel: usize, mask: &Mask) {
        let all = &mut self.at(pixel).mask;
        for l in 0..WORDS {
            all[l] |= mask[l];
        }
    }

    /// Moves the share of each pixel's points that are covered, times the lines' peak, to `shares`, and forgets the
    /// strokes.
    pub fn take_shares(&mut self, peak: f32, shares: &mut Vec<f32>) {
        let share = |&place: &u32| match self.coverage.get((place as usize).wrapping_sub(1)) {
            Some(coverage) => count(&coverage.mask) as f32 * (peak * (1.0 / POINTS as f32)),
            None => 0.0,
        };
        shares.reserve_exact(self.places.len());
        shares.extend(self.places.iter().map(share));
        self.reset(self.places.len());
    }

    /// As [`LineCoverage::is_full`].
    #[inline(always)]
    pub fn is_full(&self, pixel: usize) -> bool {
        self.of(pixel).is_some_and(LineCoverage::is_full)
    }

    /// As [`LineCoverage::add`].
    #[inline(always)]
    pub fn add(&mut self, pixel: usize, amount: Amount, mask: &Mask, peak: f32) {
        self.at(pixel).add(amount, mask, peak);
    }

    /// The strokes of a pixel, which are none at first.
    #[inline(always)]
    fn at(&mut self, pixel: usize) -> &mut LineCoverage {
        let place = &mut self.places[pixel];
        if *place == 0 {
            self.coverage.push(LineCoverage::default());
            *place = self.coverage.len() as u32;
        }
        &mut self.coverage[*place as usize - 1]
    }
}

/// Rounds as the shaders round a number of two words.
#[inline(always)]
fn to_f32(v: u64) -> f32 {
    (v >> 32) as f32 * 4_294_967_296.0 + (v as u32) as f32
}

/// Points that see a face, of mixed pixels in which other points see nothing.
#[derive(Default)]
pub struct BorderPoints {
    /// Per pixel, 1 more than its index in `masks`; 0 for all others. Empty where no line asks.
    places: Vec<u32>,
    masks: Vec<Mask>,
}

impl BorderPoints {
    /// Bytes of a pixel, if it has points.
    pub const PIXEL_BYTES: usize = size_of::<u32>() + size_of::<Mask>();

    /// Allocated bytes.
    pub fn bytes(&self) -> usize {
        self.places.capacity() * size_of::<u32>() + self.masks.capacity() * size_of::<Mask>()
    }

    /// Forgets all points, and takes on a number of pixels.
    pub fn reset(&mut self, pixels: usize) {
        self.places.clear();
        self.places.reserve_exact(pixels);
        self.places.resize(pixels, 0);
        self.masks.clear();
        // What is not touched takes no memory.
        self.masks.reserve_exact(pixels);
    }

    /// Sets a pixel's points, given in sets of 64.
    pub fn set(&mut self, pixel: usize, points: [u64; POINTS as usize / 64]) {
        let mut mask = NO_POINTS;
        for point in (0..POINTS as usize).filter(|point| points[point / 64] >> (point % 64) & 1 != 0) {
            mask[point % WORDS] |= 0x8000 >> (point / WORDS);
        }
        if let Some(place) = self.places.get_mut(pixel) {
            self.masks.push(mask);
            *place = self.masks.len() as u32;
        }
    }

    /// A pixel's points, where some see nothing.
    #[inline(always)]
    fn of(&self, pixel: usize) -> Option<&Mask> {
        self.masks.get((*self.places.get(pixel)? as usize).wrapping_sub(1))
    }
}

/// The area of a band's pixels that the lines of a pass cover.
pub struct Covered<'a> {
    /// The strokes of the visible parts of edges, or of all.
    pub strokes: &'a BandStrokes,
    /// The area that visible lines leave free, where that is known.
    pub holes: &'a Holes,
    /// Per pixel, the share that whole edges cover; empty unless their hidden parts are faded.
    pub whole: &'a [f32],
}

/// Composites the strokes of line passes over a band's colours.
pub struct LineCompositor<'a> {
    plan: &'a DrawPlan<'a>,
    band: &'a SampleBand,
    /// The peeled layers over its samples.
    peel: Option<&'a PeelBand>,
    /// The points assigned to each sample; empty where there is no surface under the lines.
    sample_masks: Vec<Mask>,
    /// The points that see the surface in mixed pixels at its border.
    border: Option<&'a BorderPoints>,
}

impl<'a> LineCompositor<'a> {
    /// A compositor for a band and, where the plan has them, its peeled layers and mixed pixels.
    pub fn new(
        plan: &'a DrawPlan<'a>,
        band: &'a SampleBand,
        peel: Option<&'a PeelBand>,
        border: &'a BorderPoints,
    ) -> Self {
        let samples = if plan.is_shaded() && !plan.lines.is_empty() { plan.samples } else { 0 };
        // The scratch may still hold what belongs to another plan.
        let peel = peel.filter(|_| plan.peeling().is_some());
        let border = Some(border).filter(|_| plan.has_mixed());
        let sample_masks = (0..samples).map(|s| points_of_sample(samples, s)).collect();
        Self { plan, band, peel, sample_masks, border }
    }

    /// The background behind a pixel.
    #[inline(always)]
    fn background(&self, pixel: usize) -> [f32; 4] {
        match self.plan.has_gradient() {
            true => self.plan.background_at(self.band.shown[0] + pixel as u32 / self.band.size_px[0]),
            false => self.plan.background,
        }
    }

    /// The surface's colour, weighted by its share of what lines leave uncovered. At the surface's
    /// border this differs from its share of the pixel, because a line along the border covers both
    /// sides alike.
    #[inline(always)]
    fn uncovered(&self, pixel: usize, surface: [f32; 4], mask: &Mask, opacity: f32) -> [f32; 4] {
        if self.sample_masks.is_empty() || !(surface[3] > ALPHA_MIN && surface[3] < 1.0) {
            return surface;
        }
        let [x, y] = [pixel as u32 % self.band.size_px[0], self.band.shown[0] + pixel as u32 / self.band.size_px[0]];
        let shown = |s: usize| {
            let over = self.peel.map_or(0.0, |peel| peel.alpha(x, y, s as u32));
            if self.band.pixel(x as i32, y as i32).0[s] == NOTHING { over } else { 1.0 }
        };
        let weight = match self.border.and_then(|border| border.of(pixel)) {
            Some(seen) => weight_of_points(seen, mask, opacity),
            None => weight(&self.sample_masks, shown, mask, opacity),
        };
        [surface[0] * weight, surface[1] * weight, surface[2] * weight, (surface[3] * weight).min(1.0)]
    }
}

dispatch! {
    /// Composites the lines of a pass over the colours. Their light is empty where they are not lit, their depths
    /// where layers do not tint them.
    pub fn composite(
        compositor: &LineCompositor<'_>,
        lines: &LinePass,
        covered: &Covered<'_>,
        seen: (&[Light], &[f32]),
        colors: &mut [[f32; 4]],
    ) = composite_kernel
}

#[inline(always)]
fn composite_kernel(
    compositor: &LineCompositor<'_>,
    lines: &LinePass,
    covered: &Covered<'_>,
    (light, depths): (&[Light], &[f32]),
    colors: &mut [[f32; 4]],
) {
    let (width_px, peak) = (compositor.band.size_px[0], lines.peak());
    for (y, (row, colors)) in (compositor.band.shown[0]..).zip(colors.chunks_mut(width_px.max(1) as usize).enumerate())
    {
        let fades = lines.fade.as_deref().map(|fade| (fade, fade.row(y)));
        for (x, c) in (0..).zip(colors) {
            let i = row * width_px as usize + x as usize;
            let line_color = || match &fades {
                Some((fade, row)) => {
                    let share = fade.at(row, x);
                    lines.color.map(|v| v * share)
                }
                None => lines.color,
            };
            composite_pixel(compositor, (lines, peak), covered, (light, depths), i, line_color, c);
        }
    }
}

/// Composites the lines of a pass over the colour of a pixel, by its index among the shown ones.
#[inline(always)]
fn composite_pixel(
    compositor: &LineCompositor<'_>,
    (lines, peak): (&LinePass, f32),
    covered: &Covered<'_>,
    (light, depths): (&[Light], &[f32]),
    i: usize,
    line_color: impl Fn() -> [f32; 4],
    c: &mut [f32; 4],
) {
    let (cover, mask) = match (covered.holes.covered_share(i), covered.strokes.of(i)) {
        (Some(cover), _) => (cover, &NO_POINTS),
        (None, Some(coverage)) => (coverage.covered_share(peak), &coverage.mask),
        (None, None) if covered.whole.is_empty() => return,
        (None, None) => (0.0, &NO_POINTS),
    };
    // What hidden parts cover beside visible ones, times the share of the colour that they keep. Less than 0 where points
    // miss some of the area that visible parts cover: no more is lost of it than that share.
    let hidden = covered.whole.get(i).map_or(0.0, |&whole| FADE * (whole - cover));
    let all = cover + hidden;
    if all > 0.0 {
        let line_color = line_color();
        let under = if is_composited(c) {
            [c[0], c[1], c[2], -c[3]]
        } else {
            let surface = compositor.uncovered(i, *c, mask, line_color[3] * peak);
            over_background(surface, compositor.background(i))
        };
        let mut color = light.get(i).map_or(line_color, |light| light.on_premultiplied(line_color));
        let hidden_color = color;
        if let (Some(&depth), Some(peel)) = (depths.get(i), compositor.peel) {
            color = peel.tints.tinted(i, (depth, lines.tint_reach()), color);
        }
        *c = std::array::from_fn(|k| (cover * color[k] + hidden * hidden_color[k]) + under[k] * (1.0 - all * color[3]));
        c[3] = -c[3];
    }
}

/// The points assigned to a sample, as a mask.
pub fn points_of_sample(samples: u32, sample: u32) -> Mask {
    let mut mask = [0; WORDS];
    for (point, &cell) in sample_partition(samples).iter().enumerate() {
        if u32::from(cell) == sample {
            mask[point % WORDS] |= 0x8000 >> (point / WORDS);
        }
    }
    mask
}

/// Ratio of the surface's share beside and through a line to its share of the pixel. `alpha` gives
/// the surface's alpha per sample. A point counts 1, or 1 - opacity where the line covers it.
#[inline(always)]
fn weight(sample_masks: &[Mask], alpha: impl Fn(usize) -> f32, mask: &Mask, opacity: f32) -> f32 {
    let covered = count(mask);
    if covered == 0 || covered == POINTS {
        return 1.0;
    }
    // In points.
    let (mut surface, mut surface_covered) = (0.0, 0.0);
    for (s, cell) in sample_masks.iter().enumerate() {
        let alpha = alpha(s);
        if alpha > 0.0 {
            surface += alpha * (POINTS as f32 / sample_masks.len() as f32);
            surface_covered += alpha * count(&std::array::from_fn(|l| mask[l] & cell[l])) as f32;
        }
    }
    ratio(surface, surface_covered, covered, opacity)
}

/// The same, given the points that see the surface.
#[inline(always)]
fn weight_of_points(seen: &Mask, mask: &Mask, opacity: f32) -> f32 {
    let both = std::array::from_fn(|l| mask[l] & seen[l]);
    ratio(count(seen) as f32, count(&both) as f32, count(mask), opacity)
}

/// The same, given how many points the surface has, how many of these the line covers, and how many it covers in all.
#[inline(always)]
fn ratio(surface: f32, surface_covered: f32, covered: u32, opacity: f32) -> f32 {
    if covered == 0 || covered == POINTS || surface < ALPHA_MIN || surface == POINTS as f32 {
        return 1.0;
    }
    let shown = surface - opacity * surface_covered;
    let of_pixel = POINTS as f32 - opacity * covered as f32;
    (POINTS as f32 * shown) * recip(of_pixel * surface)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// xorshift64
    fn random(state: &mut u64) -> u64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        *state
    }

    /// Every point by itself: a line over a surface over a background.
    fn truth(samples: u32, alphas: &[f32], mask: &Mask, [surface, line, background]: [[f64; 4]; 3]) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for (point, &cell) in sample_partition(samples).iter().enumerate() {
            let alpha = f64::from(alphas[usize::from(cell)]);
            let is_covered = mask[point % WORDS] >> (15 - point / WORDS) & 1 == 1;
            for k in 0..4 {
                let below = alpha * surface[k] + background[k] * (1.0 - alpha * surface[3]);
                sum[k] += if is_covered { line[k] + below * (1.0 - line[3]) } else { below };
            }
        }
        sum.map(|v| v / POINTS as f64)
    }

    #[test]
    fn a_line_is_laid_over_the_surface_as_it_is_over_each_point() {
        let mut state = 0x9E37_79B9_7F4A_7C15;
        let mut cases = 0;
        let (mut weighed, mut compared, mut farthest) = (0, 0, 0.0_f64);
        for samples in [1, 4, 8, 16] {
            let masks: Vec<Mask> = (0..samples).map(|s| points_of_sample(samples, s)).collect();
            for case in 0..2000 {
                // Sparse, even and dense ones.
                let mask: Mask = std::array::from_fn(|_| {
                    let [a, b] = [random(&mut state), random(&mut state)].map(|v| (v >> 20) as u16);
                    [a & b, a, a | b][case % 3]
                });
                // Nothing, glass of two kinds, or what is opaque.
                let seen = random(&mut state) >> 20;
                let kinds = [[0.0, 1.0, 0.0, 1.0], [0.0, 0.3, 0.8, 1.0]][case / 3 % 2];
                let alphas: Vec<f32> = (0..samples).map(|s| kinds[(seen >> (2 * s) & 3) as usize]).collect();
                let share = alphas.iter().sum::<f32>() / samples as f32;
                let opacity = [1.0, 0.25, 0.0, 0.7, 0.999][case % 5];
                let line: [f32; 4] = [0.8, 0.1, 0.3, 1.0].map(|v| v * opacity);
                let opaque = [0.2_f32, 0.5, 0.7, 1.0];
                let background = [0.25_f32, 0.05, 0.5, 0.5];
                let weight = weight(&masks, |s| alphas[s], &mask, opacity);
                if case / 3 % 2 == 0 {
                    let seen =
                        |k: usize| (0..masks.len()).filter(|&s| alphas[s] > 0.0).fold(0, |all, s| all | masks[s][k]);
                    assert_eq!(weight_of_points(&std::array::from_fn(seen), &mask, opacity), weight);
                    compared += 1;
                }
                weighed += usize::from(weight != 1.0);
                let below = over_background(opaque.map(|v| v * share * weight), background);
                let cover = count(&mask) as f32 / POINTS as f32;
                let wide = [opaque, line, background].map(|c| c.map(f64::from));
                let truth = truth(samples, &alphas, &mask, wide);
                for k in 0..4 {
                    let drawn = f64::from(cover * line[k] + below[k] * (1.0 - cover * line[3]));
                    farthest = farthest.max((drawn - truth[k]).abs());
                    assert!((drawn - truth[k]).abs() < 1e-5, "{samples} {case}: {drawn} is not {}", truth[k]);
                }
                cases += 1;
            }
        }
        assert_eq!(cases, 8000);
        assert!(weighed > 4000 && compared > 3000 && farthest > 0.0, "{weighed} {compared}");
    }

    #[test]
    fn a_stroke_of_no_points_counts_however_often_it_is_drawn() {
        let half: Mask = std::array::from_fn(|l| if l % 2 == 0 { u16::MAX } else { 0 });
        let mut cases = 0;
        for (beside, peak) in [(Mask::default(), 1.0), (half, 1.0), (half, 0.5)] {
            let area = count(&beside) as f32 * peak / POINTS as f32;
            let mut last = 0.0;
            for copies in [0, 1, 4, 5, 100, 1_000_000] {
                let (mut coverage, none) = (LineCoverage::default(), Mask::default());
                let amount = |area, mask: &Mask| Amount { area, points: count(mask) };
                coverage.add(amount(area, &beside), &beside, peak);
                (0..copies).for_each(|_| coverage.add(amount(0.003, &none), &none, peak));
                let expected = area + 0.003 * copies.min(4) as f32;
                assert!(
                    (coverage.covered_share(peak) - expected).abs() < 1e-3,
                    "{copies}: {}",
                    coverage.covered_share(peak)
                );
                assert!(copies <= 4 || coverage.covered_share(peak) == last || copies == 5, "{copies}");
                last = coverage.covered_share(peak);
                cases += 1;
            }
        }
        assert_eq!(cases, 18);
    }
}
