//! The triangles of a plan, with their positions, normals and materials: first those of the mesh,
//! then small triangles that stand for its lines and points, then those of the ground's shadow. The
//! mesh itself is not changed, since the added triangles belong to one picture.

use super::CornerValues;
use super::shared_slice::SharedSlice;
use crate::mesh::Mesh;

/// Everything that a plan draws as triangles of the mesh's kind.
///
/// The mesh's own positions and triangles come first and keep their numbers. Nothing is written
/// back into the mesh: triangles that face the camera of one picture are part of its plan.
#[derive(Clone, Debug)]
pub struct Geometry<'m> {
    /// Positions in the unit box.
    pub positions: SharedSlice<'m, [f32; 3]>,
    /// Three indices into `positions` per triangle.
    pub triangles: SharedSlice<'m, [u32; 3]>,
    /// A unit normal per triangle.
    pub face_normals: SharedSlice<'m, [f32; 3]>,
    /// A material index per triangle.
    pub triangle_materials: SharedSlice<'m, u32>,
    /// Three indices into the mesh's attributes per triangle; empty where the mesh has none.
    pub attribute_triangles: SharedSlice<'m, [u32; 3]>,
    /// Vertex normals of the file, among the attributes; empty where it has none.
    pub normals: SharedSlice<'m, [f32; 3]>,
    /// Colours in place of the mesh's own, where points have a depth cue.
    pub colors: Option<CornerValues<'m, [f32; 4]>>,
    /// Number of triangles that are the mesh's own. Only these have edges.
    pub mesh_triangle_count: usize,
}

impl<'m> Geometry<'m> {
    /// The mesh and nothing else.
    pub fn of_mesh(mesh: &'m Mesh) -> Self {
        Self {
            positions: (&mesh.positions).into(),
            triangles: (&mesh.triangles).into(),
            face_normals: (&mesh.face_normals).into(),
            triangle_materials: (&mesh.triangle_materials).into(),
            attribute_triangles: (&mesh.attribute_triangles).into(),
            normals: (&mesh.normals).into(),
            colors: None,
            mesh_triangle_count: mesh.triangles.len(),
        }
    }
}
