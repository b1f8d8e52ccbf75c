//! The draft of a [`Sheet`] (several views of a mesh), which collects what a request says about it.
//! When every key is known, it is checked whether the sheet goes with the camera and with the picture's
//! size.

use super::error::{RequestError, RequestFault};
use crate::image::ImageFormat;
use crate::spec::{CELL_PX_MIN, CameraSpec, ImageSpec, NamedView, Sheet, SheetViews};

/// The views of a sheet that names none.
const VIEWS: [NamedView; 4] = [NamedView::Front, NamedView::Left, NamedView::Top, NamedView::Iso];

/// A sheet whose keys are being read.
#[derive(Clone, Debug, Default)]
pub struct SheetDraft {
    /// See [`SheetViews::Named`].
    pub views: Option<Vec<NamedView>>,
    /// See [`SheetViews::Turntable`].
    pub turntable: Option<u32>,
    /// See [`Sheet::columns`].
    pub columns: Option<u32>,
    /// See [`Sheet::labels`].
    pub labels: bool,
}

impl SheetDraft {
    /// The sheet, if it goes with the camera and the picture's size. `px_max` is the longest side of a
    /// picture.
    pub fn finish(&self, camera: &CameraSpec, image: &ImageSpec, px_max: u64) -> Result<Sheet, RequestError> {
        let conflict = |key: &str, why: &str| Err(RequestError::new(RequestFault::Conflict, key, "given", why));
        let views = match (&self.views, self.turntable) {
            (Some(_), Some(_)) => {
                return conflict("sheet.turntable", "`sheet.views` is given too: choose one of the two");
            }
            (_, Some(steps)) => SheetViews::Turntable(steps),
            (views, None) => SheetViews::Named(views.clone().unwrap_or_else(|| VIEWS.to_vec())),
        };
        let angles = [("camera.azimuth_deg", camera.azimuth_deg), ("camera.elevation_deg", camera.elevation_deg)];
        if let (SheetViews::Named(_), Some((key, _))) = (&views, angles.iter().find(|(_, angle)| angle.is_some())) {
            return conflict(key, "each view of `sheet.views` has its own angles");
        }
        if camera.eye.is_some() {
            return conflict("camera.eye", "a sheet has directions to look from, which fit the mesh");
        }
        if camera.from_file {
            return conflict("camera.from_file", "a sheet has directions to look from, which fit the mesh");
        }
        let sheet = Sheet { views, columns: self.columns, labels: self.labels };
        check_size(&sheet, image, px_max)?;
        Ok(sheet)
    }
}

/// Refuses cells that are too small, and frames that are larger together than the largest picture.
fn check_size(sheet: &Sheet, image: &ImageSpec, px_max: u64) -> Result<(), RequestError> {
    let size_px = [image.width_px, image.height_px];
    let given = format!("{}x{}", size_px[0], size_px[1]);
    if sheet.is_animated(image.format.unwrap_or(ImageFormat::Png)) {
        let pixels = u64::from(size_px[0]) * u64::from(size_px[1]) * u64::from(sheet.count());
        let most = px_max.saturating_mul(px_max);
        if pixels > most {
            let allowed = format!(
                "a size for which the {} frames have at most {most} pixels together, or a grid by `sheet.columns`",
                sheet.count()
            );
            return Err(RequestError::new(RequestFault::OutOfRange, "size", given, allowed));
        }
        return Ok(());
    }
    let [columns, rows] = sheet.grid();
    if size_px[0] / columns < CELL_PX_MIN || size_px[1] / rows < CELL_PX_MIN {
        let allowed = format!("a size that gives each of {columns} x {rows} cells at least {CELL_PX_MIN} px a side");
        return Err(RequestError::new(RequestFault::OutOfRange, "size", given, allowed));
    }
    Ok(())
}
