//! Line segments and points: what a file draws without area.

/// Triangles that a segment becomes when it is drawn.
pub const SEGMENT_TRIANGLES: u64 = 2;
/// Triangles that a point becomes when it is drawn.
pub const POINT_TRIANGLES: u64 = 4;

/// A line segment, or a point where both ends are one vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineOrPoint {
    /// Its ends: indices of vertices, or of positions once they are welded.
    pub ends: [u32; 2],
    /// Index of its material.
    pub material: u32,
}

impl LineOrPoint {
    /// A point.
    pub fn point(vertex: u32, material: u32) -> Self {
        Self { ends: [vertex; 2], material }
    }

    /// Whether it is one.
    pub fn is_point(&self) -> bool {
        self.ends[0] == self.ends[1]
    }
}

/// Triangles that all of them become when they are drawn.
pub fn triangles<'a>(loose: impl IntoIterator<Item = &'a LineOrPoint>) -> u64 {
    loose.into_iter().map(|one| if one.is_point() { POINT_TRIANGLES } else { SEGMENT_TRIANGLES }).sum()
}
