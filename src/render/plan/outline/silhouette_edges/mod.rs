//! The silhouette edges of a view: the edges where a surface ends on screen, because all faces that are
//! drawn at the edge lie on one side of it. The other, free side is found, too: the outline is drawn there.

use std::sync::Arc;

use crate::limits::Stopped;
use crate::mesh::Mesh;
use crate::mesh::edges::{EdgeList, MeshEdge};
use crate::mesh::vector::{cross, dot, is_in_order, sub};
use crate::parallel;
use crate::plan::context::PlanContext;
use crate::plan::edges::face_runs::{FACES, FaceRuns};
use crate::plan::edges::select::{map, select_by};
use crate::plan::edges::silhouettes::{Silhouettes, hiding_materials, unseen_side};
use crate::plan::edges::view_of_runs::RunView;
use crate::plan::skips::SkipKind;
use crate::plan::{Edge, FaceSide, PlanError, Projection, Projector};
use crate::scene::{Fill, MaterialGroups, Scene, Thickness};
use crate::spec::Cull;

/// Runs of faces that a thread takes at a time.
const RUNS: usize = 128;

/// Outlines are cut at a plane that is farther than the near plane by this share of its distance: no corner of theirs is
/// behind the near plane for being rounded to f32.
const NEAR_MARGIN: f64 = 1e-5;

/// A volume, as a share of the product of its sides, that may be nothing but rounding.
const FLAT: f64 = 1e-12;

/// An edge beside which an outline is drawn.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Zeroable)]
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
    /// Its number in the mesh's list of edges.
    pub index: u32,
    /// True if the surface that it belongs to surely hides it.
    pub is_hidden: bool,
}

/// A mesh as one view shows it.
pub struct ScreenMesh<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// The view.
    pub projection: Projection,
    /// The same in f64.
    pub projector: Projector,
    /// The runs of its faces.
    pub runs: Arc<FaceRuns>,
    /// The same view of runs of faces.
    pub run_view: RunView,
    /// By face: -1 front, 1 back, 0 edge on.
    facing: Vec<i8>,
    /// Runs that may have silhouette edges.
    open_runs: Vec<u32>,
    /// By material: the side that is culled.
    culls: Vec<Cull>,
    /// The side that no face shows, because the mesh is closed and seen from outside.
    unseen: Option<FaceSide>,
    /// True if faces that show this side are left out where hiding faces are looked for.
    skips_unseen: bool,
}

impl<'a> ScreenMesh<'a> {
    /// Projects the mesh of a scene.
    pub fn new(scene: &Scene<'a, '_>, cx: &mut PlanContext<'_>) -> Result<Self, PlanError> {
        let (mesh, groups) = (scene.mesh, &scene.groups);
        let projection = Projection::new(&scene.camera, scene.size_px());
        let projector = Projector::new(&projection);
        let runs = cx.face_runs(mesh)?;
        let PlanContext { budget, deadline, .. } = cx;
        budget.spend("an outline", runs.runs.len() as u64, 1 + 4)?;
        budget.spend("an outline", mesh.triangles.len() as u64, 1)?;
        budget.spend("materials", groups.material_count() as u64, 1)?;
        let run_view = RunView::new(mesh, projector, projector.near_w(NEAR_MARGIN));
        let sides = map(&runs.runs, deadline, |run| run_view.side(run))?;
        let mut facings = vec![0_i8; mesh.triangles.len()];
        let pieces = facings.chunks_mut(RUNS * FACES).zip(sides.chunks(RUNS)).enumerate();
        let places = Places { mesh, projector, rounded: run_view.rounded };
        let fill = |(piece, (facings, sides)): (usize, (&mut [i8], &[i8]))| {
            deadline.check()?;
            let runs = facings.chunks_mut(FACES).zip(sides).zip((piece * RUNS * FACES..).step_by(FACES));
            for ((facings, &side), first) in runs {
                if side != 0 {
                    facings.fill(side);
                } else {
                    facings.iter_mut().zip(first..).for_each(|(facing, face)| *facing = places.facing(face));
                }
            }
            Ok(())
        };
        parallel::map(pieces.collect(), fill).into_iter().collect::<Result<(), Stopped>>()?;
        let is_open = |r: &u32| sides[*r as usize] == 0 || !runs.runs[*r as usize].is_plain;
        let mut open_runs = Vec::with_capacity(runs.runs.len());
        open_runs.extend((0..runs.runs.len() as u32).filter(is_open));
        let culls = (0..groups.material_count()).map(|m| cull(groups, m)).collect();
        let unseen = unseen(scene, cx)?;
        let why = "the mesh is closed, and the camera is outside";
        let skips_unseen = cx.skips.skip(SkipKind::UnseenFaces, unseen.is_some(), why);
        Ok(Self {
            mesh,
            projection,
            projector,
            runs,
            run_view,
            facing: facings,
            open_runs,
            culls,
            unseen,
            skips_unseen,
        })
    }

    /// X, Y, Z and W of a position.
    #[inline(always)]
    pub fn homogeneous(&self, vertex: u32) -> [f64; 4] {
        self.projector.homogeneous(self.mesh.positions[vertex as usize])
    }

    /// The smallest W of what has an outline.
    pub fn near_w(&self) -> f64 {
        self.projector.near_w(NEAR_MARGIN)
    }

    /// X, Y and W of a position.
    #[inline(always)]
    pub fn place(&self, vertex: u32) -> [f64; 3] {
        self.projector.place(self.mesh.positions[vertex as usize])
    }

    /// The silhouette edges of the materials that have an outline (`outlines`, by material).
    pub fn silhouette_edges(
        &self,
        outlines: &[Option<Thickness>],
        list: &EdgeList,
        silhouettes: &Silhouettes,
        cx: &mut PlanContext<'_>,
    ) -> Result<Vec<SilhouetteEdge>, PlanError> {
        select_by("an outline's edges", self.open_runs.len(), RUNS, cx, |range, found| {
            for i in self.open_runs[range].iter().flat_map(|&run| self.runs.edges(run as usize)) {
                let edge = list.get(i);
                if self.is_surely_inside(&edge) {
                    continue;
                }
                if let Some(edge) = silhouettes.edge(self.mesh, i, &edge) {
                    self.each_side(i as u32, &edge, outlines, found);
                }
            }
        })
    }

    /// Calls `each` with each side of an edge on which an outline is drawn.
    fn each_side(&self, index: u32, edge: &Edge, outlines: &[Option<Thickness>], each: &mut dyn FnMut(SilhouetteEdge)) {
        let faces = self.drawn(edge.faces);
        let Some(material) = self.material(faces, outlines) else { return };
        for &free in self.free_sides(edge.vertices, faces) {
            let is_hidden = self.is_concave(edge);
            each(SilhouetteEdge { vertices: edge.vertices, faces, free, material, index, is_hidden });
        }
    }

    /// True for an edge of a closed surface that turns inwards: the surface hides it. Outside of the surface is, near
    /// such an edge, only what lies before both of its faces. The viewer lies behind the one that shows its back. So the
    /// way to the viewer begins inside, and leads out through another face. Of a face that is seen edge on, neither is
    /// known.
    fn is_concave(&self, edge: &Edge) -> bool {
        let (Some(unseen), [first, second]) = (self.unseen, edge.faces) else { return false };
        let facing = |face: u32| self.facing.get(face as usize).copied().unwrap_or(0);
        if facing(first) * facing(second) >= 0 {
            return false;
        }
        let corners = |face: u32| self.mesh.triangles.get(face as usize);
        let (Some(first), Some(second)) = (corners(first), corners(second)) else { return false };
        let Some(other) = second.iter().find(|v| !edge.vertices.contains(v)) else { return false };
        let at = |v: u32| self.mesh.positions[v as usize].map(f64::from);
        let [a, b, c] = first.map(at);
        let (p, q, r) = (sub(b, a), sub(c, a), sub(at(*other), a));
        let height = dot(cross(p, q), r) * if unseen == FaceSide::Back { 1.0 } else { -1.0 };
        height > FLAT * (dot(p, p) * dot(q, q) * dot(r, r)).sqrt()
    }

    /// True for a face that shows the side that is never seen: other faces hide what it hides.
    pub fn is_unseen(&self, face: u32) -> bool {
        let facing = self.facing.get(face as usize).copied().unwrap_or(0);
        match self.unseen.filter(|_| self.skips_unseen) {
            Some(FaceSide::Back) => facing > 0,
            Some(FaceSide::Front) => facing < 0,
            None => false,
        }
    }

    /// True for most edges of a surface that are no silhouette edges: their two faces wind
    /// alike, show the same side, and both are drawn or neither is.
    fn is_surely_inside(&self, edge: &MeshEdge) -> bool {
        if edge.face_count != 2 || edge.has_inconsistent_winding {
            return false;
        }
        let [a, b] = edge.faces.map(|face| face as usize);
        let materials = &self.mesh.triangle_materials;
        self.facing[a] == self.facing[b] && self.facing[a] != 0 && materials[a] == materials[b]
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

/// The side that no face of a scene's mesh shows, where that is known.
fn unseen(scene: &Scene<'_, '_>, cx: &mut PlanContext<'_>) -> Result<Option<FaceSide>, PlanError> {
    // Only where the eye is surely outside of the mesh is the inside of its faces never seen.
    if !scene.camera.contains_mesh || hiding_materials(&scene.groups).contains(&false) {
        return Ok(None);
    }
    let (_, orientation) = cx.edges_and_orientation(scene.mesh)?;
    Ok(orientation.and_then(|orientation| unseen_side(&scene.groups, orientation)))
}

/// The side of a material that is culled, if the material is filled.
fn cull(groups: &MaterialGroups<'_>, material: usize) -> Cull {
    match groups.fill(material) {
        Fill::None => Cull::None,
        _ => groups.by_material[material].surface.map_or(Cull::None, |surface| surface.cull),
    }
}

/// The places of a mesh's corners, from which follows what side its faces show.
struct Places<'a> {
    mesh: &'a Mesh,
    projector: Projector,
    /// Volumes that rounding may take for 0.
    rounded: f64,
}

impl Places<'_> {
    /// The side that a face shows: the sign of the volume that it spans with the eye. It is right for
    /// corners behind the eye too.
    #[inline]
    fn facing(&self, face: usize) -> i8 {
        let volume = self.volume(self.mesh.triangles[face]);
        // The sign of a large volume does not depend on rounding.
        if volume.abs() > self.rounded { sign(volume) } else { self.sorted_facing(face) }
    }

    #[inline(always)]
    fn volume(&self, corners: [u32; 3]) -> f64 {
        let at = |v: u32| self.projector.place(self.mesh.positions[v as usize]);
        let (a, b, c) = (at(corners[0]), at(corners[1]), at(corners[2]));
        let (x, y, w) = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
        (x * c[0] + y * c[1]) + w * c[2]
    }

    /// The same from sorted corners, so that rounding does not depend on which comes first or on the winding.
    #[cold]
    fn sorted_facing(&self, face: usize) -> i8 {
        let mut sorted = self.mesh.triangles[face];
        let mut is_even = true;
        for (i, j) in [(0, 1), (1, 2), (0, 1)] {
            let [a, b] = [i, j].map(|k: usize| self.mesh.positions[sorted[k] as usize]);
            if !is_in_order(a, b) {
                sorted.swap(i, j);
                is_even = !is_even;
            }
        }
        let sign = sign(self.volume(sorted));
        if is_even { sign } else { -sign }
    }
}

fn sign(v: f64) -> i8 {
    i8::from(v > 0.0) - i8::from(v < 0.0)
}

#[cfg(test)]
mod tests;
