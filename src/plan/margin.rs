//! How far beyond the picture samples are taken.
//!
//! A line is as wide as half a window around its edge, so a pixel at the picture's border may belong to a line whose middle lies
//! beyond it. What hides that is only known where there are samples. So where hidden lines are left out (or shown alone) and the mesh goes
//! on beyond the picture, the visibility buffer does too: by as much as bands of rows look at each other, because then a pixel's ink is
//! that of the same pixel in the middle of a larger picture. Nothing else is drawn there.

use super::skips::{SkipKind, Skips};
use super::{DrawPlan, LinePass, Projection};
use crate::limits::{Deadline, Stopped};
use crate::mesh::Mesh;
use crate::plan::context::CHECK_EVERY;
use crate::plan::outline::silhouette_edges::row_dot;

/// How far from the picture's border a mesh lies that lies inside, 1/256 px: lines ask a pixel beside an edge too, and vertices are
/// snapped.
const INSIDE: f64 = 2.0 * 256.0;

/// The margin where nothing needs one but it is kept, pixels.
const KEPT_PX: u32 = 8;

/// The margin of a plan with these lines, where something `hides` them.
///
/// No clamp is needed: with the widest lines that a request can ask for it is 139 pixels, and half of the largest picture and that
/// end well inside the guard band.
pub fn margin_px(
    mesh: &Mesh,
    (projection, size_px): (&Projection, [u32; 2]),
    (lines, hides): (&[LinePass], bool),
    skips: &mut Skips<'_>,
    deadline: &Deadline,
) -> Result<u32, Stopped> {
    let needed = lines.iter().map(LinePass::margin_rows).filter(|_| hides).max().unwrap_or(0);
    let (is_unneeded, why) = match needed {
        0 => (true, "no line asks what hides it"),
        _ => (lies_inside(mesh, projection, size_px, deadline)?, "the whole mesh lies inside the picture"),
    };
    let is_skipped = skips.skip(SkipKind::Margin, is_unneeded, why);
    Ok(if is_skipped { 0 } else { needed.max(KEPT_PX) })
}

/// Whether all of a mesh is before the eye and inside the picture.
fn lies_inside(mesh: &Mesh, projection: &Projection, size_px: [u32; 2], deadline: &Deadline) -> Result<bool, Stopped> {
    let half = size_px.map(|size| 128.0 * f64::from(size) - INSIDE);
    for positions in mesh.positions.chunks(CHECK_EVERY) {
        deadline.check()?;
        let is_inside = |p: &[f32; 3]| {
            let [x, y, w] = [&projection.x, &projection.y, &projection.w].map(|row| row_dot(row, *p));
            w >= f64::from(projection.near_w) && x.abs() <= half[0] * w && y.abs() <= half[1] * w
        };
        if !positions.iter().all(is_inside) {
            return Ok(false);
        }
    }
    Ok(true)
}

impl DrawPlan<'_> {
    /// Columns (or rows) that have visibility samples, from the first to before the last, given how many the picture has.
    #[inline(always)]
    pub fn seen_range(&self, size_px: u32) -> [i32; 2] {
        let margin = self.margin_px as i32;
        [-margin, size_px as i32 + margin]
    }
}
