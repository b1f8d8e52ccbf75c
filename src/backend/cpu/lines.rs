//! Stage 4, an edge: lines of exact width. Twin of `shaders/lines.wgsl`.
//!
//! A line is all that lies within half its width of the visible parts of an edge ([`hiding`](super::hiding)): a stroke for
//! each part ([`stroke`](super::stroke)), and in each pixel their union ([`ink`](super::ink)). What is visible of an edge close
//! to a pixel is found close to it: long edges are looked at in windows.

use super::Stages;
use super::clip::clip_segment;
use super::hiding::Hiding;
use super::ink::Ink;
use super::samples::SampleBand;
use super::stroke::{self, Direction, Pen};
use super::transform::{ScreenVertex, homogeneous, recip, rsqrt};
use crate::plan::{Edge, LinePass, Shown};

/// Slack for roundings where only too much is harmless, pixels.
const SLACK_PX: f32 = 0.05;

/// An edge on screen.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Ends, in 1/256 px from the picture's centre.
    ends: [[f32; 2]; 2],
    depths: [f32; 2],
    /// First end, pixels from the picture's upper left corner, and the way from there to the other.
    start: [f32; 2],
    along: [f32; 2],
    /// Pixels, and its inverse; 0 where it is a point.
    length: f32,
    inverse_length: f32,
}

impl Segment {
    /// None where the edge is out of the picture.
    #[inline(always)]
    pub fn new(stages: &Stages<'_>, edge: &Edge) -> Option<Self> {
        let [a, b] = edge.vertices.map(|v| stages.vertices[v as usize]);
        let [a, b] = if a.is_outside() || b.is_outside() { clip(stages, edge)? } else { [a, b] };
        let plan = stages.plan;
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

    /// Ends, in 1/256 px from the picture's centre.
    #[inline(always)]
    pub fn ends(&self) -> [[f32; 2]; 2] {
        self.ends
    }

    /// Whether the triangle is not farther away than all of the edge, nor beside its box.
    #[inline(always)]
    pub fn may_lie_behind(&self, [a, b, c]: &[ScreenVertex; 3]) -> bool {
        let [start, end] = self.ends;
        let overlaps = |k: usize, a: i32, b: i32, c: i32| {
            let (low, high) = (a.min(b).min(c) as f32, a.max(b).max(c) as f32);
            (low <= start[k].max(end[k])) & (high >= start[k].min(end[k]))
        };
        (a.z.max(b.z).max(c.z) > self.depths[0].min(self.depths[1]))
            & overlaps(0, a.x, b.x, c.x)
            & overlaps(1, a.y, b.y, c.y)
    }

    /// One over its length in pixels; 0 where it is a point.
    #[inline(always)]
    pub fn inverse_length(&self) -> f32 {
        self.inverse_length
    }

    /// Depth at `t` of the way.
    #[inline(always)]
    pub fn depth(&self, t: f32) -> f32 {
        self.depths[0] + t * (self.depths[1] - self.depths[0])
    }

    /// The point at `t` of the way, pixels from the picture's upper left corner.
    #[inline(always)]
    fn point(&self, t: f32) -> [f32; 2] {
        [self.start[0] + t * self.along[0], self.start[1] + t * self.along[1]]
    }

    /// The axis that the edge runs across more than along.
    #[inline(always)]
    pub fn across(&self) -> [u32; 2] {
        if self.along[0].abs() >= self.along[1].abs() { [0, 1] } else { [1, 0] }
    }

    /// The pixels that the edge passes in a range of it, some twice.
    #[inline(always)]
    pub fn walk(&self, [from, to]: [f32; 2]) -> Walk {
        let steps = (self.length * (to - from) * 2.0) as u32 + 1;
        Walk { segment: *self, from, to, step: 0.5 * self.inverse_length, next: 0, steps, last: [u32::MAX; 2] }
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
    last: [u32; 2],
}

impl Iterator for Walk {
    type Item = [u32; 2];

    #[inline(always)]
    fn next(&mut self) -> Option<[u32; 2]> {
        while self.next <= self.steps {
            let [x, y] = self.segment.point((self.from + self.next as f32 * self.step).min(self.to));
            self.next += 1;
            if x >= 0.0 && y >= 0.0 && [x as u32, y as u32] != self.last {
                self.last = [x as u32, y as u32];
                return Some(self.last);
            }
        }
        None
    }
}

#[inline(always)]
fn rows(a: f32, b: f32, reach: f32, [first, end]: [i32; 2]) -> [i32; 2] {
    let reach = reach + SLACK_PX;
    [((a.min(b) - reach) as i32).max(first), ((a.max(b) + reach) as i32).min(end - 1)]
}

/// Where a pass's lines go: rows of a band.
pub struct LineTarget<'a> {
    /// The strokes of each pixel.
    pub ink: &'a mut [Ink],
    /// Of each pixel, whose light falls on its lines; empty where none are lit.
    pub owners: &'a mut [u32],
}

/// Draws the edges of a pass into a band.
pub struct LineDrawer<'a> {
    stages: &'a Stages<'a>,
    lines: &'a LinePass,
    band: &'a SampleBand,
    /// Rows of the picture that are drawn.
    rows: [i32; 2],
    pen: Pen,
    /// Windows of an edge in a pixel of it.
    windows: f32,
    /// Whether something may hide a line.
    is_hidden: bool,
    hiding: Hiding,
    /// Parts of the edge in the window.
    parts: Vec<[f32; 2]>,
}

impl<'a> LineDrawer<'a> {
    /// A pass's, for the picture rows from `rows[0]` to before `rows[1]`.
    pub fn new(stages: &'a Stages<'a>, lines: &'a LinePass, band: &'a SampleBand, rows: [u32; 2]) -> Self {
        // Where there is no surface there is nothing to hide behind, and no samples to ask.
        let something_hides = stages.plan.surface.is_some() || stages.plan.hull.is_some();
        Self {
            stages,
            lines,
            band,
            rows: rows.map(|row| row as i32),
            pen: Pen::new(lines),
            windows: 1.0 / lines.window_px(),
            is_hidden: something_hides && lines.shown != Shown::All,
            hiding: Hiding::default(),
            parts: Vec::new(),
        }
    }

    /// Draws one edge.
    #[inline(always)]
    pub fn draw(&mut self, edge: &Edge, LineTarget { ink, owners }: &mut LineTarget<'_>) {
        let Some(segment) = Segment::new(self.stages, edge) else { return };
        let mut direction = None;
        let owner = if self.lines.lit && !owners.is_empty() { self.stages.lit_by(edge) } else { 0 };
        let windows = if self.is_hidden { (segment.length * self.windows) as u32 + 1 } else { 1 };
        let step = recip(windows as f32);
        for window in 0..windows {
            let range = [window as f32 * step, (window + 1) as f32 * step];
            let [a, b] = range.map(|t| segment.point(t));
            let [first, last] = rows(a[1], b[1], self.pen.reach, self.rows);
            if first > last || !self.find_parts(edge, &segment, range) {
                continue;
            }
            if direction.is_none() {
                direction = Some(Direction::new(&self.pen, segment.along));
            }
            let Some(direction) = &direction else { return };
            let windowed = Window { segment: &segment, ends: [a, b], number: window, count: windows };
            for y in first..=last {
                let row = (y - self.rows[0]) as usize * self.band.size_px[0] as usize;
                let [from, to] = windowed.columns(y, self.pen.reach, self.band.size_px[0]);
                for x in from..=to {
                    let at = row + x as usize;
                    let center = [x as f32 + 0.5, y as f32 + 0.5];
                    // What is full stays full, whatever else comes; only a lit line still asks whose it is.
                    if (owner == 0 && ink[at].is_full()) || !windowed.owns(center) {
                        continue;
                    }
                    for &[a, b] in &self.parts {
                        let (a, b) = (segment.point(a), segment.point(b));
                        let ends = [[a[0] - center[0], a[1] - center[1]], [b[0] - center[0], b[1] - center[1]]];
                        if let Some((area, mask)) = stroke::cover(&self.pen, direction, ends) {
                            ink[at].add(area, &mask);
                            if owner > 0 {
                                owners[at] = owners[at].max(owner);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Finds what is drawn of the edge in a window, and as far beyond as it touches the window's pixels; whether anything is.
    #[inline(always)]
    fn find_parts(&mut self, edge: &Edge, segment: &Segment, range: [f32; 2]) -> bool {
        self.parts.clear();
        if !self.is_hidden {
            self.parts.push(range);
            return true;
        }
        let beyond = (self.pen.reach + 1.0) * segment.inverse_length;
        let range = [(range[0] - beyond).max(0.0), (range[1] + beyond).min(1.0)];
        self.hiding.find((self.stages, self.band), edge, segment, range);
        if self.lines.shown == Shown::Visible {
            self.hiding.visible(range, segment.inverse_length, &mut self.parts);
        } else {
            self.hiding.hidden(&mut self.parts);
        }
        !self.parts.is_empty()
    }
}

/// A piece of an edge, and the pixels whose centres are nearest to it.
struct Window<'a> {
    segment: &'a Segment,
    ends: [[f32; 2]; 2],
    number: u32,
    count: u32,
}

impl Window<'_> {
    /// First and last column whose pixel centre may lie within reach in pixel row `y`.
    #[inline(always)]
    fn columns(&self, y: i32, reach: f32, width_px: u32) -> [i32; 2] {
        let reach = reach + SLACK_PX;
        let [a, b] = self.ends;
        let (mut low, mut high) = (a[0].min(b[0]) - reach, a[0].max(b[0]) + reach);
        // A steep or slanted line touches only a short piece of each row.
        let along = self.segment.along;
        if along[1] * along[1] > 1e-6 {
            let slope = along[0] / along[1];
            let center = a[0] + (y as f32 + 0.5 - a[1]) * slope;
            let spread = reach * (1.0 + slope * slope).sqrt();
            low = low.max(center - spread);
            high = high.min(center + spread);
        }
        [(low as i32).max(0), (high as i32).min(width_px as i32 - 1)]
    }

    /// Whether of all windows of the edge the pixel is this one's.
    #[inline(always)]
    fn owns(&self, center: [f32; 2]) -> bool {
        if self.count == 1 {
            return true;
        }
        let s = self.segment;
        let from_start = [center[0] - s.start[0], center[1] - s.start[1]];
        let way = (from_start[0] * s.along[0] + from_start[1] * s.along[1]) * s.inverse_length;
        let at = (way * s.inverse_length) * self.count as f32;
        // Rounds towards zero, and what is below zero to it.
        (at as u32).min(self.count - 1) == self.number
    }
}

fn clip(stages: &Stages<'_>, edge: &Edge) -> Option<[ScreenVertex; 2]> {
    let projection = &stages.plan.projection;
    clip_segment(projection, edge.vertices.map(|v| homogeneous(projection, stages.plan.positions[v as usize])))
}
