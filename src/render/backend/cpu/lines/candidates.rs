//! A quick selection of the triangles that may hide an edge, eight at a time (stage lines).
//!
//! Most triangles along an edge hide nothing of it: the edge is one of their sides, or they lie beside it or behind
//! it. Most of these are rejected here, by the same operations as at the start of [`hidden_by`](super::hidden_lines).
//! The triangles that remain are tested one by one.

use super::segment::Segment;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::NOTHING;
use crate::backend::cpu::geometry::steepness::NEARER_RATIO;
use crate::backend::cpu::geometry::transform::OUTSIDE;
use crate::backend::cpu::isa::LANES;
use crate::plan::Edge;

/// Farthest apart that corners may lie for areas to fit 32 bits, 1/256 px.
const NEAR: u32 = 1 << 14;

/// Up to eight triangles that wait to be examined. Slots after `len` keep triangles that were
/// examined before, so that they are not taken again.
pub struct Candidates {
    ids: [u32; LANES],
    /// Those of `ids` that are not examined yet come first.
    len: usize,
}

impl Candidates {
    /// An empty list.
    #[inline(always)]
    pub fn new() -> Self {
        Self { ids: [NOTHING; LANES], len: 0 }
    }

    /// Adds a triangle unless it waits already or is in a kept slot. True if the list is full and
    /// has to be taken.
    #[inline(always)]
    pub fn push(&mut self, id: u32) -> bool {
        let mut is_known = u32::from(id == NOTHING);
        for l in 0..LANES {
            is_known |= u32::from(self.ids[l] == id);
        }
        // Without a branch, which could not be predicted: a triangle that is known takes no room.
        self.ids[self.len % LANES] = id;
        self.len += 1 - is_known as usize;
        self.len == LANES
    }

    /// The triangles that are to be examined and may hide the edge, in no order.
    #[inline(always)]
    pub fn take(&mut self, context: &RasterContext<'_>, edge: &Edge, segment: &Segment) -> Possible {
        if self.len == 0 {
            return Possible { ids: self.ids, left: 0 };
        }
        let corners = Corners::gather(context, edge, &self.ids, self.len);
        let may_hide = corners.may_hide(segment);
        let mut left = 0;
        for l in 0..LANES {
            left |= may_hide[l] << l;
        }
        left &= (1 << self.len) - 1;
        self.len = 0;
        Possible { ids: self.ids, left }
    }
}

/// The triangles that are left.
pub struct Possible {
    ids: [u32; LANES],
    left: u32,
}

impl Iterator for Possible {
    type Item = u32;

    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        if self.left == 0 {
            return None;
        }
        let lane = self.left.trailing_zeros() as usize % LANES;
        self.left &= self.left - 1;
        Some(self.ids[lane])
    }
}

/// Corners of eight triangles on screen.
struct Corners {
    x: [[i32; LANES]; 3],
    y: [[i32; LANES]; 3],
    z: [[f32; LANES]; 3],
    /// 1 for triangles that have both of the edge's vertices.
    has_edge: [u32; LANES],
}

impl Corners {
    #[inline(always)]
    fn gather(context: &RasterContext<'_>, edge: &Edge, ids: &[u32; LANES], len: usize) -> Self {
        let mut corners = Self { x: [[0; LANES]; 3], y: [[0; LANES]; 3], z: [[0.0; LANES]; 3], has_edge: [1; LANES] };
        let [a, b] = edge.vertices;
        for l in 0..len.min(LANES) {
            let [p, q, r] = context.triangle(ids[l]);
            corners.has_edge[l] = u32::from(((p == a) | (q == a) | (r == a)) & ((p == b) | (q == b) | (r == b)));
            for (k, v) in [p, q, r].into_iter().enumerate() {
                let v = &context.vertices[v as usize];
                (corners.x[k][l], corners.y[k][l], corners.z[k][l]) = (v.x, v.y, v.z);
            }
        }
        corners
    }

    /// Zero for triangles that certainly hide nothing of the edge.
    #[inline(always)]
    fn may_hide(&self, segment: &Segment) -> [u32; LANES] {
        let (mut may, mut is_far) = ([0_u32; LANES], [0_u32; LANES]);
        let ([start, end], farthest) = (segment.ends(), segment.farthest());
        let low: [f32; 2] = std::array::from_fn(|k| start[k].min(end[k]));
        let high: [f32; 2] = std::array::from_fn(|k| start[k].max(end[k]));
        let (x, y, z) = (&self.x, &self.y, &self.z);
        for l in 0..LANES {
            let (left, right) = (x[0][l].min(x[1][l]).min(x[2][l]), x[0][l].max(x[1][l]).max(x[2][l]));
            let (top, bottom) = (y[0][l].min(y[1][l]).min(y[2][l]), y[0][l].max(y[1][l]).max(y[2][l]));
            let is_wide = (right.wrapping_sub(left) as u32 > NEAR) | (bottom.wrapping_sub(top) as u32 > NEAR);
            is_far[l] = u32::from(is_wide | (left == OUTSIDE));
            let nearest = z[0][l].max(z[1][l]).max(z[2][l]);
            let overlaps = (left as f32 <= high[0])
                & (right as f32 >= low[0])
                & (top as f32 <= high[1])
                & (bottom as f32 >= low[1]);
            may[l] = u32::from(overlaps & (nearest * NEARER_RATIO > farthest));
        }
        for l in 0..LANES {
            let from_first = |v: &[[i32; LANES]; 3], k: usize| v[k][l].wrapping_sub(v[0][l]);
            let area = (from_first(x, 1).wrapping_mul(from_first(y, 2)))
                .wrapping_sub(from_first(x, 2).wrapping_mul(from_first(y, 1)));
            let sides = [self.sides(l, start, area > 0), self.sides(l, end, area > 0)];
            let mut is_beside = area == 0;
            for k in 0..3 {
                let is_along = (sides[0][k] == 0.0) & (sides[1][k] == 0.0);
                is_beside |= (sides[0][k] <= 0.0) & (sides[1][k] <= 0.0) & !is_along;
            }
            may[l] &= u32::from(!is_beside);
        }
        for l in 0..LANES {
            may[l] = (may[l] | is_far[l]) & !self.has_edge[l];
        }
        may
    }

    /// As [`hidden_by`](super::hidden_lines) computes them.
    #[inline(always)]
    fn sides(&self, l: usize, [x, y]: [f32; 2], is_clockwise: bool) -> [f32; 3] {
        let from = |k: usize| [self.x[k][l] as f32 - x, self.y[k][l] as f32 - y];
        let (a, b, c) = (from(0), from(1), from(2));
        let side = |a: [f32; 2], b: [f32; 2]| {
            let side = a[0] * b[1] - a[1] * b[0];
            if is_clockwise { side } else { -side }
        };
        [side(b, c), side(c, a), side(a, b)]
    }
}
