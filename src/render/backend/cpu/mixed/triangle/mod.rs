//! The points of a mixed pixel that a triangle covers, and the triangle's depth at each (stage mixed). Mixed pixels
//! are drawn a second time, from 64 or 256 points each, because faces of different colours meet in or near them.
//!
//! Points lie in the middle of squares of 1/256 px, so their positions are counted in 1/512 px. The rest is as in
//! the stage visibility: exact signs with the top-left rule, depth from integer offsets.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

use super::points::{Lattice, PLACE_MAX, PointSet};
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::backend::cpu::geometry::visibility::{Setup, area, clamp};
use crate::backend::cpu::isa::Isa;

/// A triangle, ready to be offered to pixels.
#[derive(Clone, Debug)]
pub struct PointTriangle {
    /// The triangle that it is, or is a piece of.
    pub id: u32,
    corners: [ScreenVertex; 3],
    edges: Edges,
    /// The nearest depth of its corners.
    pub nearest: f32,
    /// Of its depth: found when a pixel asks for it.
    setup: Option<Setup>,
}

/// The edges of a triangle, in an order that makes the area positive. The fourth has everything inside.
#[derive(Clone, Copy, Debug)]
struct Edges {
    /// The first corner.
    x: [i32; 4],
    y: [i32; 4],
    dx: [i32; 4],
    dy: [i32; 4],
    /// Summand for half of a 1/256 px, and for the top-left rule.
    bias: [i32; 4],
    /// By how much the function grows from the first column and row to others, at most.
    growth: [i32; 4],
    /// The same, at least.
    decline: [i32; 4],
}

/// An edge function in a pixel: its value at the first point, halved, and its change per row and, negative, per column.
type Edge = [i32; 3];

/// Bound of edge functions in a pixel: what lies beyond has all of it inside, or outside.
pub const EDGE_MAX: i32 = 1 << 30;

/// A triangle in a pixel, without its depth: its edges that have points on both sides, which come first.
pub struct Outline {
    edges: [Edge; 3],
    count: usize,
}

/// The depth of a triangle in a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// The first point from the triangle's first corner, 1/512 px.
    from: [i32; 2],
    /// As [`Setup::depth`].
    depth: [f32; 3],
    /// As [`Setup::depth_range`].
    range: [f32; 2],
}

impl PointTriangle {
    /// None where the triangle has no area.
    #[inline(always)]
    pub fn new(id: u32, corners: &[ScreenVertex; 3]) -> Option<Self> {
        let area = area(corners);
        if area == 0 {
            return None;
        }
        let [a, b, c] = *corners;
        let [b, c] = if area > 0 { [b, c] } else { [c, b] };
        let nearest = a.z.max(b.z).max(c.z);
        Some(Self { id, corners: *corners, edges: Edges::of([a.x, b.x, c.x], [a.y, b.y, c.y]), nearest, setup: None })
    }

    /// The triangle in the pixel with this upper left corner, 1/256 px from the picture's centre; None where no point of the
    /// pixel is inside.
    #[inline(always)]
    pub fn at(&self, corner: [i32; 2]) -> Option<Outline> {
        let Edges { x, y, dx, dy, bias, growth, decline } = &self.edges;
        let mut first = [0_i64; 4];
        let mut all = 0;
        for k in 0..4 {
            let [px, py] = [corner[0] - x[k], corner[1] - y[k]].map(i64::from);
            first[k] = i64::from(dx[k]) * py - i64::from(dy[k]) * px + i64::from(bias[k]);
            all |= first[k] + i64::from(growth[k]);
        }
        if all < 0 {
            return None;
        }
        let (mut edges, mut count) = ([[0; 3]; 3], 0);
        for k in 0..3 {
            edges[count] = [first[k].clamp(-i64::from(EDGE_MAX), EDGE_MAX.into()) as i32, dx[k], dy[k]];
            count += usize::from(first[k] + i64::from(decline[k]) < 0);
        }
        Some(Outline { edges, count })
    }

    /// The depth in the pixel with this corner.
    #[inline(always)]
    pub fn plane_at(&mut self, corner: [i32; 2]) -> Plane {
        if self.setup.is_none() {
            self.setup = Setup::new(&self.corners);
        }
        match &self.setup {
            Some(Setup { x, y, depth, depth_range, .. }) => Plane {
                from: [2 * (corner[0] - x[0]) + 1, 2 * (corner[1] - y[0]) + 1],
                depth: *depth,
                range: *depth_range,
            },
            // There is one where there is an area.
            None => Plane::EMPTY,
        }
    }
}

impl Edges {
    #[inline(always)]
    fn of([ax, bx, cx]: [i32; 3], [ay, by, cy]: [i32; 3]) -> Self {
        let (x, y) = ([ax, bx, cx, cx], [ay, by, cy, cy]);
        let (dx, dy) = ([bx - ax, cx - bx, ax - cx, 0], [by - ay, cy - by, ay - cy, 0]);
        let (mut bias, mut growth, mut decline) = ([0; 4], [0; 4], [0; 4]);
        for k in 0..4 {
            // The fourth edge is one of those that own their points.
            let is_own = dy[k] < 0 || (dy[k] == 0 && dx[k] >= 0);
            // Functions are halves of (2 E + dx - dy - 1 or 0), rounded down.
            bias[k] = (dx[k] - dy[k] - i32::from(!is_own)) >> 1;
            growth[k] = PLACE_MAX * (dx[k].max(0) + (-dy[k]).max(0));
            decline[k] = PLACE_MAX * (dx[k].min(0) + (-dy[k]).min(0));
        }
        Self { x, y, dx, dy, bias, growth, decline }
    }
}

impl Plane {
    /// The depth of nothing, for places that wait to be used.
    pub const EMPTY: Self = Self { from: [0; 2], depth: [0.0; 3], range: [0.0; 2] };

    /// The depth at point `i` of those of which sets have `W` words.
    #[inline(always)]
    pub fn at<const W: usize>(&self, i: usize) -> f32 {
        self.at_place(Lattice::<W>::place(i))
    }

    /// Those of some points at which this plane is nearer than the other, or as near if it wins ties.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn nearer<const W: usize>(&self, isa: Isa, other: &Self, points: PointSet<W>, wins_ties: bool) -> PointSet<W> {
        #[cfg(target_arch = "x86_64")]
        if isa.has_avx2() {
            // SAFETY: `has_avx2` is true where the processor has AVX2.
            return unsafe { avx2::nearer(self, other, points, wins_ties) };
        }
        let _ = isa;
        points.filter(|i| {
            let (own, of_other) = (self.at::<W>(i), other.at::<W>(i));
            own > of_other || (own == of_other && wins_ties)
        })
    }

    #[inline(always)]
    fn at_place(&self, place: [i32; 2]) -> f32 {
        let x = (self.from[0] + 2 * place[0]) as f32 * 0.5;
        let y = (self.from[1] + 2 * place[1]) as f32 * 0.5;
        clamp((self.depth[0] + self.depth[1] * x) + self.depth[2] * y, self.range)
    }

    /// Two depths between which those of all points are. Each step of [`at`](Self::at) rounds to the nearest, so a
    /// larger number never becomes less than a smaller one, and the extremes are in corners.
    #[inline(always)]
    pub fn extremes(&self) -> [f32; 2] {
        let far = [1, 2].map(|k| if self.depth[k] < 0.0 { PLACE_MAX } else { 0 });
        [self.at_place(far), self.at_place(far.map(|place| PLACE_MAX - place))]
    }
}

impl Outline {
    /// The points inside.
    #[inline(always)]
    pub fn inside<const W: usize>(&self, isa: Isa) -> PointSet<W> {
        let mut inside = PointSet::ALL;
        for edge in &self.edges[..self.count] {
            inside = inside.without(outside(isa, *edge));
        }
        inside
    }
}

/// The points that lie outside an edge.
#[inline(always)]
#[allow(unsafe_code)]
fn outside<const W: usize>(isa: Isa, edge: Edge) -> PointSet<W> {
    #[cfg(target_arch = "x86_64")]
    if isa.has_avx512() {
        // SAFETY: `has_avx512` is true where the processor has AVX-512F.
        return unsafe { avx512::outside(edge) };
    } else if isa.has_avx2() {
        // SAFETY: `has_avx2` is true where the processor has AVX2.
        return unsafe { avx2::outside(edge) };
    }
    let _ = isa;
    outside_plainly(edge)
}

/// The points that lie outside an edge, one by one.
#[inline(always)]
fn outside_plainly<const W: usize>([c, dx, dy]: Edge) -> PointSet<W> {
    PointSet::of(|i| {
        let [column, row] = Lattice::<W>::place(i);
        c.wrapping_add(dx.wrapping_mul(row).wrapping_sub(dy.wrapping_mul(column))) < 0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::mixed::points::ALL_WORDS;
    use crate::backend::sample_partition::POINTS;

    /// Numbers that look random: xorshift64, Marsaglia 2003.
    fn next(state: &mut u64) -> i32 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 20) as i32
    }

    #[test]
    fn each_instruction_set_finds_the_same_points() {
        let mut state = 0x2545_F491_4F6C_DD1D;
        let mut mixed = 0;
        for _ in 0..20_000 {
            let shift = next(&mut state).rem_euclid(16);
            let [dx, dy] = [0, 1].map(|_| next(&mut state) >> (8 + shift));
            let c = (next(&mut state) >> shift).clamp(-(1 << 30), 1 << 30);
            let want = outside_plainly::<ALL_WORDS>([c, dx, dy]);
            let of_few = outside_plainly::<1>([c, dx, dy]);
            mixed += usize::from(want != PointSet::NONE && want != PointSet::ALL);
            for isa in Isa::available() {
                assert_eq!(outside(isa, [c, dx, dy]), want, "{isa:?} {c} {dx} {dy}");
                assert_eq!(outside(isa, [c, dx, dy]), of_few, "{isa:?} {c} {dx} {dy}");
            }
        }
        assert!(mixed > 2_000, "{mixed}");
    }

    #[test]
    fn each_instruction_set_finds_the_same_points_nearer() {
        let mut state = 0x1234_5678_9ABC_DEF1;
        let (mut parted, mut ties) = (0, 0);
        for round in 0..3_000 {
            let mut depth = || (next(&mut state) >> 8) as f32 / (1 << 24) as f32;
            let depths: [[f32; 3]; 2] = [0, 1].map(|_| [0.5 + 1e-3 * depth(), 1e-4 * depth(), 1e-4 * depth()]);
            let mut plane =
                |depth: [f32; 3]| Plane { from: [0, 1].map(|_| next(&mut state) >> 22), depth, range: [0.49, 0.51] };
            let own = plane(depths[0]);
            // Planes that are the same have ties alone.
            let other = if round % 4 == 0 { own } else { plane(depths[1]) };
            let asked = PointSet::<ALL_WORDS>([0, 1, 2, 3].map(|_| u64::from(next(&mut state) as u32) << (round % 33)));
            for wins_ties in [false, true] {
                let is_nearer = |i: usize| {
                    let (own, other) = (own.at::<ALL_WORDS>(i), other.at::<ALL_WORDS>(i));
                    own > other || (own == other && wins_ties)
                };
                let want = asked.filter(is_nearer);
                parted += usize::from(want != asked && !want.is_empty());
                ties += usize::from(round % 4 == 0 && wins_ties && want == asked);
                let few = PointSet::<1>([asked.0[0]]);
                for isa in Isa::available() {
                    assert_eq!(own.nearer(isa, &other, asked, wins_ties), want, "{isa:?} {own:?} {other:?}");
                    let of_few = own.nearer(isa, &other, few, wins_ties);
                    let is_nearer = |i: usize| {
                        let (own, other) = (own.at::<1>(i), other.at::<1>(i));
                        own > other || (own == other && wins_ties)
                    };
                    assert_eq!(of_few, few.filter(is_nearer), "{isa:?} {own:?} {other:?}");
                }
            }
        }
        assert!(parted > 500 && ties > 700, "{parted} {ties}");
    }

    #[test]
    fn depths_lie_between_their_extremes() {
        let mut state = 0x9E37_79B9_7F4A_7C15;
        let mut compared = 0;
        for _ in 0..2_000 {
            let corner = |state: &mut u64| ScreenVertex {
                x: next(state) >> 18,
                y: next(state) >> 18,
                z: (next(state) >> 8) as f32 / (1 << 24) as f32 + 0.5,
                ..ScreenVertex::default()
            };
            let corners = [0; 3].map(|_| corner(&mut state));
            let Some(mut triangle) = PointTriangle::new(0, &corners) else { continue };
            let plane = triangle.plane_at([next(&mut state) >> 16, next(&mut state) >> 16]);
            let [low, high] = plane.extremes();
            for i in 0..POINTS {
                let depth = plane.at::<ALL_WORDS>(i);
                assert!(low <= depth && depth <= high, "{plane:?}");
            }
            compared += 1;
        }
        assert!(compared > 1_900);
    }
}
