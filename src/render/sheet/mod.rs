//! Sheets: several views of one mesh in one picture. A [`Layout`] says where each view is, [`Canvas`]
//! puts the drawn views together and can write their names.
//!
//! The size that a request gives is that of the whole sheet. Its cells (one for each view, and maybe
//! empty ones in the last row) divide all of it: no pixel is left over, and the cells of a row differ in
//! width by one pixel at most. The frames of an animation have the whole size each. Until they are
//! encoded, they are one tall picture, from the first frame at the top to the last.

use crate::caption::{TEXT_HEIGHT, dot_px, text_width_px, write};
use crate::image::Image;
use crate::limits::{Budget, LimitExceeded};
use crate::spec::words::word_for;
use crate::spec::{CameraSpec, ImageSpec, Layers, Sheet, SheetViews, Spec};

/// The places of a sheet's views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Columns and rows of cells.
    grid: [u32; 2],
    /// Size of the whole.
    size_px: [u32; 2],
    /// Views; cells behind the last are empty.
    count: u32,
}

/// The place of one view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    /// The view's number, from 0; None for an empty cell.
    pub view: Option<u32>,
    /// Left and upper side.
    pub at_px: [u32; 2],
    /// Width and height.
    pub size_px: [u32; 2],
}

impl Layout {
    /// A grid within the picture's size, or the frames of an animation, each of that size.
    pub fn new(sheet: &Sheet, image: &ImageSpec, is_animated: bool) -> Self {
        let (count, [width_px, height_px]) = (sheet.count(), [image.width_px, image.height_px]);
        if is_animated {
            return Self { grid: [1, count], size_px: [width_px, height_px.saturating_mul(count)], count };
        }
        Self { grid: sheet.grid(), size_px: [width_px, height_px], count }
    }

    /// The cells, row by row.
    pub fn cells(self) -> impl Iterator<Item = Cell> {
        let [columns, rows] = self.grid;
        let side =
            |size: u32, part: u32, parts: u32| (u64::from(size) * u64::from(part) / u64::from(parts.max(1))) as u32;
        (0..columns * rows).map(move |i| {
            let (column, row) = (i % columns, i / columns);
            let low = [side(self.size_px[0], column, columns), side(self.size_px[1], row, rows)];
            let high = [side(self.size_px[0], column + 1, columns), side(self.size_px[1], row + 1, rows)];
            Cell { view: (i < self.count).then_some(i), at_px: low, size_px: [high[0] - low[0], high[1] - low[1]] }
        })
    }
}

/// The request for the picture in a cell. An empty cell shows the background alone.
pub fn cell_spec(spec: &Spec, sheet: &Sheet, cell: &Cell) -> Spec {
    let [width_px, height_px] = cell.size_px;
    let image = ImageSpec { width_px, height_px, ..spec.image };
    let camera = match (&sheet.views, cell.view) {
        (SheetViews::Named(views), Some(view)) => {
            CameraSpec { view: views[view as usize % views.len()], ..spec.camera }
        }
        (SheetViews::Turntable(steps), Some(view)) => {
            let azimuth_deg = Some(spec.camera.azimuth_deg() + turn_deg(view, *steps));
            CameraSpec { azimuth_deg, fits_turn: true, ..spec.camera }
        }
        (_, None) => spec.camera,
    };
    let mut of_cell = Spec { image, camera, sheet: None, ..spec.clone() };
    if cell.view.is_none() {
        of_cell = Spec { layers: Layers::default(), materials: Vec::new(), topology: None, ..of_cell };
    }
    of_cell
}

/// The name of a view: that of its direction, or the angle of a turntable.
pub fn label(sheet: &Sheet, view: u32) -> String {
    match &sheet.views {
        SheetViews::Named(views) => word_for(views[view as usize % views.len()]).to_owned(),
        SheetViews::Turntable(steps) => format!("{:.0}°", turn_deg(view, *steps)),
    }
}

fn turn_deg(view: u32, steps: u32) -> f64 {
    360.0 * f64::from(view) / f64::from(steps)
}

/// A sheet that is being put together.
pub struct Canvas {
    image: Image,
}

impl Canvas {
    /// A transparent sheet.
    pub fn new(layout: Layout, budget: &mut Budget) -> Result<Self, LimitExceeded> {
        let [width_px, height_px] = layout.size_px;
        let pixels = u64::from(width_px) * u64::from(height_px);
        budget.spend("the sheet", pixels, 4)?;
        Ok(Self { image: Image { width_px, height_px, rgba: vec![0; pixels as usize * 4].into() } })
    }

    /// Puts a picture of the cell's size into it.
    pub fn paste(&mut self, cell: &Cell, picture: &Image) {
        let row_bytes = cell.size_px[0] as usize * 4;
        for (y, row) in picture.rgba.chunks_exact(row_bytes).take(cell.size_px[1] as usize).enumerate() {
            let at = self.byte(cell.at_px[0], cell.at_px[1] + y as u32);
            self.image.rgba[at..at + row_bytes].copy_from_slice(row);
        }
    }

    /// Writes a text into the lower left corner of a cell.
    pub fn write(&mut self, cell: &Cell, text: &str) {
        let dot_px = dot_px(cell.size_px);
        let inset_px = 4 * dot_px;
        let [width_px, bottom] = [cell.size_px[0], cell.size_px[1].saturating_sub(inset_px + TEXT_HEIGHT * dot_px)];
        if inset_px + text_width_px(text) * dot_px > width_px || bottom == 0 {
            return; // A cell without room for its name goes without.
        }
        write(&mut self.image, [cell.at_px[0] + inset_px, cell.at_px[1] + bottom], dot_px, text);
    }

    /// The sheet.
    pub fn finish(self) -> Image {
        self.image
    }

    fn byte(&self, x: u32, y: u32) -> usize {
        (y as usize * self.image.width_px as usize + x as usize) * 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::NamedView;
    use crate::spec::words::words_of;

    #[test]
    fn names_of_views_have_letters_that_the_font_has() {
        assert!(words_of::<NamedView>().concat().chars().all(|letter| letter.is_ascii_lowercase()));
    }

    fn sheet(count: usize, columns: Option<u32>) -> Sheet {
        Sheet { views: SheetViews::Named(vec![NamedView::Front; count]), columns, labels: true }
    }

    #[test]
    fn cells_cover_each_pixel_once() {
        for (count, columns, width_px, height_px) in [(4, Some(2), 64, 64), (5, None, 101, 67), (7, Some(3), 100, 31)] {
            let image = ImageSpec { width_px, height_px, ..ImageSpec::default() };
            let mut seen = vec![0; (width_px * height_px) as usize];
            let layout = Layout::new(&sheet(count, columns), &image, false);
            for Cell { at_px: [x, y], size_px: [width, height], .. } in layout.cells() {
                for (y, x) in (y..y + height).flat_map(|y| (x..x + width).map(move |x| (y, x))) {
                    seen[(y * width_px + x) as usize] += 1;
                }
            }
            assert!(seen.iter().all(|&times| times == 1), "{count} in {columns:?}");
            assert_eq!(layout.cells().filter(|cell| cell.view.is_some()).count(), count);
        }
    }
}
