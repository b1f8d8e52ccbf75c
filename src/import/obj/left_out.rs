//! What an OBJ file has that is not drawn.

use crate::warning::Warning;

/// Counts of lines that were passed over.
#[derive(Debug, Default)]
pub struct LeftOut {
    /// `f` lines with fewer than three corners.
    pub short_faces: u64,
    /// Free-form geometry.
    pub curves: u64,
    /// Vertices that differ from the first in having a colour or not.
    pub colors: u64,
}

impl LeftOut {
    /// One warning for each kind that occurred.
    pub fn warnings(&self) -> Vec<Warning> {
        [
            (self.short_faces, "short_faces_ignored", "faces with fewer than three corners are not drawn"),
            (self.curves, "curves_ignored", "free-form curves and surfaces are not drawn"),
            (self.colors, "colors_incomplete", "vertices differ from the first one in having a colour or not"),
        ]
        .into_iter()
        .filter(|(count, _, _)| *count > 0)
        .map(|(count, code, what)| Warning { code, detail: format!("{what} (lines in the file: {count})") })
        .collect()
    }
}
