//! The state that the stages of making one plan share: the memory budget, the deadline, the notes of what
//! is left out (skips), warnings, and facts about the mesh such as its edges. A fact is found when a
//! stage first needs it, or taken from an earlier plan of the same mesh.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::PlanError;
use super::cut_outs::{CutOuts, MaskedFaces, masked};
use super::edges::face_runs::FaceRuns;
use super::edges::silhouettes::Silhouettes;
use super::lines::picked_faces::{PickedFace, picked_faces};
use super::prepared::{Fact, Prepared};
use super::skips::{SkipKind, Skips};
use crate::limits::{Budget, Deadline, LimitExceeded};
use crate::mesh::Mesh;
use crate::mesh::edges::EdgeList;
use crate::mesh::topology::{ORIENTATION_BYTES, Orientation, orientation};
use crate::scene::Scene;
use crate::warning::Warning;

/// Items that are worked through between two checks of the deadline.
pub const CHECK_EVERY: usize = 1 << 16;

/// The state that the stages of one plan share.
pub struct PlanContext<'c> {
    /// Bytes that may still be allocated.
    pub budget: &'c mut Budget,
    /// The time limit.
    pub deadline: &'c Deadline,
    /// The skips so far.
    pub skips: Skips<'c>,
    /// Warnings of parts that the picture lacks, and why.
    pub warnings: Vec<Warning>,
    /// Chains of feature edges and outlines that are left out because they are short.
    pub short_chains: u32,
    /// True if an edge that may be drawn has more than two faces.
    pub has_crowded_edges: bool,
    /// Facts about the mesh from earlier plans, if they are kept.
    pub prepared: Option<&'c Prepared>,
    edges: Option<Arc<EdgeList>>,
    silhouettes: Option<Arc<Silhouettes>>,
    face_runs: Option<Arc<FaceRuns>>,
    picked_faces: Option<Arc<Vec<PickedFace>>>,
}

impl<'c> PlanContext<'c> {
    /// A context in which nothing in `keep` is ever skipped.
    pub fn new(budget: &'c mut Budget, deadline: &'c Deadline, keep: &'c [SkipKind]) -> Self {
        Self {
            budget,
            deadline,
            skips: Skips::new(keep),
            warnings: Vec::new(),
            short_chains: 0,
            has_crowded_edges: false,
            prepared: None,
            edges: None,
            silhouettes: None,
            face_runs: None,
            picked_faces: None,
        }
    }

    /// The same with what is known about the mesh.
    pub fn with(self, prepared: &'c Prepared) -> Self {
        Self { prepared: Some(prepared), ..self }
    }

    /// A fact about the mesh: that of an earlier plan, or else what `find` finds.
    fn fact<T, E: From<LimitExceeded>>(
        &mut self,
        place: fn(&Prepared) -> &Fact<T>,
        find: impl FnOnce(&mut Budget) -> Result<T, E>,
    ) -> Result<Arc<T>, E> {
        match self.prepared {
            Some(prepared) => place(prepared).get_or_find(self.budget, find),
            None => Ok(Arc::new(find(self.budget)?)),
        }
    }

    /// The edges of the mesh, found when a stage first needs them.
    pub fn edges(&mut self, mesh: &Mesh) -> Result<Arc<EdgeList>, PlanError> {
        if let Some(edges) = &self.edges {
            return Ok(Arc::clone(edges));
        }
        self.deadline.check()?;
        let edges = self.fact(|prepared| &prepared.edges, |budget| EdgeList::of(mesh, budget))?;
        Ok(Arc::clone(self.edges.insert(edges)))
    }

    /// The faces that are looked at for the width of lines, found when a style first needs them.
    pub fn picked_faces(&mut self, mesh: &Mesh) -> Result<Arc<Vec<PickedFace>>, PlanError> {
        if let Some(picked) = &self.picked_faces {
            return Ok(Arc::clone(picked));
        }
        self.deadline.check()?;
        let found = self.fact(|prepared| &prepared.picked_faces, |budget| picked_faces(mesh, budget))?;
        Ok(Arc::clone(self.picked_faces.insert(found)))
    }

    /// The runs of the mesh's faces, found when a stage first needs them.
    pub fn face_runs(&mut self, mesh: &Mesh) -> Result<Arc<FaceRuns>, PlanError> {
        if let Some(runs) = &self.face_runs {
            return Ok(Arc::clone(runs));
        }
        let edges = self.edges(mesh)?;
        self.deadline.check()?;
        let runs = self.fact(|prepared| &prepared.face_runs, |budget| FaceRuns::of(mesh, &edges, budget))?;
        Ok(Arc::clone(self.face_runs.insert(runs)))
    }

    /// The edges of the mesh, and its orientation if they are closed. Another thread may find the
    /// orientation in the meantime.
    pub fn edges_and_orientation(&mut self, mesh: &Mesh) -> Result<(Arc<EdgeList>, Option<Orientation>), PlanError> {
        self.budget.spend("the orientation", mesh.positions.len() as u64, ORIENTATION_BYTES)?;
        if let Some(prepared) = self.prepared
            && let Some(is_closed) = prepared.edges.known().map(EdgeList::is_closed)
        {
            let edges = self.edges(mesh)?;
            return Ok((edges, is_closed.then(|| prepared.orientation(|| orientation(mesh)))));
        }
        let is_done_and_open = AtomicBool::new(false);
        let mut edges = || {
            let edges = self.edges(mesh);
            let is_closed = edges.as_ref().is_ok_and(|edges| edges.is_closed());
            is_done_and_open.store(!is_closed, Ordering::Relaxed);
            (edges, is_closed)
        };
        // Open meshes need none: it is not begun once the mesh is known to be open.
        let orientation = || (!is_done_and_open.load(Ordering::Relaxed)).then(|| orientation(mesh));
        let ((edges, is_closed), orientation) =
            if mesh.triangles.len() < CHECK_EVERY { (edges(), orientation()) } else { rayon::join(edges, orientation) };
        let (edges, orientation) = (edges?, orientation.filter(|_| is_closed));
        if let (Some(prepared), Some(orientation)) = (self.prepared, orientation) {
            prepared.orientation(|| orientation);
        }
        Ok((edges, orientation))
    }

    /// Visible parts of faces with cut-out textures, and the materials for which they count here; None
    /// where it never does.
    fn cut_outs(&mut self, scene: &Scene<'_, '_>) -> Result<Option<MaskedFaces>, PlanError> {
        self.budget.spend("materials", scene.mesh.materials.len() as u64, 1)?;
        let masked = masked(scene.mesh, &scene.groups);
        if masked.is_empty() {
            return Ok(None);
        }
        let deadline = self.deadline;
        let find = |budget: &mut Budget| CutOuts::of(scene.mesh, budget, deadline);
        Ok(Some((self.fact(|prepared| &prepared.cut_outs, find)?, masked)))
    }

    /// The edges of the mesh, and which of them may be silhouette edges. Contours and hulls share
    /// them.
    pub fn silhouettes(&mut self, scene: &Scene<'_, '_>) -> Result<(Arc<EdgeList>, Arc<Silhouettes>), PlanError> {
        let edges = self.edges(scene.mesh)?;
        if let Some(silhouettes) = &self.silhouettes {
            return Ok((edges, Arc::clone(silhouettes)));
        }
        let cut_outs = self.cut_outs(scene)?;
        let silhouettes = Arc::new(Silhouettes::new(&scene.groups, &edges, cut_outs, self.budget)?);
        self.silhouettes = Some(Arc::clone(&silhouettes));
        Ok((edges, silhouettes))
    }
}
