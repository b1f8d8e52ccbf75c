//! The splitting of polygons into triangles: convex quads along the shorter diagonal, others by ear
//! clipping. Those of more than 8192 corners become fans, because the time of ear clipping grows
//! with the square of the corners, and so do those whose parts cancel out where they cross themselves.
//! Each triangle gets a mask of its edges that belong to the polygon; the others are diagonals, which
//! lines along the polygons' edges leave out.

use crate::import::normalise::pow2::{Pow2, exponent, is_usable, max_abs};
use crate::warning::Warning;

/// The mask of a triangle whose three edges are all edges of its polygon.
pub const ALL_EDGES: u8 = 0b111;

/// Most corner tests of ear clipping in one file, about half a second. Past that, corners are cut off
/// without tests: clipping is quadratic, and a few hostile polygons would otherwise take minutes.
pub const WORK_MAX: u64 = 100_000_000;
/// Squared lengths within this ratio count as equal. It is more than the rounding of coordinates in
/// f32, or of f64 far away.
const EQUAL_LENGTHS2: f64 = 1.0 + 1e-4;
/// Polygons with more corners are always fanned.
const CORNERS_MAX: usize = 8192;

/// Triangulates the polygons of one file.
#[derive(Debug)]
pub struct Triangulator {
    work_left: u64,
    fanned: u64,
    ring: Vec<Corner>,
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    vertex: u32,
    /// Position in the polygon's plane, counter-clockwise.
    at: [f64; 2],
    prev: u32,
    next: u32,
    /// True if the edge to `next` is an edge of the polygon.
    real: bool,
    reflex: bool,
}

impl Default for Triangulator {
    fn default() -> Self {
        Self { work_left: WORK_MAX, fanned: 0, ring: Vec::new() }
    }
}

impl Triangulator {
    /// Corner tests so far.
    pub fn work(&self) -> u64 {
        WORK_MAX - self.work_left
    }

    /// Counts the work of another triangulator as this one's.
    pub fn add_work_of(&mut self, other: &Self) {
        self.work_left = self.work_left.saturating_sub(other.work());
        self.fanned += other.fanned;
    }

    /// A warning if a polygon was too large, or the file had too many large ones, for ear clipping.
    pub fn warning(&self) -> Option<Warning> {
        (self.fanned > 0 || self.work_left == 0).then(|| Warning {
            code: "polygons_fanned",
            detail: "polygons with very many corners were split into fans, which is wrong where they are concave"
                .into(),
        })
    }

    /// Splits the polygon `corners` (vertex indices, at least three) and gives each triangle with
    /// its edge mask to `emit`. The triangles keep the polygon's winding.
    pub fn split(&mut self, corners: &[u32], positions: &[[f64; 3]], emit: &mut impl FnMut([u32; 3], u8)) {
        if let [a, b, c] = *corners {
            emit([a, b, c], ALL_EDGES);
            return;
        }
        if let Some(bad) = corners.iter().position(|&v| !is_usable(&positions[v as usize])) {
            // One triangle with the bad corner stands for the whole face: normalisation drops and
            // counts it.
            let n = corners.len();
            emit([corners[bad], corners[(bad + 1) % n], corners[(bad + 2) % n]], ALL_EDGES);
            return;
        }
        self.load(corners, positions);
        let n = self.ring.len();
        let is_flat = n < 3 || !project(&mut self.ring, positions);
        if is_flat && n > 3 && !self.is_on_a_line(positions) {
            // A polygon that crosses itself so that its parts cancel out.
            self.fan(emit);
        } else if is_flat {
            emit([corners[0], corners[1], corners[2]], ALL_EDGES);
        } else if n == 4 && self.is_convex() {
            self.split_quad(positions, emit);
        } else if n > CORNERS_MAX {
            self.fanned += 1;
            self.fan(emit);
        } else {
            self.clip_ears(emit);
        }
    }

    /// Fills the ring, without corners that equal the one before.
    fn load(&mut self, corners: &[u32], positions: &[[f64; 3]]) {
        let at = |v: u32| positions[v as usize];
        self.ring.clear();
        for &vertex in corners {
            if self.ring.last().is_none_or(|last| at(last.vertex) != at(vertex)) {
                self.ring.push(Corner { vertex, at: [0.0; 2], prev: 0, next: 0, real: true, reflex: false });
            }
        }
        while self.ring.len() > 1 && at(self.ring[0].vertex) == at(self.ring[self.ring.len() - 1].vertex) {
            self.ring.pop();
        }
        let n = self.ring.len() as u32;
        for (i, corner) in (0..n).zip(&mut self.ring) {
            corner.prev = (i + n - 1) % n;
            corner.next = (i + 1) % n;
        }
    }

    fn is_convex(&self) -> bool {
        (0..self.ring.len() as u32).all(|i| self.turn(i) > 0.0)
    }

    /// Twice the area of the corner's triangle: positive where the corner is convex.
    fn turn(&self, i: u32) -> f64 {
        let corner = &self.ring[i as usize];
        orient(self.ring[corner.prev as usize].at, corner.at, self.ring[corner.next as usize].at)
    }

    /// Cuts along the shorter diagonal, which gives better shaped triangles. Of equal diagonals, as
    /// in symmetric models, the first is taken: if rounding chose, the same model elsewhere or at
    /// another scale would be cut differently.
    fn split_quad(&self, positions: &[[f64; 3]], emit: &mut impl FnMut([u32; 3], u8)) {
        let v: [u32; 4] = std::array::from_fn(|i| self.ring[i].vertex);
        let p = v.map(|v| positions[v as usize]);
        let diagonal = |a: [f64; 3], b: [f64; 3]| [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let (d, e) = (diagonal(p[0], p[2]), diagonal(p[1], p[3]));
        let unit = Pow2::new(-exponent(max_abs(&d).max(max_abs(&e))));
        let length2 = |d: [f64; 3]| unit.of3(d).iter().map(|c| c * c).sum::<f64>();
        if length2(d) <= length2(e) * EQUAL_LENGTHS2 {
            emit([v[0], v[1], v[2]], 0b011);
            emit([v[0], v[2], v[3]], 0b110);
        } else {
            emit([v[1], v[2], v[3]], 0b011);
            emit([v[1], v[3], v[0]], 0b110);
        }
    }

    /// True if all corners lie on one line. At least two of them differ.
    fn is_on_a_line(&self, positions: &[[f64; 3]]) -> bool {
        let at = |corner: &Corner| positions[corner.vertex as usize];
        let origin = at(&self.ring[0]);
        let offset = |corner: &Corner| std::array::from_fn::<f64, 3, _>(|k| at(corner)[k] - origin[k]);
        let extent = self.ring.iter().map(|corner| max_abs(&offset(corner))).fold(0.0, f64::max);
        let unit = Pow2::new(-exponent(extent));
        let a = unit.of3(offset(&self.ring[1]));
        self.ring[2..].iter().all(|corner| {
            let b = unit.of3(offset(corner));
            (0..3).all(|k| a[k] * b[(k + 1) % 3] == a[(k + 1) % 3] * b[k])
        })
    }

    fn fan(&self, emit: &mut impl FnMut([u32; 3], u8)) {
        let mut i = self.ring[0].next;
        let start = self.ring[0].prev;
        let mut mask = 0b011;
        while self.ring[i as usize].next != start {
            let next = self.ring[i as usize].next;
            emit([self.ring[0].vertex, self.ring[i as usize].vertex, self.ring[next as usize].vertex], mask);
            mask = 0b010;
            i = next;
        }
        emit([self.ring[0].vertex, self.ring[i as usize].vertex, self.ring[start as usize].vertex], mask | 0b100);
    }

    fn clip_ears(&mut self, emit: &mut impl FnMut([u32; 3], u8)) {
        for i in 0..self.ring.len() as u32 {
            self.ring[i as usize].reflex = self.turn(i) <= 0.0;
        }
        let mut left = self.ring.len();
        let mut i = 0_u32;
        let mut misses = 0;
        while left > 3 {
            let (prev, next) = (self.ring[i as usize].prev, self.ring[i as usize].next);
            // A whole round without an ear means that the polygon crosses itself. Then any convex
            // corner is cut, then any corner.
            self.work_left = self.work_left.saturating_sub(1);
            let ok = match misses / left {
                _ if self.work_left == 0 => true,
                0 => !self.ring[i as usize].reflex && self.is_empty_ear(i),
                1 => !self.ring[i as usize].reflex,
                _ => true,
            };
            if !ok {
                misses += 1;
                i = next;
                continue;
            }
            self.clip(i, emit);
            left -= 1;
            misses = 0;
            for k in [prev, next] {
                self.ring[k as usize].reflex = self.turn(k) <= 0.0;
            }
            // Skipping one corner avoids a fan around a single point.
            i = self.ring[next as usize].next;
        }
        let corner = |i: u32| &self.ring[i as usize];
        let (a, b) = (corner(i), corner(corner(i).next));
        let c = corner(b.next);
        let mask = u8::from(a.real) | u8::from(b.real) << 1 | u8::from(c.real) << 2;
        emit([a.vertex, b.vertex, c.vertex], mask);
    }

    /// Takes corner `i` out of the ring.
    fn clip(&mut self, i: u32, emit: &mut impl FnMut([u32; 3], u8)) {
        let area = self.turn(i);
        let corner = self.ring[i as usize];
        let (prev, next) = (corner.prev as usize, corner.next as usize);
        let mask = u8::from(self.ring[prev].real) | u8::from(corner.real) << 1;
        emit([self.ring[prev].vertex, corner.vertex, self.ring[next].vertex], mask);
        // A flat ear will be dropped, and then the new edge stands for the polygon's own edges.
        self.ring[prev].real = area == 0.0 && mask != 0;
        self.ring[prev].next = corner.next;
        self.ring[next].prev = corner.prev;
    }

    /// True if no other corner lies in the triangle at convex corner `i`. Only reflex corners can.
    fn is_empty_ear(&mut self, i: u32) -> bool {
        let corner = self.ring[i as usize];
        let [a, b, c] = [self.ring[corner.prev as usize].at, corner.at, self.ring[corner.next as usize].at];
        let mut k = self.ring[corner.next as usize].next;
        while k != corner.prev {
            self.work_left = self.work_left.saturating_sub(1);
            let other = &self.ring[k as usize];
            let p = other.at;
            let inside = other.reflex
                && p != a
                && p != b
                && p != c
                && orient(a, b, p) >= 0.0
                && orient(b, c, p) >= 0.0
                && orient(c, a, p) >= 0.0;
            if inside {
                return false;
            }
            k = other.next;
        }
        true
    }
}

/// Twice the signed area of a triangle, positive if counter-clockwise.
fn orient(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Projects the corners to the coordinate plane most perpendicular to the polygon's Newell normal.
/// False if the polygon has no area.
fn project(ring: &mut [Corner], positions: &[[f64; 3]]) -> bool {
    let origin = positions[ring[0].vertex as usize];
    let offset = |c: &Corner| {
        let p = positions[c.vertex as usize];
        [p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]]
    };
    let extent = ring.iter().map(|c| max_abs(&offset(c))).fold(0.0, f64::max);
    if extent == 0.0 {
        return false;
    }
    let unit = Pow2::new(-exponent(extent));
    let mut normal = [0.0_f64; 3];
    let mut p = unit.of3(offset(&ring[ring.len() - 1]));
    for corner in ring.iter() {
        let q = unit.of3(offset(corner));
        normal[0] += (p[1] - q[1]) * (p[2] + q[2]);
        normal[1] += (p[2] - q[2]) * (p[0] + q[0]);
        normal[2] += (p[0] - q[0]) * (p[1] + q[1]);
        p = q;
    }
    let size = normal.map(f64::abs);
    let axis = if size[0] > size[1] && size[0] > size[2] { 0 } else { 1 + usize::from(size[2] >= size[1]) };
    if size[axis] == 0.0 {
        return false;
    }
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let flip = if normal[axis] < 0.0 { -1.0 } else { 1.0 };
    for corner in ring.iter_mut() {
        let q = unit.of3(offset(corner));
        corner.at = [q[u] * flip, q[v]];
    }
    true
}
