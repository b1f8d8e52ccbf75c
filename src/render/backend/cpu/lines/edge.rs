//! The drawing of an edge as a line of exact width (stage lines). Twin of `shaders/lines/edge.wgsl`.
//!
//! A line is all that lies within half its width of the parts of an edge that are drawn: all, or only the visible
//! ones, which [`hidden_lines`](super::hidden_lines) finds. Each part is a [`stroke`], and in
//! each pixel the union of all strokes counts ([`coverage`](super::coverage)). Where something may hide them, long
//! edges are processed in windows, which are stretches of some pixels, so that a pixel's lines depend only on what is
//! near it.

use super::farthest::Farthest;
use super::holes::Holes;
use super::segment::{PixelBox, SLACK_PX, Segment, rows};
use super::stroke::{self, Direction, Mask, Pen, PixelDistances, Places};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::transform::recip;
use crate::backend::cpu::isa::LANES;
use crate::backend::cpu::lines::coverage::BandStrokes;
use crate::backend::cpu::lines::hidden_lines::{HiddenIntervals, Parts};
use crate::plan::{Edge, LinePass};

/// Output of a line pass: rows of a band.
pub struct LineTarget<'a> {
    /// Strokes per pixel.
    pub strokes: &'a mut BandStrokes,
    /// Per pixel, the face that lights its lines, plus 1; empty where no lines are lit.
    pub owners: &'a mut [u32],
    /// Per pixel, the depth of its nearest line; empty where no layers tint lines.
    pub depths: &'a mut [f32],
    /// The pass's holes. If there are any, only some pixels get strokes.
    pub holes: &'a mut Holes,
}

impl LineTarget<'_> {
    /// True if one more stroke at this depth changes nothing in a pixel. A full pixel stays full; but a lit line still
    /// looks for the face that lights it, and one that layers tint for the nearest depth.
    #[inline(always)]
    fn is_done(&self, at: usize, owner: u32, depth: impl Fn() -> f32) -> bool {
        owner == 0 && self.strokes.is_full(at) && self.depths.get(at).is_none_or(|nearest| depth() <= *nearest)
    }

    /// Notes what lights a pixel's line, if something does, and how deep the line is.
    #[inline(always)]
    pub fn note(&mut self, at: usize, owner: u32, depth: f32) {
        if owner > 0 {
            self.owners[at] = self.owners[at].max(owner);
        }
        if let Some(nearest) = self.depths.get_mut(at) {
            *nearest = nearest.max(depth);
        }
    }
}

/// The parts of edges that are drawn at a time.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Drawn {
    /// All.
    Whole,
    /// Those that no surface hides.
    Visible,
}

/// Draws the edges of a pass into a band.
pub struct LineDrawer<'a> {
    context: &'a RasterContext<'a>,
    lines: &'a LinePass,
    pub(super) band: &'a SampleBand,
    farthest: &'a mut Farthest,
    /// Rows of the picture that are drawn.
    pub(super) rows: [i32; 2],
    pub(super) pen: Pen,
    /// The edge's direction.
    pub(super) direction: Direction,
    /// Windows per pixel of an edge's length.
    windows: f32,
    /// True if parts that a surface hides are left out.
    hides: bool,
    hidden: HiddenIntervals,
    /// True if the edges are rims: they are drawn everywhere, and mark the pixels that they reach.
    pub marks: bool,
    /// Pixels since the last deadline poll.
    pixels_since_poll: u64,
    /// Drawn intervals of the edge in the window.
    intervals: Vec<[f32; 2]>,
}

impl<'a> LineDrawer<'a> {
    /// A drawer for a pass and the rows of a band that are shown. It draws the visible parts of edges, or all of them.
    pub fn new(
        context: &'a RasterContext<'a>,
        (lines, parts): (&'a LinePass, Drawn),
        (band, farthest): (&'a SampleBand, &'a mut Farthest),
    ) -> Self {
        // Without a surface nothing hides a line, and there is no visibility buffer to read.
        let something_hides = context.plan.surface.is_some() || context.plan.hull.is_some();
        Self {
            context,
            lines,
            band,
            farthest,
            rows: band.shown.map(|row| row as i32),
            pen: Pen::new(context.isa, lines),
            direction: Direction::new(),
            windows: 1.0 / lines.window_px(),
            hides: something_hides && parts == Drawn::Visible,
            hidden: HiddenIntervals::default(),
            marks: false,
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
    pub fn draw(&mut self, edge: &Edge, target: &mut LineTarget<'_>) {
        let Some(segment) = Segment::new(self.context, edge) else { return };
        let mut has_direction = false;
        let owner =
            if self.lines.lit && !target.owners.is_empty() { self.context.lighting_face(self.lines, edge) } else { 0 };
        let windows = if self.hides { (segment.length * self.windows) as u32 + 1 } else { 1 };
        let step = recip(windows as f32);
        for window in 0..windows {
            let range = [window as f32 * step, (window + 1) as f32 * step];
            let [a, b] = range.map(|t| segment.point(t));
            let [first, last] = rows(a[1], b[1], self.pen.reach, self.rows);
            if first > last
                || (windows > 1
                    && self.only_stroked(target)
                    && !self.may_touch_stroked([a[0], b[0]], [first, last], target.holes))
                || !self.collect_intervals(edge, &segment, range)
            {
                continue;
            }
            if !has_direction {
                self.direction.set(&self.pen, segment.along);
                has_direction = true;
            }
            let window = Window { segment: &segment, ends: [a, b], number: window, count: windows };
            for i in 0..self.intervals.len() {
                let piece = Piece::new(&segment, self.intervals[i]);
                if self.context.is_plain() {
                    self.draw_piece_plainly(&window, &piece, owner, target);
                } else {
                    self.draw_piece(&window, &piece, owner, target);
                }
            }
        }
    }

    /// True if only the pixels that points do not tell about get strokes.
    #[inline(always)]
    fn only_stroked(&self, target: &LineTarget<'_>) -> bool {
        !self.marks && !target.holes.is_empty()
    }

    /// True if a pixel within the line's reach gets strokes. If it is a rim's, it is marked.
    #[inline(always)]
    pub(super) fn may_draw(&self, pixel: usize, holes: &mut Holes) -> bool {
        if self.marks {
            holes.mark(pixel);
        }
        self.marks || holes.is_stroked(pixel)
    }

    /// False if no pixel in the box around an edge gets strokes: found without looking at the edge.
    #[inline(always)]
    pub fn may_draw_in(&self, pixels: Option<&PixelBox>, target: &LineTarget<'_>) -> bool {
        if self.context.is_plain() || !self.only_stroked(target) {
            return true;
        }
        pixels.is_none_or(|pixels| {
            let [columns, rows] = pixels.map(|range| range.map(i32::from));
            target.holes.any_stroked(columns, rows)
        })
    }

    /// False if no pixel between these heights and around these places gets strokes.
    #[inline(always)]
    fn may_touch_stroked(&self, [a, b]: [f32; 2], rows: [i32; 2], holes: &Holes) -> bool {
        let reach = self.pen.reach + SLACK_PX;
        holes.any_stroked([(a.min(b) - reach) as i32, (a.max(b) + reach) as i32], rows)
    }

    /// Draws a piece of an edge into the pixels that the window owns.
    #[inline(always)]
    fn draw_piece(&mut self, window: &Window<'_>, piece: &Piece, owner: u32, target: &mut LineTarget<'_>) {
        let [a, b] = piece.ends;
        let width_px = self.band.size_px[0];
        let area = Footprint::new(window, [a, b], self.pen.reach);
        let [first, last] = area.rows(self.rows);
        for y in first..=last {
            let row = (y - self.rows[0]) as usize * width_px as usize;
            let [from, to] = area.columns(y, width_px);
            self.pixels_since_poll += u64::from((to - from).max(0) as u32);
            let mut x = from;
            while x <= to {
                let centers = [x as f32 + 0.5, y as f32 + 0.5];
                let places = Places::new(&self.direction, [a, b], centers);
                let mut touched = places.within(self.pen.reach) & lanes_up_to(to - x);
                while touched != 0 {
                    let l = touched.trailing_zeros() as usize % LANES;
                    touched &= touched - 1;
                    let (at, center) = (row + x as usize + l, [centers[0] + l as f32, centers[1]]);
                    let place = places.of(l);
                    if target.is_done(at, owner, || piece.depth(window.segment, &place))
                        || !window.owns(center)
                        || !self.may_draw(at, target.holes)
                    {
                        continue;
                    }
                    let ends = [[a[0] - center[0], a[1] - center[1]], [b[0] - center[0], b[1] - center[1]]];
                    let mut mask = Mask::default();
                    if let Some(amount) = stroke::cover(&self.pen, &self.direction, ends, &place, &mut mask) {
                        target.strokes.add(at, amount, &mask, self.pen.peak);
                        target.note(at, owner, piece.depth(window.segment, &place));
                    }
                }
                x += LANES as i32;
            }
        }
    }

    /// Collects the drawn intervals of an edge in a window, and as far beyond as the line touches
    /// the window's pixels. False if there are none.
    #[inline(always)]
    fn collect_intervals(&mut self, edge: &Edge, segment: &Segment, range: [f32; 2]) -> bool {
        self.intervals.clear();
        if !self.hides {
            self.intervals.push(range);
            return true;
        }
        let beyond = (self.pen.reach + 1.0) * segment.inverse_length;
        let range = [(range[0] - beyond).max(0.0), (range[1] + beyond).min(1.0)];
        if self.context.is_plain() {
            self.hidden.find_plainly((self.context, self.band), (edge, segment), range);
        } else {
            self.hidden.find((self.context, self.band, &mut *self.farthest), edge, segment, range);
        }
        let parts = Parts { context: self.context, lines: self.lines, band: self.band, edge, segment };
        self.hidden.visible(&parts, range, &mut self.intervals);
        !self.intervals.is_empty()
    }
}

/// A piece of an edge.
pub(super) struct Piece {
    /// The interval of the edge, 0 to 1.
    range: [f32; 2],
    /// Its ends on screen, pixels from the picture's upper left corner.
    pub(super) ends: [[f32; 2]; 2],
}

impl Piece {
    #[inline(always)]
    fn new(segment: &Segment, range: [f32; 2]) -> Self {
        Self { range, ends: range.map(|t| segment.point(t)) }
    }

    /// The depth in the point of the piece that is nearest to a pixel's centre.
    #[inline(always)]
    pub(super) fn depth(&self, segment: &Segment, place: &PixelDistances) -> f32 {
        let t = self.range[0] + place.past_start() * segment.inverse_length;
        segment.depth(t.max(self.range[0]).min(self.range[1]))
    }
}

/// A piece of an edge, and the pixels whose centres are nearest to it.
pub(super) struct Window<'a> {
    pub(super) segment: &'a Segment,
    ends: [[f32; 2]; 2],
    number: u32,
    count: u32,
}

impl Window<'_> {
    /// True if the pixel belongs to this window of the edge.
    #[inline(always)]
    pub(super) fn owns(&self, center: [f32; 2]) -> bool {
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

/// Bits of the lanes from the first to one.
#[inline(always)]
fn lanes_up_to(lane: i32) -> u32 {
    if lane < LANES as i32 - 1 { (2 << lane) - 1 } else { u32::MAX }
}

/// The pixels that a piece of an edge may touch.
struct Footprint {
    low: [f32; 2],
    high: [f32; 2],
    /// A point of the line, the change of x per row, and how far a row's pixels lie from the line;
    /// infinitely far if the line is level.
    point: [f32; 2],
    slope: f32,
    spread: f32,
}

impl Footprint {
    #[inline(always)]
    fn new(window: &Window<'_>, [a, b]: [[f32; 2]; 2], reach: f32) -> Self {
        let reach = reach + SLACK_PX;
        let [c, d] = window.ends;
        let along = window.segment.along;
        // A steep or slanted line touches only a short piece of each row.
        let is_level = along[1] * along[1] <= 1e-6;
        let slope = if is_level { 0.0 } else { along[0] / along[1] };
        Self {
            low: std::array::from_fn(|k| a[k].min(b[k]).max(c[k].min(d[k])) - reach),
            high: std::array::from_fn(|k| a[k].max(b[k]).min(c[k].max(d[k])) + reach),
            point: a,
            slope,
            spread: if is_level { f32::INFINITY } else { reach * (1.0 + slope * slope).sqrt() },
        }
    }

    /// First and last row, of these; empty if first > last.
    #[inline(always)]
    fn rows(&self, [first, end]: [i32; 2]) -> [i32; 2] {
        [(self.low[1] as i32).max(first), (self.high[1] as i32).min(end - 1)]
    }

    /// First and last column in a row; empty if first > last.
    #[inline(always)]
    fn columns(&self, y: i32, width_px: u32) -> [i32; 2] {
        let center = self.point[0] + (y as f32 + 0.5 - self.point[1]) * self.slope;
        let (low, high) = (self.low[0].max(center - self.spread), self.high[0].min(center + self.spread));
        [(low as i32).max(0), (high as i32).min(width_px as i32 - 1)]
    }
}
