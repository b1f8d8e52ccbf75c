//! Line segments and points of a file, which have no area.
//!
//! Where their material has a filled surface, they are drawn as small triangles that face the
//! camera. On import these triangles already count against the limit of triangles.

/// The number of triangles that a segment is drawn as.
pub const SEGMENT_TRIANGLES: u64 = 2;
/// The number of triangles that a point is drawn as.
pub const POINT_TRIANGLES: u64 = 4;

/// A line segment, or a point: a segment whose ends are the same vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct LineOrPoint {
    /// Indices of the two ends: of the file's vertices during import, of welded positions in a
    /// [`Mesh`](super::Mesh).
    pub ends: [u32; 2],
    /// Index of the material.
    pub material: u32,
}

impl LineOrPoint {
    /// A point.
    pub fn point(vertex: u32, material: u32) -> Self {
        Self { ends: [vertex; 2], material }
    }

    /// True if this is a point.
    pub fn is_point(&self) -> bool {
        self.ends[0] == self.ends[1]
    }
}

/// The number of triangles that all of `primitives` together are drawn as.
pub fn triangles<'a>(primitives: impl IntoIterator<Item = &'a LineOrPoint>) -> u64 {
    primitives.into_iter().map(|one| if one.is_point() { POINT_TRIANGLES } else { SEGMENT_TRIANGLES }).sum()
}
