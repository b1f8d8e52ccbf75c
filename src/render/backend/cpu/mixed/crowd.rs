//! The nearest triangle at each point of a mixed pixel, kept as one depth and one id per point
//! (stage mixed). Mixed pixels are drawn a second time, from 64 or 256 points each, because faces
//! of different colours meet in or near them.
//!
//! This serves pixels with more faces than [`faces`](super::faces) has room for, or with more
//! triangles than a list holds. The renderer without shortcuts, with which tests compare, uses it
//! for all mixed pixels.

use super::points::{Lattice, PointSet};
use super::shares::{Share, Shares};
use super::triangle::PointTriangle;
use crate::backend::cpu::geometry::samples::NOTHING;
use crate::backend::cpu::isa::{Isa, LANES};
use crate::backend::sample_partition::POINTS;

/// The faces that the points of a pixel see, and their depths; by word and bit of a set.
pub struct Crowd<const W: usize> {
    /// Reversed depth of each point; 0 where there is nothing.
    depth: [[f32; 64]; W],
    /// Triangle of each.
    ids: [[u32; 64]; W],
    /// No point is farther.
    farthest: f32,
}

impl<const W: usize> Crowd<W> {
    /// A pixel without triangles.
    pub const EMPTY: Self = Self { depth: [[0.0; 64]; W], ids: [[NOTHING; 64]; W], farthest: 0.0 };

    /// Offers a triangle to the points of the pixel with this upper left corner, 1/256 px from the
    /// picture's centre.
    #[inline(always)]
    pub fn offer(&mut self, isa: Isa, triangle: &mut PointTriangle, corner: [i32; 2]) {
        // Of equal depths the lower id is kept.
        if triangle.nearest < self.farthest {
            return;
        }
        let Some(outline) = triangle.at(corner) else { return };
        let (id, plane) = (triangle.id, triangle.plane_at(corner));
        let (depth, ids) = (self.depth.as_flattened_mut(), self.ids.as_flattened_mut());
        let seen = outline.inside::<W>(isa).filter(|i| {
            let (own, other) = (plane.at::<W>(i), depth[i]);
            own > other || (own == other && own > 0.0 && id < ids[i])
        });
        if seen.is_empty() {
            return;
        }
        seen.for_each(|i| (depth[i], ids[i]) = (plane.at::<W>(i), id));
        let mut farthest = [f32::INFINITY; LANES];
        for depths in depth.as_chunks::<LANES>().0 {
            for l in 0..LANES {
                farthest[l] = if depths[l] < farthest[l] { depths[l] } else { farthest[l] };
            }
        }
        self.farthest = farthest.into_iter().fold(f32::INFINITY, |least, z| if z < least { z } else { least });
    }

    /// As [`PixelFaces::shares`](super::faces::PixelFaces::shares).
    pub fn shares(&self, shares: &mut Shares<W>) {
        shares.clear();
        // By hash: one more than the number of the share; 0 where there is none.
        let mut places = [0_u16; 2 * POINTS];
        let (depth, ids) = (self.depth.as_flattened(), self.ids.as_flattened());
        for i in (0..Lattice::<W>::POINTS).filter(|&i| ids[i] != NOTHING) {
            let id = ids[i];
            let mut place = id as usize % places.len();
            while places[place] != 0 && shares.all()[usize::from(places[place]) - 1].id != id {
                place = (place + 1) % places.len();
            }
            if places[place] == 0 {
                shares.push(Share { id, points: PointSet::NONE, depth: depth[i] });
                places[place] = shares.all().len() as u16;
            }
            shares.add_point(usize::from(places[place]) - 1, i);
        }
    }
}
