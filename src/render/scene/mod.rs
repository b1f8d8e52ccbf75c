//! The scene of a picture: a mesh and a request brought together. It has the placed camera and the style
//! that the request gives each material of the mesh. Both are worked out once per picture.
//!
//! Invariant: nothing here depends on the plan, which is made from a scene. The mesh and the request are
//! read and never changed.

mod border;
pub mod camera;
mod extents;
mod ground;
mod material_groups;
mod position_boxes;

pub use border::{LINE_PX, Thickness, point_width};
pub use ground::{GROUND_HEIGHT, GROUND_REACH, GroundPlane};
pub use material_groups::{Fill, MaterialGroups, barycentric_wire};
pub use position_boxes::PositionBoxes;

use border::{border, outline_thickness};
use camera::Camera;
use material_groups::GROUP_BYTES;
use position_boxes::BoxedPositions;

use crate::limits::{Budget, LimitExceeded};
use crate::mesh::Mesh;
use crate::spec::{Outline, Spec};

/// The content of one picture and the camera that sees it.
///
/// The mesh and the request have lifetimes of their own, because a plan borrows from the mesh but
/// outlives the request.
pub struct Scene<'m, 's> {
    /// The imported mesh.
    pub mesh: &'m Mesh,
    /// The request.
    pub spec: &'s Spec,
    /// The style of each material.
    pub groups: MaterialGroups<'s>,
    /// The camera, placed so that the mesh, its outlines and its lines fit the picture.
    pub camera: Camera,
}

/// Errors of making a scene from a mesh and a request.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SceneError {
    /// The materials take more memory than is allowed.
    #[error(transparent)]
    Limit(#[from] LimitExceeded),
    /// The request asks for the file's camera, and there is none.
    #[error("`camera.from_file` is true, and the file has no camera")]
    NoCamera,
}

impl<'m, 's> Scene<'m, 's> {
    /// Groups the mesh's materials by style and places the camera.
    pub fn new(mesh: &'m Mesh, spec: &'s Spec, budget: &mut Budget) -> Result<Self, SceneError> {
        let boxes = PositionBoxes::of(&mesh.positions, budget)?;
        Self::framed_by(None, &boxes, mesh, spec, budget)
    }

    /// As [`Scene::new`], but the camera is fitted to the positions in `framing`, if there are such. `boxes` are those of
    /// the mesh's positions.
    pub fn framed_by(
        framing: Option<&[[f32; 3]]>,
        boxes: &PositionBoxes,
        mesh: &'m Mesh,
        spec: &'s Spec,
        budget: &mut Budget,
    ) -> Result<Self, SceneError> {
        if spec.camera.from_file && mesh.cameras.is_empty() {
            return Err(SceneError::NoCamera);
        }
        budget.spend("materials", mesh.materials.len() as u64, GROUP_BYTES)?;
        let mut groups = MaterialGroups::new(mesh, spec);
        let size_px = [spec.image.width_px, spec.image.height_px];
        let of_framing = framing.map(|positions| PositionBoxes::of(positions, budget)).transpose()?;
        let all = BoxedPositions { positions: &mesh.positions, boxes };
        let framing = framing.zip(of_framing.as_ref());
        let framing = framing.map_or(all, |(positions, boxes)| BoxedPositions { positions, boxes });
        let place = |groups: &MaterialGroups<'_>| {
            Camera::place(&spec.camera, mesh, [framing, all], size_px, border(mesh, groups, spec))
        };
        let mut camera = place(&groups);
        // From below the picture is the one without a ground, to the byte.
        let ground = GroundPlane::new(mesh, spec.camera.up.unwrap_or(mesh.up));
        if groups.has_ground() && !ground.is_seen(&camera) {
            groups.leave_ground_out();
            camera = place(&groups);
        }
        Ok(Self { mesh, spec, groups, camera })
    }

    /// Columns and rows of the picture.
    pub fn size_px(&self) -> [u32; 2] {
        [self.spec.image.width_px, self.spec.image.height_px]
    }

    /// The distance that an outline reaches from its silhouette edge.
    pub fn outline_thickness(&self, outline: &Outline) -> Thickness {
        outline_thickness(self.mesh, outline)
    }

    /// Full width of a contour in pixels. A width in object units is taken at the mesh's centre.
    pub fn contour_width_px(&self, outline: &Outline) -> f32 {
        const WIDTH_MAX_PX: f32 = 100.0;
        let width_px = match self.outline_thickness(outline) {
            Thickness::Px(px) => px,
            Thickness::Object(units) => (f64::from(units) * self.camera.px_per_unit(self.size_px())) as f32,
        };
        width_px.min(WIDTH_MAX_PX)
    }
}
