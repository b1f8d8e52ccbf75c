//! Stage lines, per edge: lines of exact width. Twin of `shaders/lines/edge.wgsl`.
//!
//! A line is all that lies within half its width of the visible parts of an edge
//! ([`hidden_lines`](super::hidden_lines)): a stroke for each part ([`stroke`]), and in each pixel
//! their union ([`coverage`](super::coverage)). Long edges are processed in windows, so that a
//! pixel's lines depend only on what is near it.

use super::segment::{SLACK_PX, Segment, rows};
use super::stroke::{self, Direction, Pen};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::transform::recip;
use crate::backend::cpu::lines::coverage::LineCoverage;
use crate::backend::cpu::lines::hidden_lines::HiddenIntervals;
use crate::plan::{Edge, LinePass, Shown};

/// Output of a line pass: rows of a band.
pub struct LineTarget<'a> {
    /// Line coverage per pixel.
    pub coverage: &'a mut [LineCoverage],
    /// Per pixel, the face that lights its lines, plus 1; empty where no lines are lit.
    pub owners: &'a mut [u32],
}

/// Draws the edges of a pass into a band.
pub struct LineDrawer<'a> {
    context: &'a RasterContext<'a>,
    lines: &'a LinePass,
    band: &'a SampleBand,
    /// Rows of the picture that are drawn.
    rows: [i32; 2],
    pen: Pen,
    /// Windows per pixel of an edge's length.
    windows: f32,
    /// True if a surface may hide a line.
    is_hidden: bool,
    hidden: HiddenIntervals,
    /// Pixels since the last deadline poll.
    pixels_since_poll: i32,
    /// Shown intervals of the edge in the window.
    intervals: Vec<[f32; 2]>,
}

impl<'a> LineDrawer<'a> {
    /// A drawer for a pass and the picture rows from `rows[0]` to before `rows[1]`.
    pub fn new(context: &'a RasterContext<'a>, lines: &'a LinePass, band: &'a SampleBand, rows: [u32; 2]) -> Self {
        // Without a surface nothing hides a line, and there is no visibility buffer to read.
        let something_hides = context.plan.surface.is_some() || context.plan.hull.is_some();
        Self {
            context,
            lines,
            band,
            rows: rows.map(|row| row as i32),
            pen: Pen::new(lines),
            windows: 1.0 / lines.window_px(),
            is_hidden: something_hides && lines.shown != Shown::All,
            hidden: HiddenIntervals::default(),
            pixels_since_poll: 0,
            intervals: Vec::new(),
        }
    }

    /// True after so many pixels that the deadline is to be polled; then counts from 0 again.
    #[inline(always)]
    pub fn is_poll_due(&mut self) -> bool {
        let is_far = self.pixels_since_poll > 100_000;
        if is_far {
            self.pixels_since_poll = 0;
        }
        is_far
    }

    /// Draws one edge.
    #[inline(always)]
    pub fn draw(&mut self, edge: &Edge, LineTarget { coverage, owners }: &mut LineTarget<'_>) {
        let Some(segment) = Segment::new(self.context, edge) else { return };
        let mut direction = None;
        let owner = if self.lines.lit && !owners.is_empty() { self.context.lighting_face(self.lines, edge) } else { 0 };
        let windows = if self.is_hidden { (segment.length * self.windows) as u32 + 1 } else { 1 };
        let step = recip(windows as f32);
        for window in 0..windows {
            let range = [window as f32 * step, (window + 1) as f32 * step];
            let [a, b] = range.map(|t| segment.point(t));
            let [first, last] = rows(a[1], b[1], self.pen.reach, self.rows);
            if first > last || !self.collect_intervals(edge, &segment, range) {
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
                self.pixels_since_poll += (to - from).max(0);
                for x in from..=to {
                    let at = row + x as usize;
                    let center = [x as f32 + 0.5, y as f32 + 0.5];
                    // A full pixel stays full. Only a lit line goes on, to find the face that
                    // lights it.
                    if (owner == 0 && coverage[at].is_full()) || !windowed.owns(center) {
                        continue;
                    }
                    let [low, high] = windowed.reached(center, self.pen.reach);
                    for &[from, to] in &self.intervals {
                        if to < low {
                            continue;
                        }
                        if from > high {
                            break;
                        }
                        let (a, b) = (segment.point(from), segment.point(to));
                        let ends = [[a[0] - center[0], a[1] - center[1]], [b[0] - center[0], b[1] - center[1]]];
                        if let Some((area, mask)) = stroke::cover(&self.pen, direction, ends) {
                            coverage[at].add(area, &mask, self.pen.peak);
                            if owner > 0 {
                                owners[at] = owners[at].max(owner);
                            } else if coverage[at].is_full() {
                                break;
                            }
                        }
                    }
                }
            }
        }
    }

    /// Collects the shown intervals of an edge in a window, and as far beyond as the line touches
    /// the window's pixels. False if there are none.
    #[inline(always)]
    fn collect_intervals(&mut self, edge: &Edge, segment: &Segment, range: [f32; 2]) -> bool {
        self.intervals.clear();
        if !self.is_hidden {
            self.intervals.push(range);
            return true;
        }
        let beyond = (self.pen.reach + 1.0) * segment.inverse_length;
        let range = [(range[0] - beyond).max(0.0), (range[1] + beyond).min(1.0)];
        self.hidden.find((self.context, self.band), edge, segment, range);
        if self.lines.shown == Shown::Visible {
            self.hidden.visible(range, segment.inverse_length, &mut self.intervals);
        } else {
            self.hidden.hidden(&mut self.intervals);
        }
        !self.intervals.is_empty()
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

    /// Range of the edge that may reach a pixel, with a margin: intervals beyond it are skipped.
    #[inline(always)]
    fn reached(&self, center: [f32; 2], reach: f32) -> [f32; 2] {
        let s = self.segment;
        let from_start = [center[0] - s.start[0], center[1] - s.start[1]];
        let way = (from_start[0] * s.along[0] + from_start[1] * s.along[1]) * s.inverse_length;
        [(way - reach - 1.0) * s.inverse_length, (way + reach + 1.0) * s.inverse_length]
    }

    /// True if the pixel belongs to this window of the edge.
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
