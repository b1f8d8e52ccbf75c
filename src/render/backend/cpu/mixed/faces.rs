//! The faces that are visible in a mixed pixel, each with the set of the pixel's points at which it is the nearest
//! (stage mixed). Mixed pixels are drawn a second time, from 64 or 256 points each, because faces of different
//! colours meet in or near them.
//!
//! Faces are added one by one. Two faces that cover the same points are compared once if the depth ranges that they
//! have in the pixel do not overlap, and point by point otherwise. A pixel has at most 16 faces here;
//! [`crowd`](super::crowd) takes pixels with more, and has the same result.

use super::points::PointSet;
use super::shares::{Share, Shares};
use super::triangle::{Plane, PointTriangle};
use crate::backend::cpu::isa::Isa;

/// Faces of a pixel that have a place. A pixel of more is a [`Crowd`](super::crowd::Crowd).
const FACES_MAX: usize = 16;

/// The faces that the points of a pixel see.
pub struct PixelFaces<const W: usize> {
    /// The points that see one.
    covered: PointSet<W>,
    /// No point is farther; 0 where one sees nothing.
    farthest: f32,
    /// Number of faces.
    count: usize,
    faces: [Face<W>; FACES_MAX],
}

/// A face, or a piece of one, and the points that see it.
#[derive(Clone, Copy, Debug)]
pub struct Face<const W: usize> {
    /// The triangle.
    pub id: u32,
    /// The points that see it: at least one.
    pub points: PointSet<W>,
    /// Its depth in the pixel.
    pub plane: Plane,
    /// Least and greatest depth in the pixel.
    extremes: [f32; 2],
}

impl<const W: usize> Face<W> {
    const EMPTY: Self = Self { id: 0, points: PointSet::NONE, plane: Plane::EMPTY, extremes: [0.0; 2] };

    /// Those of the points at which this face hides another one: of equal depths, the lower id is in front.
    #[inline(always)]
    fn hides(&self, isa: Isa, other: &Self, points: PointSet<W>) -> PointSet<W> {
        if self.extremes[0] > other.extremes[1] {
            return points;
        }
        if self.extremes[1] < other.extremes[0] {
            return PointSet::NONE;
        }
        self.plane.nearer(isa, &other.plane, points, self.id < other.id)
    }
}

impl<const W: usize> PixelFaces<W> {
    /// A pixel without faces.
    pub const EMPTY: Self = Self { covered: PointSet::NONE, farthest: 0.0, count: 0, faces: [Face::EMPTY; FACES_MAX] };

    /// Takes all faces away.
    #[inline(always)]
    pub fn clear(&mut self) {
        (self.covered, self.farthest, self.count) = (PointSet::NONE, 0.0, 0);
    }

    /// True if all points see something nearer than this depth.
    #[inline(always)]
    pub fn are_nearer_than(&self, depth: f32) -> bool {
        depth < self.farthest
    }

    /// Its faces, in no order.
    #[inline(always)]
    fn faces(&self) -> &[Face<W>] {
        &self.faces[..self.count]
    }

    /// Finds the triangles' shares.
    #[inline(always)]
    pub fn shares(&self, shares: &mut Shares<W>) {
        shares.clear();
        for face in self.faces() {
            shares.insert(Share { id: face.id, points: face.points, depth: face.plane.at::<W>(face.points.first()) });
        }
    }

    /// Offers a triangle to the points of the pixel with this upper left corner, 1/256 px from the picture's centre.
    /// False if there is no place for it. Then others may have lost points to it, and all are to be offered again.
    #[inline(always)]
    pub fn offer(&mut self, isa: Isa, triangle: &mut PointTriangle, corner: [i32; 2]) -> bool {
        let Some(outline) = triangle.at(corner) else { return true };
        let plane = triangle.plane_at(corner);
        let extremes = plane.extremes();
        if extremes[1] < self.farthest {
            return true;
        }
        let mut points = outline.inside(isa);
        // What is as far as nothing is not seen.
        if extremes[0] <= 0.0 {
            points = points.filter(|i| plane.at::<W>(i) > 0.0);
        }
        let mut face = Face { id: triangle.id, points, plane, extremes };
        if !points.and(self.covered).is_empty() {
            self.part(isa, &mut face);
        }
        if face.points.is_empty() {
            return true;
        }
        if self.count == FACES_MAX {
            return false;
        }
        self.faces[self.count] = face;
        self.count += 1;
        self.covered = self.covered.or(points);
        if self.covered == PointSet::ALL {
            self.farthest = f32::INFINITY;
            for face in &self.faces[..self.count] {
                self.farthest = if face.extremes[0] < self.farthest { face.extremes[0] } else { self.farthest };
            }
        }
        true
    }

    /// Parts the points that a face and others cover by who is in front. Faces that are hidden lose their places.
    #[inline(always)]
    fn part(&mut self, isa: Isa, face: &mut Face<W>) {
        let mut i = 0;
        while i < self.count {
            let other = &mut self.faces[i];
            let both = other.points.and(face.points);
            i += 1;
            if both.is_empty() {
                continue;
            }
            let won = face.hides(isa, other, both);
            other.points = other.points.without(won);
            face.points = face.points.without(both.without(won));
            if other.points.is_empty() {
                i -= 1;
                self.count -= 1;
                self.faces[i] = self.faces[self.count];
            }
        }
    }
}
