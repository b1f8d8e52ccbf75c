//! The visible triangles of a mixed pixel, each with its share of the pixel: the set of the points that show it
//! (stage mixed). Mixed pixels are drawn a second time, from 64 or 256 points each, because faces of different
//! colours meet in or near them.

use super::points::PointSet;
use crate::backend::sample_partition::POINTS;

/// A triangle's share of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Share<const W: usize> {
    /// The triangle.
    pub id: u32,
    /// The points that see it.
    pub points: PointSet<W>,
    /// Its depth at the first of them.
    pub depth: f32,
}

/// The shares of a pixel's triangles, in the order of their first points.
pub struct Shares<const W: usize> {
    list: [Share<W>; POINTS],
    len: usize,
}

impl<const W: usize> Shares<W> {
    /// None.
    pub fn new() -> Self {
        Self { list: [Share { id: 0, points: PointSet::NONE, depth: 0.0 }; POINTS], len: 0 }
    }

    /// Forgets all.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// All of them.
    #[inline(always)]
    pub fn all(&self) -> &[Share<W>] {
        &self.list[..self.len]
    }

    /// The points of all of them.
    #[inline(always)]
    pub fn points(&self) -> PointSet<W> {
        let mut all = PointSet::NONE;
        for share in self.all() {
            all = all.or(share.points);
        }
        all
    }

    /// Adds one that comes after the others.
    #[inline(always)]
    pub fn push(&mut self, share: Share<W>) {
        self.list[self.len] = share;
        self.len += 1;
    }

    /// Adds a point to share number `n`.
    #[inline(always)]
    pub fn add_point(&mut self, n: usize, i: usize) {
        self.list[n].points.add(i);
    }

    /// Adds one where it belongs. Pieces of a triangle become one share.
    #[inline(always)]
    pub fn insert(&mut self, mut share: Share<W>) {
        let mut kept = 0;
        for i in 0..self.len {
            let other = self.list[i];
            if other.id == share.id {
                let is_first = other.points.first() < share.points.first();
                share.depth = if is_first { other.depth } else { share.depth };
                share.points = share.points.or(other.points);
            } else {
                self.list[kept] = other;
                kept += 1;
            }
        }
        let first = share.points.first();
        let mut at = kept;
        while at > 0 && self.list[at - 1].points.first() > first {
            self.list[at] = self.list[at - 1];
            at -= 1;
        }
        self.list[at] = share;
        self.len = kept + 1;
    }
}
