//! The inverted hull: back faces alone, each vertex pushed out along its normal.

use std::borrow::Cow;

/// The triangles with [`roles::HULL`](super::roles::HULL), pushed out.
#[derive(Debug)]
pub struct HullPass<'a> {
    /// Premultiplied linear RGBA, by material index; one where all are the same.
    pub colors: Vec<[f32; 4]>,
    /// A unit vector a position: where it moves to.
    pub normals: Cow<'a, [[f32; 3]]>,
    /// How far.
    pub offset: HullOffset,
    /// How far each position moves, in the unit of `offset`, where parts differ or corners have to move farther than sides; else empty, and all move by `offset`.
    pub amounts: Vec<f32>,
    /// Material index a triangle; empty where all are the same. Unlike the surface's, never merged because they look alike:
    /// it also says what hides which hull, see [`LayersPass`](super::LayersPass).
    pub triangle_materials: &'a [u32],
}

impl HullPass<'_> {
    /// How far a position moves.
    #[inline(always)]
    pub fn offset_at(&self, position: usize) -> HullOffset {
        match (self.amounts.get(position), self.offset) {
            (None, offset) => offset,
            (Some(&amount), HullOffset::Object(_)) => HullOffset::Object(amount),
            (Some(&amount), HullOffset::Px(_)) => HullOffset::Px(amount),
        }
    }

    /// The material of a triangle.
    #[inline(always)]
    pub fn material(&self, triangle: usize) -> u32 {
        self.triangle_materials.get(triangle).copied().unwrap_or(0)
    }

    /// The colour of a triangle's back.
    #[inline(always)]
    pub fn color(&self, triangle: usize) -> [f32; 4] {
        let last = self.colors.len().saturating_sub(1);
        self.colors.get((self.material(triangle) as usize).min(last)).copied().unwrap_or_default()
    }
}

/// How far a hull vertex moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HullOffset {
    /// Along the normal, in units of the box.
    Object(f32),
    /// On screen along the projected normal, in pixels.
    Px(f32),
}
