//! The table of the colours of triangles that have one colour all over, by triangle id. `flat`
//! fills it. `flat` and the stage mixed look colours up in it.

/// Marks a colour that is computed per pixel: the triangle is clipped, or its colour is not finite
/// (infinity times a weight of 0 is not 0).
pub const UNKNOWN: [f32; 4] = [f32::NAN; 4];

/// Colours by triangle id, for the triangles in the bins.
#[derive(Default)]
pub struct FlatColors {
    /// Premultiplied linear RGBA; after the last triangle's, that of no triangle.
    pub(super) colors: Vec<[f32; 4]>,
}

impl FlatColors {
    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.colors.capacity() * size_of::<[f32; 4]>()
    }

    /// The colour of a triangle; None where it has to be found per pixel.
    #[inline(always)]
    pub fn known(&self, id: u32) -> Option<[f32; 4]> {
        let color = self.of(id);
        (!color[3].is_nan()).then_some(color)
    }

    /// The colour of a triangle, or [`UNKNOWN`].
    #[inline(always)]
    pub fn of(&self, id: u32) -> [f32; 4] {
        let last = self.colors.len().wrapping_sub(1);
        self.colors.get((id as usize).min(last)).copied().unwrap_or_default()
    }
}
