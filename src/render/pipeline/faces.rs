//! The opaque face of the mesh that each pixel of a picture shows at its centre, and its distance along
//! the direction of view. Programs that use the library need both to draw something over a picture
//! themselves. The CPU back-end finds them, whichever back-end draws the picture.

use super::{Context, RenderError, Stage, Staged, View, with_scene};
use crate::backend::Renderer as _;
use crate::plan;
use crate::spec::{Samples, Spec};

/// The triangle that each pixel of a view shows at its centre, and how far away it is.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FaceBuffer {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Indices of triangles in the order of the file, rows from the top; [`NONE`](Self::NONE) where there is no triangle.
    pub triangles: Vec<u32>,
    /// Distances from the eye along the direction of view, in the file's units; infinite where there is no triangle. In an
    /// orthographic view, which has no eye, they begin before the nearest point of the mesh.
    pub depths: Vec<f32>,
}

impl FaceBuffer {
    /// The entry of a pixel without a triangle.
    pub const NONE: u32 = u32::MAX;
}

/// Finds the opaque faces that a picture of this request shows. Where it shows the mesh's lines, points or outline beyond
/// the faces, or a transparent face alone, there is no triangle. The CPU draws.
pub fn find_faces(view: View<'_>, spec: &Spec, cx: &mut Context<'_>) -> Result<FaceBuffer, RenderError> {
    let mut spec = Spec { sheet: None, quality_target: None, ..spec.clone() };
    spec.image.samples = Samples::Fixed(1);
    let Context { backends, budget, deadline, ended } = cx;
    with_scene(view, &spec, false, budget, deadline, |Staged { scene, prepared, is_uv_layout, .. }, budget| {
        let plan = plan::build_from(&scene, prepared, budget, deadline)?;
        let pixels = u64::from(plan.width_px) * u64::from(plan.height_px);
        budget.spend("the faces of the pixels", pixels, 16).map_err(plan::PlanError::Limit)?;
        let cpu = backends.on_cpu();
        budget.spend("bands of the picture", cpu.bands_bytes(&plan), 1).map_err(plan::PlanError::Limit)?;
        ended(Stage::Plan);
        let words = cpu.draw_visibility(&plan, deadline)?;
        ended(Stage::Render);
        // The faces of a layout of the texture are none in space.
        let count = if is_uv_layout { 0 } else { scene.mesh.triangles.len() as u32 };
        let triangle = |word: u64| Some(!(word as u32)).filter(|&id| word != 0 && id < count);
        let distance = |word: u64| {
            let depth = f64::from(f32::from_bits((word >> 32) as u32));
            (scene.camera.distance_of(depth) * scene.mesh.to_file.scale) as f32
        };
        Ok(FaceBuffer {
            width_px: plan.width_px,
            height_px: plan.height_px,
            triangles: words.iter().map(|&word| triangle(word).unwrap_or(FaceBuffer::NONE)).collect(),
            depths: words.iter().map(|&word| triangle(word).map_or(f32::INFINITY, |_| distance(word))).collect(),
        })
    })
}
