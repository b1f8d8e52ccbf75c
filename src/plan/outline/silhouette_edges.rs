//! The silhouette edges of a view: where surfaces end on screen, and on which side of each edge
//! nothing is.

use crate::limits::Stopped;
use crate::mesh::Mesh;
use crate::mesh::edges::EdgeList;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::edges::silhouettes::Silhouettes;
use crate::plan::projection::row_dot;
use crate::plan::{Edge, PlanError, Projection};
use crate::scene::{Fill, MaterialGroups, Scene, Thickness};
use crate::spec::Cull;

/// An edge beside which an outline is drawn.
#[derive(Clone, Copy, Debug)]
pub struct SilhouetteEdge {
    /// Its ends.
    pub vertices: [u32; 2],
    /// Its faces that are drawn.
    pub faces: [u32; 2],
    /// The side that is free, as the sign of `(end - start) x (point - end)` on screen, where y
    /// points down.
    pub free: i8,
    /// The material whose outline it is.
    pub material: u32,
}

/// A mesh as one view shows it.
pub struct ScreenMesh<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// The view.
    pub projection: Projection,
    /// X, Y and W of each position.
    pub places: Vec<[f64; 3]>,
    /// By face: -1 front, 1 back, 0 edge on.
    facing: Vec<i8>,
    /// By material: the side that is culled.
    culls: Vec<Cull>,
}

impl<'a> ScreenMesh<'a> {
    /// Projects the mesh of a scene.
    pub fn new(scene: &Scene<'a, '_>, cx: &mut PlanContext<'_>) -> Result<Self, PlanError> {
        let (mesh, groups) = (scene.mesh, &scene.groups);
        let projection = Projection::new(&scene.camera, scene.size_px(), true);
        let PlanContext { budget, deadline, .. } = cx;
        budget.spend("an outline", mesh.positions.len() as u64, size_of::<[f64; 3]>() as u64)?;
        budget.spend("an outline", mesh.triangles.len() as u64, 1)?;
        budget.spend("materials", groups.material_count() as u64, 1)?;
        let mut places = Vec::with_capacity(mesh.positions.len());
        for positions in mesh.positions.chunks(CHECK_EVERY) {
            deadline.check()?;
            let rows = [&projection.x, &projection.y, &projection.w];
            places.extend(positions.iter().map(|p| rows.map(|row| row_dot(row, *p))));
        }
        let mut facings = Vec::with_capacity(mesh.triangles.len());
        for triangles in mesh.triangles.chunks(CHECK_EVERY) {
            deadline.check()?;
            facings.extend(triangles.iter().map(|triangle| facing(mesh, &places, *triangle)));
        }
        let culls = (0..groups.material_count()).map(|m| cull(groups, m)).collect();
        Ok(Self { mesh, projection, places, facing: facings, culls })
    }

    /// The silhouette edges of the materials that have an outline (`outlines`, by material).
    pub fn silhouette_edges(
        &self,
        outlines: &[Option<Thickness>],
        list: &EdgeList,
        silhouettes: &Silhouettes,
        cx: &mut PlanContext<'_>,
    ) -> Result<Vec<SilhouetteEdge>, PlanError> {
        let each = |each: &mut dyn FnMut(SilhouetteEdge)| {
            for (i, edge) in list.edges.iter().enumerate() {
                if i % CHECK_EVERY == 0 {
                    cx.deadline.check()?;
                }
                let edge = Edge::new(&self.mesh.positions, edge.vertices, edge.faces);
                let Some(edge) = silhouettes.edge(self.mesh, i as u32, edge) else { continue };
                let faces = self.drawn(edge.faces);
                let Some(material) = self.material(faces, outlines) else { continue };
                for &free in self.free_sides(edge.vertices, faces) {
                    each(SilhouetteEdge { vertices: edge.vertices, faces, free, material });
                }
            }
            Ok::<(), Stopped>(())
        };
        let mut count = 0;
        each(&mut |_| count += 1)?;
        cx.budget.spend("an outline's edges", count, size_of::<SilhouetteEdge>() as u64)?;
        let mut found = Vec::with_capacity(count as usize);
        each(&mut |edge| found.push(edge))?;
        Ok(found)
    }

    /// The side that a face shows: -1 its front, 1 its back, 0 neither. None where that side is
    /// culled, or where there is no such face.
    pub fn shown(&self, face: u32) -> Option<i8> {
        let facing = *self.facing.get(face as usize)?;
        let material = self.mesh.triangle_materials[face as usize] as usize;
        match self.culls.get(material) {
            Some(Cull::Back) if facing > 0 => None,
            Some(Cull::Front) if facing < 0 => None,
            _ => Some(facing),
        }
    }

    /// Those of two faces that are drawn, in order.
    fn drawn(&self, faces: [u32; 2]) -> [u32; 2] {
        let [a, b] = faces.map(|face| self.shown(face).map_or(Edge::NO_FACE, |_| face));
        if a == Edge::NO_FACE { [b, a] } else { [a, b] }
    }

    /// Of two faces' materials, the lowest that has an outline.
    fn material(&self, faces: [u32; 2], outlines: &[Option<Thickness>]) -> Option<u32> {
        let of = |face: &u32| self.mesh.triangle_materials.get(*face as usize).copied();
        faces.iter().filter_map(of).filter(|&m| outlines.get(m as usize).is_some_and(Option::is_some)).min()
    }

    /// The sides of an edge on which its surface ends. An only face that is seen edge on ends on
    /// both.
    fn free_sides(&self, vertices: [u32; 2], faces: [u32; 2]) -> &'static [i8] {
        let [a, b] = faces.map(|face| self.side_of(vertices, face));
        match (a < 0 || b < 0, a > 0 || b > 0) {
            (true, false) => &[1],
            (false, true) => &[-1],
            (false, false) if faces[1] == Edge::NO_FACE => &[-1, 1],
            _ => &[],
        }
    }

    /// The side of an edge on which a face lies.
    fn side_of(&self, [from, to]: [u32; 2], face: u32) -> i8 {
        let Some(&facing) = self.facing.get(face as usize) else { return 0 };
        let corners = self.mesh.triangles[face as usize];
        let runs_along = (0..3).any(|k| corners[k] == from && corners[(k + 1) % 3] == to);
        if runs_along { facing } else { -facing }
    }
}

/// The side of a material that is culled, if the material is filled.
fn cull(groups: &MaterialGroups<'_>, material: usize) -> Cull {
    match groups.fill(material) {
        Fill::None => Cull::None,
        _ => groups.by_material[material].surface.map_or(Cull::None, |surface| surface.cull),
    }
}

/// The side that a triangle shows: the sign of the volume that it spans with the eye. It is right
/// for corners behind the eye too.
fn facing(mesh: &Mesh, places: &[[f64; 3]], triangle: [u32; 3]) -> i8 {
    // Corners are sorted, so that rounding does not depend on which comes first or on the winding.
    let mut sorted = triangle;
    let mut is_even = true;
    for (i, j) in [(0, 1), (1, 2), (0, 1)] {
        if mesh.positions[sorted[i] as usize] > mesh.positions[sorted[j] as usize] {
            sorted.swap(i, j);
            is_even = !is_even;
        }
    }
    let [a, b, c] = sorted.map(|v| places[v as usize]);
    let (x, y, w) = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
    let volume = (x * c[0] + y * c[1]) + w * c[2];
    let sign = i8::from(volume > 0.0) - i8::from(volume < 0.0);
    if is_even { sign } else { -sign }
}
