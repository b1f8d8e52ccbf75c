//! Stage 4, an edge: lines of exact width. Twin of `shaders/lines.wgsl`.
//!
//! Each edge is a capsule on screen. A pixel's coverage is the capsule's area in the pixel's unit box, by the box filter's
//! profile across the line: exact for a straight strip, close at the round ends. Coverage becomes integer ink
//! ([`ink_table`](crate::plan::ink_table)), so that the order of edges does not matter.

use super::Stages;
use super::clip::clip_segment;
use super::transform::{ScreenVertex, homogeneous};
use super::visibility::{NOTHING, SampleBand, Setup, area};
use crate::plan::{Edge, LinePass, sample_offsets};

/// Farthest from the middle of a unit box to its corner.
const BOX_RADIUS: f32 = 0.707_106_8;

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

    /// First and last column that the capsule may touch in pixel row `y`.
    #[inline(always)]
    fn columns(&self, y: i32, width_px: u32) -> [i32; 2] {
        let (a, b) = (self.start[0], self.start[0] + self.along[0]);
        let (mut low, mut high) = (a.min(b), a.max(b));
        // A steep or slanted line touches only a short piece of each row.
        if self.along[1] * self.along[1] > 1e-6 {
            let slope = self.along[0] / self.along[1];
            let center = a + (y as f32 + 0.5 - self.start[1]) * slope;
            let spread = slope.abs() * (self.reach + 0.5) + self.reach;
            low = low.max(center - spread);
            high = high.min(center + spread);
        }
        [((low - self.reach) as i32).max(0), ((high + self.reach) as i32).min(width_px as i32 - 1)]
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

/// Whether an edge of a closed surface is on its far side, where nothing of it can be seen.
#[inline(always)]
pub fn is_back_edge(stages: &Stages<'_>, lines: &LinePass, edge: &Edge) -> bool {
    lines.skip_back_edges && edge.faces.iter().all(|&face| stages.looks_away(face))
}

/// Draws one edge's ink into the band.
#[inline(always)]
pub fn draw(stages: &Stages<'_>, lines: &LinePass, edge: &Edge, band: &SampleBand, ink: &mut [u32]) {
    let Some(segment) = Segment::new(stages, lines, edge) else { return };
    let [first, last] = segment.rows(band.size_px[1]);
    let profile = Profile::new(lines, &segment);
    for y in first.max(band.first_row as i32)..=last.min((band.first_row + band.rows) as i32 - 1) {
        let [from, to] = segment.columns(y, band.size_px[0]);
        let row = (y as u32 - band.first_row) as usize * band.size_px[0] as usize;
        for x in from..=to {
            let (t, offset) = segment.nearest([x as f32 + 0.5, y as f32 + 0.5]);
            let coverage = (profile.coverage(t, offset) * 1023.0 + 0.5) as u32;
            if coverage == 0 {
                continue;
            }
            let share = if lines.hide_behind_surface {
                visible_share(stages, edge, &segment, t, band, [x as u32, y as u32])
            } else {
                [1, 1]
            };
            let level = (coverage * share[0] + share[1] / 2) / share[1];
            // Once a pixel is full nothing changes it, so it may stop counting long before the sum could wrap.
            let slot = &mut ink[row + x as usize];
            if *slot < 1 << 31 {
                *slot += stages.ink_table[level as usize];
            }
        }
    }
}

/// Coverage of a pixel's box by a strip, as a function of where the box's centre lies.
struct Profile {
    half_width: f32,
    smoothing: f32,
    /// Unit normal of the line.
    normal: [f32; 2],
}

impl Profile {
    fn new(lines: &LinePass, segment: &Segment) -> Self {
        let inverse = segment.inverse_length_squared.sqrt();
        let normal = [-segment.along[1] * inverse, segment.along[0] * inverse];
        Self { half_width: 0.5 * lines.width_px, smoothing: 0.5 * lines.smoothing_px, normal }
    }

    /// `T(d + w/2) - T(d - w/2)`; across the line in the middle, around the end points beyond them.
    #[inline(always)]
    fn coverage(&self, t: f32, offset: [f32; 2]) -> f32 {
        let distance = (offset[0] * offset[0] + offset[1] * offset[1]).sqrt();
        if distance > self.half_width + self.smoothing + BOX_RADIUS {
            return 0.0;
        }
        let normal = if (t > 0.0 && t < 1.0) || distance < 1e-6 {
            self.normal
        } else {
            [offset[0] / distance, offset[1] / distance]
        };
        let (nx, ny) = (normal[0].abs(), normal[1].abs());
        let wide = 0.5 * (nx + ny) + self.smoothing;
        let narrow = (0.5 * (nx - ny).abs() - self.smoothing).abs();
        let strip = trapezoid_integral(distance + self.half_width, wide, narrow)
            - trapezoid_integral(distance - self.half_width, wide, narrow);
        strip.clamp(0.0, 1.0)
    }
}

/// Integral from minus infinity to `u` of the trapezoid of area 1 whose half supports are `wide` (foot) and `narrow` (top).
#[inline(always)]
fn trapezoid_integral(u: f32, wide: f32, narrow: f32) -> f32 {
    let height = 1.0 / (wide + narrow);
    let a = u.abs();
    let half = if a <= narrow {
        height * a
    } else if a < wide {
        let past = a - narrow;
        height * (narrow + past - past * past / (2.0 * (wide - narrow)))
    } else {
        0.5
    };
    if u < 0.0 { 0.5 - half } else { 0.5 + half }
}

/// In how many of a pixel's samples the edge is not hidden: [count, of].
#[inline(always)]
fn visible_share(
    stages: &Stages<'_>,
    edge: &Edge,
    segment: &Segment,
    t: f32,
    band: &SampleBand,
    at: [u32; 2],
) -> [u32; 2] {
    let depth = segment.depth[0] + t * (segment.depth[1] - segment.depth[0]);
    let mut count = 0;
    let mut last = (NOTHING, true);
    for s in 0..band.samples {
        let i = band.index(at[0], at[1], s);
        let id = band.ids[i];
        let visible = if id == NOTHING || depth >= band.depth[i] || id == edge.faces[0] || id == edge.faces[1] {
            true
        } else if id == last.0 {
            last.1
        } else {
            let visible = !is_hidden_by(stages, edge, segment, t, depth, id);
            last = (id, visible);
            visible
        };
        count += u32::from(visible);
    }
    debug_assert_eq!(sample_offsets(band.samples).len(), band.samples as usize);
    [count, band.samples]
}

/// Whether triangle `id`, which is nearer than the edge at a sample close by, really lies in front of it. Its plane is
/// continued to the edge's own point, because close to a fold the sample itself may be nearer without hiding anything.
fn is_hidden_by(stages: &Stages<'_>, edge: &Edge, segment: &Segment, t: f32, depth: f32, id: u32) -> bool {
    let (triangle, is_hull) = stages.triangle(id);
    if !is_hull && triangle.iter().any(|v| edge.vertices.contains(v)) {
        return false;
    }
    let vertices = stages.screen_triangle(id);
    if vertices.iter().any(ScreenVertex::is_outside) {
        return true;
    }
    let Some(setup) = Setup::new(&vertices) else { return false };
    let half = [stages.plan.width_px as f32 * 128.0, stages.plan.height_px as f32 * 128.0];
    let x = (segment.start[0] + t * segment.along[0]) * 256.0 - half[0];
    let y = (segment.start[1] + t * segment.along[1]) * 256.0 - half[1];
    let [z, gx, gy] = setup.depth;
    let plane = z + gx * (x - setup.x[0] as f32) + gy * (y - setup.y[0] as f32);
    // What the surface may fall away over three quarters of a pixel: curvature between neighbouring faces.
    let tolerance = 192.0 * (gx.abs() + gy.abs());
    plane > depth + tolerance
}

fn clip(stages: &Stages<'_>, edge: &Edge) -> Option<[ScreenVertex; 2]> {
    let projection = &stages.plan.projection;
    clip_segment(projection, edge.vertices.map(|v| homogeneous(projection, stages.plan.positions[v as usize])))
}

impl Stages<'_> {
    /// Whether a face is certainly turned away. A missing face is: it shows nothing.
    #[inline(always)]
    fn looks_away(&self, face: u32) -> bool {
        if face == Edge::NO_FACE {
            return true;
        }
        let vertices = self.screen_triangle(face);
        !vertices.iter().any(ScreenVertex::is_outside) && area(&vertices) > 0
    }
}
