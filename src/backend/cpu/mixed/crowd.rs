//! Stage mixed, per pixel: the face that each point sees, one after the other. For pixels of many faces, and for tests.

use super::faces::PixelFaces;
use super::points::PointSet;
use super::shares::{Share, Shares};
use super::triangle::PointTriangle;
use crate::backend::cpu::geometry::samples::NOTHING;
use crate::backend::cpu::isa::{Isa, LANES};
use crate::backend::sample_partition::POINTS;

/// The faces that the points of a pixel see, and their depths.
pub struct Crowd {
    /// Reversed depth of each point; 0 where there is nothing.
    pub depth: [f32; POINTS],
    /// Triangle of each.
    pub ids: [u32; POINTS],
    /// No point is farther.
    farthest: f32,
}

impl Crowd {
    /// A pixel without triangles.
    pub const EMPTY: Self = Self { depth: [0.0; POINTS], ids: [NOTHING; POINTS], farthest: 0.0 };

    /// A pixel of these faces.
    pub fn of(pixel: &PixelFaces) -> Self {
        let mut crowd = Self::EMPTY;
        for face in pixel.faces() {
            face.points.for_each(|i| (crowd.depth[i], crowd.ids[i]) = (face.plane.at(i), face.id));
        }
        crowd
    }

    /// Offers a triangle to the points of the pixel with this upper left corner, 1/256 px from the
    /// picture's centre.
    #[inline(always)]
    pub fn offer(&mut self, isa: Isa, triangle: &mut PointTriangle, id: u32, corner: [i32; 2]) {
        // Of equal depths the lower id is kept.
        if triangle.nearest < self.farthest {
            return;
        }
        let Some(outline) = triangle.at(corner) else { return };
        let plane = triangle.plane_at(corner);
        let seen = outline.inside(isa).filter(|i| {
            let (own, other) = (plane.at(i), self.depth[i]);
            own > other || (own == other && own > 0.0 && id < self.ids[i])
        });
        if seen.is_empty() {
            return;
        }
        seen.for_each(|i| (self.depth[i], self.ids[i]) = (plane.at(i), id));
        let mut farthest = [f32::INFINITY; LANES];
        for depths in self.depth.as_chunks::<LANES>().0 {
            for l in 0..LANES {
                farthest[l] = if depths[l] < farthest[l] { depths[l] } else { farthest[l] };
            }
        }
        self.farthest = farthest.into_iter().fold(f32::INFINITY, |least, z| if z < least { z } else { least });
    }

    /// As [`PixelFaces::shares`].
    pub fn shares(&self, shares: &mut Shares) {
        shares.clear();
        // By hash: one more than the number of the share; 0 where there is none.
        let mut places = [0_u16; 2 * POINTS];
        for (i, &id) in self.ids.iter().enumerate() {
            if id == NOTHING {
                continue;
            }
            let mut place = id as usize % places.len();
            while places[place] != 0 && shares.all()[usize::from(places[place]) - 1].id != id {
                place = (place + 1) % places.len();
            }
            if places[place] == 0 {
                shares.push(Share { id, points: PointSet::NONE, depth: self.depth[i] });
                places[place] = shares.all().len() as u16;
            }
            shares.add_point(usize::from(places[place]) - 1, i);
        }
    }
}
