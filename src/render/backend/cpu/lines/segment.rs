//! An edge on screen: its ends, its depth at each point along it, and the pixels along it (stage lines). Twin of
//! `shaders/lines/segment.wgsl`.

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::clip::clip_segment;
use crate::backend::cpu::geometry::steepness::NEARER_RATIO;
use crate::backend::cpu::geometry::transform::{ScreenVertex, homogeneous, round_to_i32, rsqrt};
use crate::backend::cpu::isa::LANES;
use crate::plan::Edge;

/// Slack for roundings where only too much is harmless, pixels.
pub const SLACK_PX: f32 = 0.05;

/// First and last column, and first and last row.
pub type PixelBox = [[i16; 2]; 2];

/// An edge on screen.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Ends, in 1/256 px from the picture's centre.
    ends: [[f32; 2]; 2],
    depths: [f32; 2],
    /// The first end, pixels from the picture's upper left corner.
    pub start: [f32; 2],
    /// Vector from `start` to the second end, pixels.
    pub along: [f32; 2],
    /// Length of `along`, pixels.
    pub length: f32,
    /// `1 / length`; 0 if the length is 0.
    pub inverse_length: f32,
}

impl Segment {
    /// None if an end is outside and the plan does not clip, or clipping leaves nothing of the edge.
    #[inline(always)]
    pub fn new(context: &RasterContext<'_>, edge: &Edge) -> Option<Self> {
        let [a, b] = edge.vertices.map(|v| context.vertices[v as usize]);
        let [a, b] = if a.is_outside() || b.is_outside() { clip(context, edge)? } else { [a, b] };
        let plan = context.plan;
        let half = [plan.width_px as i32 * 128, plan.height_px as i32 * 128];
        let px = |v: &ScreenVertex| [(v.x + half[0]) as f32 * (1.0 / 256.0), (v.y + half[1]) as f32 * (1.0 / 256.0)];
        let (start, end) = (px(&a), px(&b));
        let along = [end[0] - start[0], end[1] - start[1]];
        let squared = along[0] * along[0] + along[1] * along[1];
        let inverse_length = if squared > 0.0 { rsqrt(squared) } else { 0.0 };
        let ends = [a, b].map(|v| [v.x as f32, v.y as f32]);
        Some(Self { ends, depths: [a.z, b.z], start, along, length: squared * inverse_length, inverse_length })
    }

    /// First and last picture row that a line of this reach may touch; empty if first > last.
    #[inline(always)]
    pub fn rows(&self, reach: f32, height_px: u32) -> [i32; 2] {
        let (a, b) = (self.start[1], self.start[1] + self.along[1]);
        rows(a, b, reach, [0, height_px as i32])
    }

    /// First and last column, and row, that a line of this reach may touch. They may lie beyond the
    /// picture.
    #[inline(always)]
    pub fn pixel_box(&self, reach: f32) -> PixelBox {
        let reach = reach + SLACK_PX;
        std::array::from_fn(|k| {
            let (a, b) = (self.start[k], self.start[k] + self.along[k]);
            // Rounds towards zero, and no number is too large.
            [(a.min(b) - reach) as i16, (a.max(b) + reach) as i16]
        })
    }

    /// Ends, in 1/256 px from the picture's centre.
    #[inline(always)]
    pub fn ends(&self) -> [[f32; 2]; 2] {
        self.ends
    }

    /// The smaller depth of its ends.
    #[inline(always)]
    pub fn farthest(&self) -> f32 {
        self.depths[0].min(self.depths[1])
    }

    /// The larger depth of its ends.
    #[inline(always)]
    pub fn nearest(&self) -> f32 {
        self.depths[0].max(self.depths[1])
    }

    /// False if the triangle is farther away than all of the edge, or beside its box.
    #[inline(always)]
    pub fn may_be_hidden_by(&self, [a, b, c]: &[ScreenVertex; 3]) -> bool {
        let [start, end] = self.ends;
        let overlaps = |k: usize, a: i32, b: i32, c: i32| {
            let (low, high) = (a.min(b).min(c) as f32, a.max(b).max(c) as f32);
            (low <= start[k].max(end[k])) & (high >= start[k].min(end[k]))
        };
        (a.z.max(b.z).max(c.z) * NEARER_RATIO > self.farthest())
            & overlaps(0, a.x, b.x, c.x)
            & overlaps(1, a.y, b.y, c.y)
    }

    /// Depth at `t` of the way.
    #[inline(always)]
    pub fn depth(&self, t: f32) -> f32 {
        self.depths[0] + t * (self.depths[1] - self.depths[0])
    }

    /// The point at `t` of the way, pixels from the picture's upper left corner.
    #[inline(always)]
    pub fn point(&self, t: f32) -> [f32; 2] {
        [self.start[0] + t * self.along[0], self.start[1] + t * self.along[1]]
    }

    /// The axis that the edge runs across more than along.
    #[inline(always)]
    pub fn across(&self) -> [i32; 2] {
        if self.along[0].abs() >= self.along[1].abs() { [0, 1] } else { [1, 0] }
    }

    /// Collects the pixels that the edge passes in a range of it, in steps of half a pixel. A pixel
    /// may occur twice.
    #[inline(always)]
    pub fn pixels(&self, [from, to]: [f32; 2], pixels: &mut Vec<[i32; 2]>) {
        pixels.clear();
        let steps = (self.length * (to - from) * 2.0) as u32 + 1;
        let step = 0.5 * self.inverse_length;
        let mut last = [i32::MIN; 2];
        let mut first = 0;
        while first <= steps {
            let (mut x, mut y) = ([0; LANES], [0; LANES]);
            for l in 0..LANES {
                let at = self.point((from + (first + l as u32) as f32 * step).min(to));
                (x[l], y[l]) = (floor(at[0]), floor(at[1]));
            }
            for l in 0..LANES.min((steps - first) as usize + 1) {
                let pixel = [x[l], y[l]];
                if pixel != last {
                    pixels.push(pixel);
                    last = pixel;
                }
            }
            first += LANES as u32;
        }
    }

    /// The pixels of [`Segment::pixels`], one by one.
    #[inline(always)]
    pub fn walk(&self, [from, to]: [f32; 2]) -> Walk {
        let steps = (self.length * (to - from) * 2.0) as u32 + 1;
        Walk { segment: *self, from, to, step: 0.5 * self.inverse_length, next: 0, steps, last: [i32::MIN; 2] }
    }
}

/// Steps of half a pixel along an edge.
pub struct Walk {
    segment: Segment,
    from: f32,
    to: f32,
    step: f32,
    next: u32,
    steps: u32,
    last: [i32; 2],
}

impl Iterator for Walk {
    type Item = [i32; 2];

    #[inline(always)]
    fn next(&mut self) -> Option<[i32; 2]> {
        while self.next <= self.steps {
            let at = self.segment.point((self.from + self.next as f32 * self.step).min(self.to));
            let pixel = at.map(floor);
            self.next += 1;
            if pixel != self.last {
                self.last = pixel;
                return Some(pixel);
            }
        }
        None
    }
}

/// The largest integer that is not greater: left of and above the picture there are pixels too.
/// Nothing on screen is as far away as 2^22.
#[inline(always)]
fn floor(v: f32) -> i32 {
    let nearest = round_to_i32(v);
    nearest - i32::from(nearest as f32 > v)
}

/// First and last row, from `first` to before `end`, that a line between these heights may touch;
/// empty if first > last.
#[inline(always)]
pub fn rows(a: f32, b: f32, reach: f32, [first, end]: [i32; 2]) -> [i32; 2] {
    let reach = reach + SLACK_PX;
    [((a.min(b) - reach) as i32).max(first), ((a.max(b) + reach) as i32).min(end - 1)]
}

fn clip(context: &RasterContext<'_>, edge: &Edge) -> Option<[ScreenVertex; 2]> {
    let projection = &context.plan.projection;
    // A plan without clipping draws nothing that is outside, neither edges nor triangles.
    if !projection.clip {
        return None;
    }
    clip_segment(projection, edge.vertices.map(|v| homogeneous(projection, context.plan.positions[v as usize])))
}
