//! A cache of the triangles that mixed pixels used last, with their edge functions set up (stage mixed). Mixed pixels
//! are drawn a second time, from 64 or 256 points each, and neighbours mostly show the same triangles.

use super::band_triangles::{BandTriangles, ScreenTriangle};
use super::triangle::PointTriangle;

/// Triangles that are remembered.
const COUNT: usize = 256;

/// An item that no band has.
const NO_ITEM: u32 = u32::MAX;

/// By the lowest bits of an item: a triangle.
#[derive(Default)]
pub struct Recent {
    places: Vec<RememberedTriangle>,
}

/// A slot of [`Recent`].
#[derive(Clone)]
struct RememberedTriangle {
    /// The item whose triangle it is, or [`NO_ITEM`].
    item: u32,
    /// None where it has no area.
    triangle: Option<PointTriangle>,
}

impl Recent {
    /// Allocated memory, at most, bytes.
    pub const BYTES_MAX: usize = COUNT * size_of::<RememberedTriangle>();

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.places.capacity() * size_of::<RememberedTriangle>()
    }

    /// Forgets all: another band has other items.
    pub fn clear(&mut self) {
        if self.places.is_empty() {
            self.places.reserve_exact(COUNT);
            self.places.resize(COUNT, RememberedTriangle { item: NO_ITEM, triangle: None });
        }
        for place in &mut self.places {
            place.item = NO_ITEM;
        }
    }

    /// The triangle of an item; None where it has no area.
    #[inline(always)]
    pub fn get(&mut self, triangles: &BandTriangles<'_>, item: u32) -> Option<&mut PointTriangle> {
        let place = self.places.get_mut(item as usize % COUNT)?;
        if place.item != item {
            let ScreenTriangle { id, corners } = triangles.get(item);
            *place = RememberedTriangle { item, triangle: PointTriangle::new(id, &corners) };
        }
        place.triangle.as_mut()
    }
}
