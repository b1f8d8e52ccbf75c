//! Hidden-line removal (stage lines): it finds the intervals of an edge that triangles hide, and from them the
//! visible ones, of which very short ones are dropped. Twin of `shaders/lines/hidden_lines.wgsl`.
//!
//! On screen an edge and a triangle are straight and their depths are affine, so what a triangle hides of an edge is
//! an interval. Candidates are the triangles that the visibility buffer (the nearest triangle of each sample) shows
//! along the edge. If these hide a part of it, the triangles up to a pixel beside it are candidates, too.

use super::candidates::Candidates;
use super::contour::volume;
use super::coplanar::HidingTriangle;
use super::farthest::Farthest;
use super::segment::Segment;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::clip::is_moderate;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::backend::cpu::geometry::steepness::{Corner, NEARER_RATIO, corner, is_far, sides, steepness};
use crate::backend::cpu::geometry::transform::{ScreenVertex, homogeneous, recip};
use crate::backend::cpu::geometry::visibility::area;
use crate::plan::{Edge, LinePass};

/// Largest position error on screen, 1/256 px: half a unit each for the snapping of a triangle and
/// of an edge, and some for f32. A surface hides an edge only if it is nearer even when moved this
/// far down its slope. Otherwise rounding would decide whether edges in its plane are hidden, such
/// as the foot of an object that stands on it.
pub const SNAP_ERROR: f32 = 1.25;

/// Shortest visible interval, pixels. Shorter ones come from rounding, and their round ends would
/// show as dots. A face without a sample may hide longer ones: see [`Parts`].
pub const INTERVAL_MIN_PX: f32 = 1.0 / 16.0;

/// Shortest visible interval between two hidden ones, pixels.
pub const GAP_MIN_PX: f32 = 1.0 / 4.0;

/// Intervals along an edge in which something hides it, kept from edge to edge.
#[derive(Default)]
pub struct HiddenIntervals {
    pub(super) hidden: Vec<[f32; 2]>,
    /// Pixels along the edge.
    pixels: Vec<[i32; 2]>,
}

impl HiddenIntervals {
    /// Finds the hidden intervals of a range of the edge (0 to 1).
    #[inline(always)]
    pub fn find(
        &mut self,
        (context, band, farthest): (&RasterContext<'_>, &SampleBand, &mut Farthest),
        edge: &Edge,
        segment: &Segment,
        range: [f32; 2],
    ) {
        self.hidden.clear();
        segment.pixels(range, &mut self.pixels);
        if self.is_fully_hidden((context, band, farthest), segment) {
            self.hidden.push(range);
            return;
        }
        self.collect_around(context, band, (edge, segment), range, 0);
        if !self.hidden.is_empty() && self.hidden[0] != range {
            // Where an edge passes under another surface, a sliver of that may have its samples
            // only beside the edge.
            let beyond = segment.inverse_length;
            segment.pixels([range[0] - beyond, range[1] + beyond], &mut self.pixels);
            self.collect_around(context, band, (edge, segment), range, 1);
        }
        if self.hidden.len() > 1 {
            self.hidden.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        }
    }

    /// True if every triangle visible along the edge is nearer than all of it: then intervals need
    /// not be computed.
    #[inline(always)]
    fn is_fully_hidden(
        &self,
        (context, band, farthest): (&RasterContext<'_>, &SampleBand, &mut Farthest),
        segment: &Segment,
    ) -> bool {
        let nearest = segment.nearest() * NEARER_RATIO;
        let mut any = false;
        for &[x, y] in &self.pixels {
            if band.has(x, y) {
                any = true;
                if farthest.at((context, band), [x, y]) <= nearest {
                    return false;
                }
            }
        }
        any
    }

    /// Collects the hidden intervals of each triangle that is visible along the edge or within
    /// `radius` pixels of it.
    #[inline(always)]
    fn collect_around(
        &mut self,
        context: &RasterContext<'_>,
        band: &SampleBand,
        (edge, segment): (&Edge, &Segment),
        range: [f32; 2],
        radius: i32,
    ) {
        let mut candidates = Candidates::new();
        let across = segment.across();
        let mut last = NOTHING;
        for i in 0..self.pixels.len() {
            let [x, y] = self.pixels[i];
            for away in -radius..=radius {
                let [x, y] = [x + away * across[0], y + away * across[1]];
                if !band.has(x, y) {
                    continue;
                }
                for &id in band.pixel(x, y).0 {
                    // Most samples show the edge's own faces, which do not hide it.
                    if (id == edge.faces[0]) | (id == edge.faces[1]) | (id == last) {
                        continue;
                    }
                    last = id;
                    if candidates.push(id)
                        && self.examine((context, edge, segment), candidates.take(context, edge, segment), range)
                    {
                        return;
                    }
                }
            }
        }
        self.examine((context, edge, segment), candidates.take(context, edge, segment), range);
    }

    /// Collects the intervals that triangles hide; true if one of them hides all of the range.
    #[inline(always)]
    fn examine(
        &mut self,
        (context, edge, segment): (&RasterContext<'_>, &Edge, &Segment),
        triangles: impl Iterator<Item = u32>,
        range: [f32; 2],
    ) -> bool {
        for id in triangles {
            let Some([start, end]) = hidden_by(context, edge, segment, id) else { continue };
            let (start, end) = (start.max(range[0]), end.min(range[1]));
            if [start, end] == range {
                self.hidden.clear();
                self.hidden.push(range);
                return true;
            }
            if start < end {
                self.hidden.push([start, end]);
            }
        }
        false
    }

    /// Appends the visible intervals of the range to `intervals`, in order.
    #[inline(always)]
    pub fn visible(&self, parts: &Parts<'_>, range: [f32; 2], intervals: &mut Vec<[f32; 2]>) {
        if self.hidden.is_empty() {
            intervals.push(range);
            return;
        }
        let mut from = range[0];
        for &[start, end] in &self.hidden {
            if parts.are_shown([from, start], if from > range[0] { GAP_MIN_PX } else { INTERVAL_MIN_PX }) {
                intervals.push([from, start]);
            }
            from = from.max(end);
        }
        if parts.are_shown([from, range[1]], INTERVAL_MIN_PX) {
            intervals.push([from, range[1]]);
        }
    }
}

/// Parts of an edge beside hidden ones.
pub struct Parts<'a> {
    pub context: &'a RasterContext<'a>,
    pub lines: &'a LinePass,
    pub band: &'a SampleBand,
    pub edge: &'a Edge,
    pub segment: &'a Segment,
}

impl Parts<'_> {
    /// True if such a part is visible. One below the smallest length is not, and neither is one so short that a
    /// face there may have no sample, if the samples around it show what is nearer.
    #[inline(always)]
    fn are_shown(&self, [start, end]: [f32; 2], least_px: f32) -> bool {
        let (length, px) = (end - start, self.segment.inverse_length);
        let unseen = px * self.lines.unseen_part_px(self.context.plan.samples);
        length > px * least_px && (length > unseen || !self.are_behind_samples([start, end]))
    }

    /// True if no sample of the pixel in the middle of an interval shows one of the edge's own faces, and all but at
    /// most [`LinePass::farther_samples_max`] show faces nearer than it.
    fn are_behind_samples(&self, [start, end]: [f32; 2]) -> bool {
        let [x, y] = self.segment.point((start + end) * 0.5).map(|v| v.floor() as i32);
        if !self.band.has(x, y) {
            return false;
        }
        let nearest = self.segment.depth(start).max(self.segment.depth(end)) * NEARER_RATIO;
        let (ids, depths) = self.band.pixel(x, y);
        let nearer = depths.iter().filter(|depth| **depth > nearest).count() as u32;
        let samples = self.context.plan.samples;
        nearer + self.lines.farther_samples_max(samples) >= samples
            && !ids.iter().any(|id| self.edge.faces.contains(id) & (*id != NOTHING))
    }
}

/// Interval of the edge that the triangle hides.
#[inline(always)]
pub(super) fn hidden_by(context: &RasterContext<'_>, edge: &Edge, segment: &Segment, id: u32) -> Option<[f32; 2]> {
    let vertices = context.triangle(id);
    if edge.vertices.iter().all(|v| vertices.contains(v)) {
        return None;
    }
    let on_screen = context.screen_triangle(id);
    let corners: [Corner; 3];
    let is_clockwise;
    if on_screen.iter().any(ScreenVertex::is_outside) {
        if context.is_hull(id) || !context.plan.projection.clip {
            return None;
        }
        corners = vertices.map(|v| homogeneous(&context.plan.projection, context.plan.positions[v as usize]));
        if !corners.iter().all(is_moderate) {
            return None;
        }
        is_clockwise = volume(&corners) > 0.0;
    } else {
        let [a, b, c] = &on_screen;
        corners = [corner(a), corner(b), corner(c)];
        let area = area(&on_screen);
        if area == 0 || !segment.may_be_hidden_by(&on_screen) {
            return None;
        }
        is_clockwise = area > 0;
    }
    let [start, end] = segment.ends();
    let sides = [sides(&corners, start, is_clockwise), sides(&corners, end, is_clockwise)];
    let range = inside(&sides)?;
    let slack = slack(&corners)?;
    // Depths are compared only where the edge is inside, so that thin triangles need not be
    // continued far.
    let nearer = |t: f32, ratio: f32, slack: f32| {
        let [a, b, c] = weights(&sides, t);
        let z = (a * corners[0][2] + b * corners[1][2]) + c * corners[2][2];
        let w = (a * corners[0][3] + b * corners[1][3]) + c * corners[2][3];
        if w > f32::MIN_POSITIVE { (z * recip(w) - segment.depth(t) * ratio) - slack } else { -1.0 }
    };
    let mut nearer_by = range.map(|t| nearer(t, NEARER_RATIO, slack));
    if nearer_by[0].min(nearer_by[1]) <= 0.0 {
        let perhaps_by = range.map(|t| nearer(t, 2.0 - NEARER_RATIO, -slack));
        if perhaps_by[0].max(perhaps_by[1]) <= 0.0 {
            return None;
        }
        let triangle = HidingTriangle { id, corners, is_clockwise, slack };
        if triangle.has_beneath(context, edge, weights(&sides, 0.5 * (range[0] + range[1]))) {
            nearer_by = perhaps_by;
        }
    }
    let mut interval = [0.0, 1.0];
    narrow(&mut interval, nearer_by)?;
    let length = range[1] - range[0];
    Some([range[0] + interval[0] * length, range[0] + interval[1] * length])
}

/// The part of an edge that is inside of a triangle on screen, given what its ends span with its sides.
#[inline(always)]
fn inside(sides: &[[f32; 3]; 2]) -> Option<[f32; 2]> {
    // An edge along a side counts as inside. Otherwise two triangles that share the side would
    // leave it visible between them.
    let is_along = |k: usize| (sides[0][k] == 0.0) & (sides[1][k] == 0.0);
    for k in 0..3 {
        if (sides[0][k] <= 0.0) & (sides[1][k] <= 0.0) & !is_along(k) {
            return None;
        }
    }
    let mut range = [0.0, 1.0];
    for k in 0..3 {
        if !is_along(k) {
            narrow(&mut range, [sides[0][k], sides[1][k]])?;
        }
    }
    Some(range)
}

/// Weights of the corners at `t` of the way along an edge whose ends have these: not negative.
#[inline(always)]
fn weights(sides: &[[f32; 3]; 2], t: f32) -> [f32; 3] {
    std::array::from_fn(|k| (sides[0][k] + t * (sides[1][k] - sides[0][k])).max(0.0))
}

/// Depth error of a triangle's plane due to snapping; None without area.
#[inline(always)]
fn slack(corners: &[Corner; 3]) -> Option<f32> {
    if is_far(corners) { Some(0.0) } else { Some(steepness(corners)? * SNAP_ERROR) }
}

/// Cuts a range down to where the affine function with these values at 0 and 1 is positive.
#[inline(always)]
fn narrow(range: &mut [f32; 2], at: [f32; 2]) -> Option<()> {
    if at[0] <= 0.0 && at[1] <= 0.0 {
        return None;
    }
    if at[0] < 0.0 {
        range[0] = range[0].max(-at[0] * recip(at[1] - at[0]));
    } else if at[1] < 0.0 {
        range[1] = range[1].min(at[0] * recip(at[0] - at[1]));
    }
    (range[0] < range[1]).then_some(())
}
