//! Culling of triangles before they are sorted into bands (ranges of pixel rows that one thread draws at a time). It
//! leaves out triangles that the pass does not draw, or not from the side that the viewer sees, and triangles that no
//! sample can show: they are seen edge-on, or lie outside the picture, or between the rows or columns of samples. Where
//! mixed pixels or fringes are drawn from the triangles, a pixel's 256 points count instead.
//!
//! Triangles that have to be clipped are listed apart. Thin ones that samples may miss are also in a list of their
//! own, if samples are adaptive: the stage mixed looks for them.

mod lanes;

use std::borrow::Cow;
use std::ops::Range;

use crate::backend::cpu::bands::lists::KeptFaces;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::SampleGrid;
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::backend::cpu::isa::{LANES, with_simd};
use crate::backend::cpu::mixed::points::POINT_GRID;
use crate::plan::{DrawPlan, Faces, pass_mask};

/// Triangles of one pass.
pub struct TrianglePass {
    /// Their ids.
    pub ids: Range<usize>,
    /// Bit that a triangle's pass mask must have; 0 for the outline mesh, which has no masks.
    pub pass_bit: u8,
    /// The faces that are drawn, where a triangle's pass mask does not say.
    pub faces: Faces,
    /// True if mixed pixels are drawn from these triangles.
    pub has_mixed: bool,
    /// True if all triangles count in which a pixel has one of its 256 points: for mixed pixels, and for fringes.
    pub has_points: bool,
}

impl TrianglePass {
    /// Drawn faces of a triangle; None if the pass does not draw it.
    #[inline(always)]
    pub fn faces_of(&self, plan: &DrawPlan<'_>, id: usize) -> Option<Faces> {
        if self.pass_bit == 0 {
            return Some(self.faces);
        }
        match plan.pass_masks.get(id) {
            None => Some(self.faces),
            Some(mask) if mask & self.pass_bit == 0 => None,
            Some(mask) if mask & pass_mask::FRONT_ONLY != 0 => Some(Faces::Front),
            Some(mask) if mask & pass_mask::BACK_ONLY != 0 => Some(Faces::Back),
            _ => Some(self.faces),
        }
    }

    /// Bits of the lanes whose fronts, and whose backs, are drawn, of so many triangles.
    #[inline(always)]
    pub fn drawn(&self, plan: &DrawPlan<'_>, first: usize, len: usize) -> [u32; 2] {
        let bits = |faces: Option<Faces>| {
            let front = matches!(faces, Some(Faces::Both | Faces::Front));
            let back = matches!(faces, Some(Faces::Both | Faces::Back));
            [u32::from(front), u32::from(back)]
        };
        if self.pass_bit == 0 || plan.pass_masks.is_empty() {
            let all = (1 << len) - 1;
            let [front, back] = bits(Some(self.faces));
            return [front * all, back * all];
        }
        let mut drawn = [0; 2];
        for l in 0..len {
            let [front, back] = bits(self.faces_of(plan, first + l));
            drawn = [drawn[0] | front << l, drawn[1] | back << l];
        }
        drawn
    }
}

/// The rectangle of the picture that has samples, and its bands.
pub struct Bounds {
    pub grid: SampleGrid,
    /// True for mixed pixels. Thin triangles are listed then, and triangles that face the viewer have boxes.
    pub has_mixed: bool,
    /// The picture's centre, 1/256 px from its corner.
    pub half: [i32; 2],
    /// Columns, and rows, that have samples.
    pub ranges: [[i32; 2]; 2],
    /// Rows of a band.
    pub rows: i32,
    /// Rows beyond a band that it sees.
    pub margin: i32,
    /// The picture's last row.
    pub row_last: i32,
}

impl Bounds {
    /// Those of a plan's picture, for a pass.
    pub fn new(plan: &DrawPlan<'_>, [rows, margin]: [u32; 2], pass: &TrianglePass) -> Self {
        Self {
            has_mixed: pass.has_mixed,
            grid: if pass.has_points { POINT_GRID } else { SampleGrid::new(plan.samples) },
            half: [plan.width_px, plan.height_px].map(|size| size as i32 * 128),
            ranges: [plan.seen_range(plan.width_px), plan.seen_range(plan.height_px)],
            rows: rows as i32,
            margin: margin as i32,
            row_last: plan.height_px as i32 - 1,
        }
    }

    /// First and last band that a triangle on screen touches, or comes as close to as `margin`
    /// rows; None if it touches no column or row of samples.
    #[inline(always)]
    pub fn bands_of(&self, v: &[ScreenVertex; 3]) -> Option<[usize; 2]> {
        let [[left, right], rows] = self.pixels_of([[v[0].x, v[1].x, v[2].x], [v[0].y, v[1].y, v[2].y]]);
        let [top, bottom] = self.with_margin(rows);
        (left <= right && top <= bottom).then(|| [top, bottom].map(|row| (row / self.rows) as usize))
    }

    /// Columns, and rows, of pixels that may have samples in a triangle.
    #[inline(always)]
    fn pixels_of(&self, corners: [[i32; 3]; 2]) -> [[i32; 2]; 2] {
        let axis = |k: usize| {
            let v = corners[k];
            let (low, high) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
            // Only what lies outside wraps.
            let from_corner = [low.wrapping_add(self.half[k]), high.wrapping_add(self.half[k])];
            self.grid.pixels(from_corner, self.ranges[k])
        };
        [axis(0), axis(1)]
    }

    #[inline(always)]
    fn with_margin(&self, [top, bottom]: [i32; 2]) -> [i32; 2] {
        [(top - self.margin).max(0), bottom.saturating_add(self.margin).min(self.row_last)]
    }
}

/// Triangles of a chunk that culling leaves.
pub struct Kept {
    /// Triangles that face the viewer; with boxes if the picture has mixed pixels.
    pub fronts: KeptFaces,
    /// Triangles that face away, with boxes.
    pub backs: KeptFaces,
    /// Those of both that are thin, with boxes.
    pub thin: KeptFaces,
    /// Triangles with a corner behind the eye or far outside the picture.
    pub outside: Vec<u32>,
    /// Of all triangles of the chunk, drawn or not.
    pub sides: Vec<Sides>,
}

/// The sides that eight triangles in succession show: a bit for each that faces the viewer, and for each
/// that faces away. Neither is set for what is seen edge-on, or lies outside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sides {
    pub front: u8,
    pub back: u8,
    /// A bit for each that has no fringe (see `lines/fringes`).
    pub unfringed: u8,
}

impl Kept {
    /// Room for so many triangles.
    pub fn with_room_for(triangles: usize, bounds: &Bounds) -> Self {
        Self {
            fronts: KeptFaces::with_room_for(triangles, bounds.has_mixed),
            backs: KeptFaces::with_room_for(triangles, true),
            thin: KeptFaces::default(),
            outside: Vec::new(),
            sides: Vec::with_capacity(triangles.div_ceil(LANES)),
        }
    }
}

/// Culls the triangles of a pass.
pub fn keep(context: &RasterContext<'_>, bounds: &Bounds, pass: &TrianglePass) -> Kept {
    let one_by_one = || Cow::Owned(pass.ids.clone().map(|id| context.triangle(id as u32)).collect());
    let triangles = context.triangles_of(&pass.ids).map_or_else(one_by_one, Cow::Borrowed);
    with_simd!(context.isa, simd => lanes::keep(simd, context, bounds, pass, &triangles))
}

/// Twice the signed area. Only what lies outside wraps, and its area is not looked at.
#[inline(always)]
pub fn area_of(x: [i32; 3], y: [i32; 3]) -> i64 {
    let d = |a: i32, b: i32| i64::from(a.wrapping_sub(b));
    d(x[1], x[0]) * d(y[2], y[0]) - d(x[2], x[0]) * d(y[1], y[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::bands::lists::{BoxedFace, pair};
    use crate::backend::cpu::geometry::setups::Corners;
    use crate::backend::cpu::geometry::transform::OUTSIDE;
    use crate::backend::cpu::lines::fringes::FRINGED_MAX;
    use crate::backend::cpu::mixed::thinness::is_thin;
    use crate::backend::cpu::stopwatch::Stopwatch;
    use crate::backend::cpu::{CpuRenderer, Isa};
    use crate::limits::Deadline;
    use crate::plan::{HullPass, Projection};

    /// As `keep`, triangle by triangle.
    fn keep_plainly(context: &RasterContext<'_>, bounds: &Bounds, pass: &TrianglePass) -> Kept {
        let mut kept = Kept::with_room_for(pass.ids.len(), bounds);
        for first in pass.ids.clone().step_by(LANES) {
            let len = (pass.ids.end - first).min(LANES);
            let mut ids = [first as u32; LANES];
            for l in 0..len {
                ids[l] += l as u32;
            }
            let corners = Corners::load(context, &ids);
            let drawn = pass.drawn(context.plan, first, len);
            let mut sides = Sides::default();
            for l in 0..len {
                let depth_max =
                    context.screen_triangle(ids[l]).iter().fold(f32::NEG_INFINITY, |max, vertex| max.max(vertex.z));
                let lane = Lane::new(&corners, l, bounds, depth_max);
                sides.front |= u8::from(!lane.is_outside && lane.area < 0) << l;
                sides.back |= u8::from(!lane.is_outside && lane.area > 0) << l;
                sides.unfringed |= u8::from(lane.is_outside || lane.is_wide || lane.area == 0) << l;
                let is_drawn = |k: usize| drawn[k] >> l & 1 != 0;
                if lane.is_outside && (is_drawn(0) || is_drawn(1)) {
                    kept.outside.push(ids[l]);
                }
                if lane.is_seen && lane.area < 0 && is_drawn(0) {
                    kept.fronts.ids.push(ids[l]);
                    kept.fronts.spans.push(lane.span);
                    if bounds.has_mixed {
                        kept.fronts.boxed.push(BoxedFace { id: ids[l], ..lane.boxed });
                    }
                }
                if lane.is_seen && lane.area > 0 && is_drawn(1) {
                    kept.backs.ids.push(ids[l]);
                    kept.backs.spans.push(lane.span);
                    kept.backs.boxed.push(BoxedFace { id: ids[l], ..lane.boxed });
                }
                let is_shown = lane.area < 0 && is_drawn(0) || lane.area > 0 && is_drawn(1);
                if lane.is_seen && is_shown && lane.is_thin {
                    kept.thin.ids.push(ids[l]);
                    kept.thin.boxed.push(BoxedFace { id: ids[l], ..lane.boxed });
                    kept.thin.spans.push(lane.span);
                }
            }
            kept.sides.push(sides);
        }
        kept
    }

    /// A triangle on screen.
    struct Lane {
        is_outside: bool,
        is_seen: bool,
        is_thin: bool,
        is_wide: bool,
        area: i64,
        /// As [`KeptFaces`] has it.
        span: u32,
        boxed: BoxedFace,
    }

    impl Lane {
        fn new(corners: &Corners, l: usize, bounds: &Bounds, depth_max: f32) -> Self {
            let of = |v: &[[i32; LANES]; 3]| [v[0][l], v[1][l], v[2][l]];
            let (x, y) = (of(&corners.x), of(&corners.y));
            let is_outside = (x[0] == OUTSIDE) | (x[1] == OUTSIDE) | (x[2] == OUTSIDE);
            let [columns, rows] = bounds.pixels_of([x, y]);
            let [top, bottom] = bounds.with_margin(rows);
            let is_seen = (columns[0] <= columns[1]) & (top <= bottom) & !is_outside;
            let area = area_of(x, y);
            Self {
                is_outside,
                is_seen,
                is_thin: bounds.has_mixed && is_thin(x, y, area),
                is_wide: [x, y]
                    .iter()
                    .any(|v| v.iter().max() > v.iter().min().map(|least| least + FRINGED_MAX).as_ref()),
                area,
                span: if is_seen { pair([top / bounds.rows, bottom / bounds.rows]) } else { 0 },
                boxed: BoxedFace { id: 0, columns: pair(columns), rows: pair(rows), depth_max },
            }
        }
    }

    /// Triangles of all sizes, some of them behind the eye or far outside; those with a mask are
    /// drawn from one side, or not.
    fn is_kept_alike(samples: u32, margin: u32, has_mixed: bool, masks: Vec<u8>) -> [usize; 3] {
        let mut state = 1_u32;
        let mut chance = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut positions = Vec::new();
        for i in 0..1500 {
            let size = [0.01, 0.1, 1.0, 40.0][i / 8 % 4];
            let at = [chance(), chance(), chance()].map(|v| 2.4 * v - 1.2);
            (0..3).for_each(|_| positions.push(at.map(|v| v + size * (chance() - 0.5))));
        }
        let triangles: Vec<[u32; 3]> = (0..1499).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut plan = DrawPlan::new([120, 90], &positions, &triangles, Projection::for_tests());
        (plan.samples, plan.pass_masks, plan.margin_px) = (samples, masks.into(), margin);
        plan.is_adaptive = true;
        plan.hull = Some(HullPass::default());
        let deadline = Deadline::default();
        let pass = TrianglePass {
            ids: 3..triangles.len(),
            pass_bit: pass_mask::SURFACE,
            faces: Faces::Both,
            has_mixed,
            has_points: true,
        };
        let bounds = Bounds::new(&plan, [17, margin], &pass);
        let lists = |isa: Isa, keep: fn(&RasterContext<'_>, &Bounds, &TrianglePass) -> Kept| {
            let mut cpu = CpuRenderer::with_isa(1, isa);
            cpu.transform(&plan, None);
            let kept = keep(&cpu.context(&plan, &deadline, &Stopwatch::default()), &bounds, &pass);
            let [fronts, backs, thin] =
                [kept.fronts, kept.backs, kept.thin].map(|kept| (kept.ids, kept.spans, kept.boxed));
            (fronts, backs, kept.outside, kept.sides, thin)
        };
        let want = lists(Isa::baseline(), keep_plainly);
        for isa in Isa::available() {
            assert!(lists(isa, keep) == want, "{samples} samples, margin {margin}, {isa:?}");
        }
        let (fronts, backs, outside, _, thin) = &want;
        assert!(if has_mixed { thin.0.len() > 10 } else { thin.0.is_empty() }, "{}", thin.0.len());
        [fronts.0.len(), backs.0.len(), outside.len()]
    }

    #[test]
    fn every_instruction_set_keeps_the_same() {
        for samples in [1, 4, 8, 16] {
            for (margin, has_mixed) in [(0, true), (5, true), (5, false)] {
                let all = is_kept_alike(samples, margin, has_mixed, Vec::new());
                assert!(all.iter().all(|&count| count > 50), "{all:?}");
                let drawn = |i: u32| if i.is_multiple_of(3) { 0 } else { pass_mask::SURFACE };
                let mask = |i: u32| if i.is_multiple_of(5) { drawn(i) | pass_mask::BACK_ONLY } else { drawn(i) };
                let some = is_kept_alike(samples, margin, has_mixed, (0..1499).map(mask).collect());
                assert!((0..3).all(|k| some[k] > 20 && some[k] < all[k]), "{some:?} of {all:?}");
            }
        }
    }
}
