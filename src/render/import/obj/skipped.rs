//! Counts of lines of an OBJ file for warnings: faces with too few corners and free-form geometry,
//! which are not drawn, and vertices that differ from the first in having a colour or not.

use crate::import::report::counted_warnings;
use crate::warning::Warning;

/// Counts of skipped lines.
#[derive(Debug, Default)]
pub struct Skipped {
    /// `f` lines with fewer than three corners.
    pub short_faces: u64,
    /// Free-form geometry.
    pub curves: u64,
    /// Vertices that differ from the first in having a colour or not.
    pub colors: u64,
}

impl Skipped {
    /// Adds the counts of another part.
    pub fn add(&mut self, more: &Self) {
        self.short_faces += more.short_faces;
        self.curves += more.curves;
        self.colors += more.colors;
    }

    /// One warning for each kind that occurred.
    pub fn warnings(&self) -> Vec<Warning> {
        let kinds = [
            (
                self.short_faces,
                "short_faces_ignored",
                "faces with fewer than three corners are not drawn (lines in the file:",
            ),
            (self.curves, "curves_ignored", "free-form curves and surfaces are not drawn (lines in the file:"),
            (
                self.colors,
                "colors_incomplete",
                "vertices differ from the first one in having a colour or not (lines in the file:",
            ),
        ];
        counted_warnings(kinds).collect()
    }
}
