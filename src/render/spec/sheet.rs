//! Several views of one mesh, as a request describes them.

use super::NamedView;
use crate::image::ImageFormat;

/// Most views of a sheet.
pub const SHEET_VIEWS_MAX: usize = 64;

/// Fewest and most steps of a turntable.
pub const TURNTABLE_STEPS: [u32; 2] = [2, 64];

/// Least width and height of a cell, pixels.
pub const CELL_PX_MIN: u32 = 8;

/// Several views of one mesh: side by side in one picture, or one after the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sheet {
    /// The views, in order.
    pub views: SheetViews,
    /// Columns of the grid. None: as many as rows, or one more; a turntable is animated where the format
    /// can be.
    pub columns: Option<u32>,
    /// Each view has its name written into its lower left corner.
    pub labels: bool,
}

/// The views of a sheet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SheetViews {
    /// Named directions; at least one.
    Named(Vec<NamedView>),
    /// So many directions around the up axis, at equal angles, beginning with the camera's own.
    Turntable(u32),
}

impl Sheet {
    /// The number of views.
    pub fn count(&self) -> u32 {
        match &self.views {
            SheetViews::Named(views) => views.len() as u32,
            SheetViews::Turntable(steps) => *steps,
        }
    }

    /// True if a file of this format shows the views one after the other.
    pub fn is_animated(&self, format: ImageFormat) -> bool {
        let is_turntable = matches!(self.views, SheetViews::Turntable(_));
        is_turntable && self.columns.is_none() && format != ImageFormat::Jpeg
    }

    /// Columns and rows of the grid.
    pub fn grid(&self) -> [u32; 2] {
        let count = self.count().max(1);
        let square = (1..=count).find(|side| side * side >= count).unwrap_or(1);
        let columns = self.columns.unwrap_or(square).clamp(1, count);
        [columns, count.div_ceil(columns)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_have_a_place_for_each_view() {
        let grid = |count, columns| Sheet { views: SheetViews::Turntable(count), columns, labels: false }.grid();
        let cases = [
            (1, None, [1, 1]),
            (2, None, [2, 1]),
            (4, None, [2, 2]),
            (5, None, [3, 2]),
            (24, None, [5, 5]),
            (4, Some(2), [2, 2]),
            (5, Some(2), [2, 3]),
            (3, Some(8), [3, 1]),
            (64, Some(1), [1, 64]),
        ];
        for (count, columns, expected) in cases {
            assert_eq!(grid(count, columns), expected, "{count} {columns:?}");
        }
    }
}
