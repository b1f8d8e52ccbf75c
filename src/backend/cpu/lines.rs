//! Stage 4, an edge: lines of exact width. Twin of `shaders/lines.wgsl`.
//!
//! Each edge is a capsule on screen. A pixel's coverage is the capsule's area in the pixel's unit box, by the box filter's
//! profile across the line: exact for a straight strip, close at the round ends. Coverage becomes integer ink
//! ([`ink_table`](crate::plan::ink_table)), so that the order of edges does not matter.

use super::Stages;
use super::clip::clip_segment;
use super::occluders::PlaneCache;
use super::samples::{NOTHING, SampleBand};
use super::transform::{ScreenVertex, homogeneous};
use crate::plan::{Edge, INK_FULL, LinePass, Shown};

/// Farthest from the middle of a unit box to its corner.
const BOX_RADIUS: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// An edge on screen, pixels from the picture's upper left corner.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    start: [f32; 2],
    along: [f32; 2],
    inverse_length_squared: f32,
    depth: [f32; 2],
    /// Reach across: half the width, the ramp, and the pixel's own box.
    reach: f32,
}

impl Segment {
    /// None where the edge is out of the picture.
    #[inline(always)]
    pub fn new(stages: &Stages<'_>, lines: &LinePass, edge: &Edge) -> Option<Self> {
        let [a, b] = edge.vertices.map(|v| stages.vertices[v as usize]);
        let [a, b] = if a.is_outside() || b.is_outside() { clip(stages, edge)? } else { [a, b] };
        let plan = stages.plan;
        let half = [plan.width_px as i32 * 128, plan.height_px as i32 * 128];
        let px = |v: &ScreenVertex| [(v.x + half[0]) as f32 * (1.0 / 256.0), (v.y + half[1]) as f32 * (1.0 / 256.0)];
        let (start, end) = (px(&a), px(&b));
        let along = [end[0] - start[0], end[1] - start[1]];
        let length_squared = along[0] * along[0] + along[1] * along[1];
        let inverse_length_squared = if length_squared > 0.0 { 1.0 / length_squared } else { 0.0 };
        let reach = 0.5 * lines.width_px + 0.5 * lines.smoothing_px + BOX_RADIUS;
        Some(Self { start, along, inverse_length_squared, depth: [a.z, b.z], reach })
    }

    /// First and last picture row that the capsule may touch; empty if first > last.
    #[inline(always)]
    pub fn rows(&self, height_px: u32) -> [i32; 2] {
        let (a, b) = (self.start[1], self.start[1] + self.along[1]);
        [((a.min(b) - self.reach) as i32).max(0), ((a.max(b) + self.reach) as i32).min(height_px as i32 - 1)]
    }

    /// First and last column whose pixel centre may lie within reach in pixel row `y`.
    #[inline(always)]
    fn columns(&self, y: i32, width_px: u32) -> [i32; 2] {
        let (a, b) = (self.start[0], self.start[0] + self.along[0]);
        let (mut low, mut high) = (a.min(b) - self.reach, a.max(b) + self.reach);
        // A steep or slanted line touches only a short piece of each row.
        if self.along[1] * self.along[1] > 1e-6 {
            let slope = self.along[0] / self.along[1];
            let center = a + (y as f32 + 0.5 - self.start[1]) * slope;
            let spread = self.reach * (1.0 + slope * slope).sqrt();
            low = low.max(center - spread);
            high = high.min(center + spread);
        }
        [(low as i32).max(0), (high as i32).min(width_px as i32 - 1)]
    }

    /// The point at `t` of the way, pixels from the picture's upper left corner.
    #[inline(always)]
    pub fn point(&self, t: f32) -> [f32; 2] {
        [self.start[0] + t * self.along[0], self.start[1] + t * self.along[1]]
    }

    /// Whether the point at `t` lies within twice the reach of the first and of the second end.
    #[inline(always)]
    pub fn close_to_ends(&self, t: f32) -> [bool; 2] {
        // t < 2 reach / length, squared so that no root is needed.
        let limit = 4.0 * self.reach * self.reach * self.inverse_length_squared;
        [t * t < limit, (1.0 - t) * (1.0 - t) < limit]
    }

    /// Where along the edge (0 to 1) the point nearest to `p` lies, and the way from there to `p`.
    #[inline(always)]
    fn nearest(&self, p: [f32; 2]) -> (f32, [f32; 2]) {
        let from_start = [p[0] - self.start[0], p[1] - self.start[1]];
        let t = (from_start[0] * self.along[0] + from_start[1] * self.along[1]) * self.inverse_length_squared;
        let t = t.clamp(0.0, 1.0);
        (t, [from_start[0] - t * self.along[0], from_start[1] - t * self.along[1]])
    }
}

/// Draws one edge's ink into the band.
#[inline(always)]
pub fn draw(
    stages: &Stages<'_>,
    lines: &LinePass,
    edge: &Edge,
    band: &SampleBand,
    planes: &mut PlaneCache,
    [ink, owners]: [&mut [u32]; 2],
) {
    let Some(segment) = Segment::new(stages, lines, edge) else { return };
    let [first, last] = segment.rows(band.size_px[1]);
    let capsule = Capsule::new(lines, &segment);
    // Where there is no surface there is nothing to hide behind, and no samples to ask.
    let something_hides = stages.plan.surface.is_some() || stages.plan.hull.is_some();
    let owner = if lines.lit && !owners.is_empty() { stages.lit_by(edge) } else { 0 };
    for y in first.max(band.first_row as i32)..=last.min((band.first_row + band.rows) as i32 - 1) {
        let [from, to] = segment.columns(y, band.size_px[0]);
        let row = (y as u32 - band.first_row) as usize * band.size_px[0] as usize;
        for x in from..=to {
            // What is full stays full, whatever else comes; only a lit line still asks whose it is.
            if owner == 0 && ink[row + x as usize] >= INK_FULL {
                continue;
            }
            let (t, offset) = segment.nearest([x as f32 + 0.5, y as f32 + 0.5]);
            let coverage = (capsule.coverage(t, offset) * 1023.0 + 0.5) as u32;
            if coverage == 0 {
                continue;
            }
            let level = if lines.shown == Shown::All || !something_hides {
                coverage
            } else {
                let visible =
                    visible_samples(stages, edge, &segment, t, band.pixel(x as u32, y as u32), planes, lines.contour);
                let shown = if lines.shown == Shown::Visible { visible } else { band.samples - visible };
                (coverage * shown + band.samples / 2) / band.samples
            };
            // Long before the sum could wrap.
            let slot = &mut ink[row + x as usize];
            if *slot < 1 << 31 {
                *slot += stages.ink_table[level as usize];
            }
            if owner > 0 && level > 0 {
                let slot = &mut owners[row + x as usize];
                *slot = (*slot).max(owner);
            }
        }
    }
}

/// Coverage of a pixel's box by a strip, as a function of the distance between their centres.
///
/// The box filter's profile across a line with unit normal n is a trapezoid of area 1; its half supports are
/// `(|nx| + |ny|) / 2` at the foot and `||nx| - |ny|| / 2` at the top. Coverage is its integral over the strip's width.
struct Profile {
    half_width: f32,
    foot: f32,
    top: f32,
    height: f32,
    /// Curvature of the integral on the flanks.
    flank: f32,
}

impl Profile {
    #[inline(always)]
    fn new(lines: &LinePass, normal: [f32; 2]) -> Self {
        let (nx, ny) = (normal[0].abs(), normal[1].abs());
        let smoothing = 0.5 * lines.smoothing_px;
        let (foot, top) = (0.5 * (nx + ny) + smoothing, (0.5 * (nx - ny).abs() - smoothing).abs());
        let height = 1.0 / (foot + top);
        let flank = if foot > top { 0.5 * height / (foot - top) } else { 0.0 };
        Self { half_width: 0.5 * lines.width_px, foot, top, height, flank }
    }

    /// `T(d + w/2) - T(d - w/2)`, T the trapezoid's integral.
    #[inline(always)]
    fn coverage(&self, distance: f32) -> f32 {
        if distance >= self.half_width + self.foot {
            return 0.0;
        }
        let strip = self.half_integral(distance + self.half_width) - self.half_integral(distance - self.half_width);
        strip.clamp(0.0, 1.0)
    }

    /// Integral of the trapezoid from its middle to `u`.
    #[inline(always)]
    fn half_integral(&self, u: f32) -> f32 {
        let a = u.abs().min(self.foot);
        let past = (a - self.top).max(0.0);
        let half = self.height * a - self.flank * past * past;
        if u < 0.0 { -half } else { half }
    }
}

/// A segment's strip, and the caps at its ends.
struct Capsule<'a> {
    lines: &'a LinePass,
    strip: Profile,
    normal: [f32; 2],
}

impl<'a> Capsule<'a> {
    #[inline(always)]
    fn new(lines: &'a LinePass, segment: &Segment) -> Self {
        let inverse = segment.inverse_length_squared.sqrt();
        let normal = [-segment.along[1] * inverse, segment.along[0] * inverse];
        Self { lines, strip: Profile::new(lines, normal), normal }
    }

    /// Coverage of a pixel at `offset` from the nearest point of the segment, which lies at `t` of its length. Across the
    /// line in the middle; beyond the ends around them, along the way from the end point.
    #[inline(always)]
    fn coverage(&self, t: f32, offset: [f32; 2]) -> f32 {
        if t > 0.0 && t < 1.0 {
            return self.strip.coverage((offset[0] * self.normal[0] + offset[1] * self.normal[1]).abs());
        }
        let distance = (offset[0] * offset[0] + offset[1] * offset[1]).sqrt();
        if distance > self.strip.half_width + 0.5 * self.lines.smoothing_px + BOX_RADIUS {
            return 0.0;
        }
        let outwards = if distance < 1e-6 { self.normal } else { offset.map(|v| v / distance) };
        Profile::new(self.lines, outwards).coverage(distance)
    }
}

/// In how many of a pixel's samples the edge is not hidden.
#[inline(always)]
fn visible_samples(
    stages: &Stages<'_>,
    edge: &Edge,
    segment: &Segment,
    t: f32,
    (ids, depths): (&[u32], &[f32]),
    planes: &mut PlaneCache,
    is_contour: bool,
) -> u32 {
    let depth = segment.depth[0] + t * (segment.depth[1] - segment.depth[0]);
    let mut count = 0;
    let mut last = (NOTHING, true);
    for (&id, &nearest) in ids.iter().zip(depths) {
        let nothing_nearer = id == NOTHING || depth >= nearest || id == edge.faces[0] || id == edge.faces[1];
        if !nothing_nearer && id != last.0 {
            last = (id, !planes.get(stages, id).hides(edge, segment, t, depth, is_contour.then_some(nearest)));
        }
        count += u32::from(nothing_nearer || last.1);
    }
    count
}

fn clip(stages: &Stages<'_>, edge: &Edge) -> Option<[ScreenVertex; 2]> {
    let projection = &stages.plan.projection;
    clip_segment(projection, edge.vertices.map(|v| homogeneous(projection, stages.plan.positions[v as usize])))
}
