//! Facts about a mesh that more than one picture of it needs, such as its edges. What a plan has found
//! is kept for later plans of the mesh: vertex normals until a plan needs others, and decoded images as
//! long as there is room for them.
//!
//! Invariant: what is kept changes no byte of a picture, no skip (work that a plan leaves out) and no
//! refusal. So a plan that takes a fact also takes from its job's budget the memory that finding the fact
//! took.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use crate::limits::{Budget, LimitExceeded, Spent};
use crate::mesh::Mesh;
use crate::mesh::creases::CreasedNormals;
use crate::mesh::edges::EdgeList;
use crate::mesh::topology::Orientation;
use crate::plan::cut_outs::CutOuts;
use crate::plan::edges::face_runs::FaceRuns;
use crate::plan::lines::picked_faces::PickedFace;
use crate::scene::PositionBoxes;
use crate::texture::kept::KeptTextures;

/// Facts about one mesh, which must not change. Each is found when a plan first needs it. Plans that
/// need it at the same time may each find it, and the first one's is kept: a thread that waited for
/// another's work could be one that this work needs.
#[derive(Debug, Default)]
pub struct Prepared {
    token: Arc<MeshToken>,
    /// The edges.
    pub(super) edges: Fact<EdgeList>,
    orientation: OnceLock<Orientation>,
    /// The faces that are looked at for the width of lines.
    pub(super) picked_faces: Fact<Vec<PickedFace>>,
    /// The runs of faces.
    pub(super) face_runs: Fact<FaceRuns>,
    /// Boxes around the positions.
    position_boxes: Fact<PositionBoxes>,
    /// Visible parts of the faces with cut-out textures.
    pub(super) cut_outs: Fact<CutOuts>,
    vertex_normals: Mutex<Option<VertexNormals>>,
    textures: KeptTextures,
}

/// A fact about a mesh, once it is found, and what finding it took.
#[derive(Debug)]
pub struct Fact<T>(OnceLock<(Arc<T>, Vec<Spent>)>);

/// Vertex normals of a mesh that brings none.
#[derive(Clone, Debug)]
pub struct VertexNormals {
    /// The cosines of the crease angles, by material.
    crease_cos: Arc<[f64]>,
    /// What finding them took.
    spent: Arc<[Spent]>,
    /// The normals.
    pub normals: Arc<Vec<[f32; 3]>>,
    /// Three indices into them per triangle; None if they go by position.
    pub triangles: Option<Arc<Vec<[u32; 3]>>>,
}

/// The identity of a mesh: no two meshes have one in common. Lists that a plan borrows from a mesh are
/// not changed as long as its token lives.
#[derive(Debug, Default)]
pub struct MeshToken;

impl Prepared {
    /// The mesh's identity.
    pub fn token(&self) -> Arc<MeshToken> {
        Arc::clone(&self.token)
    }

    /// Boxes around the mesh's positions.
    pub fn position_boxes(&self, mesh: &Mesh, budget: &mut Budget) -> Result<Arc<PositionBoxes>, LimitExceeded> {
        self.position_boxes.get_or_find(budget, |budget| PositionBoxes::of(&mesh.positions, budget))
    }

    /// The orientation of the faces.
    pub fn orientation(&self, find: impl FnOnce() -> Orientation) -> Orientation {
        self.orientation.get().copied().unwrap_or_else(|| {
            let found = find();
            *self.orientation.get_or_init(|| found)
        })
    }

    /// Vertex normals for a mesh that brings none, with creases, paid for; found by `find` if those that
    /// were found last have other crease angles.
    pub fn vertex_normals<E: From<LimitExceeded>>(
        &self,
        crease_cos: &[f64],
        budget: &mut Budget,
        find: impl FnOnce(&mut Budget) -> Result<CreasedNormals, E>,
    ) -> Result<VertexNormals, E> {
        let kept = self.locked_normals().clone();
        if let Some(kept) = kept.filter(|kept| *kept.crease_cos == *crease_cos) {
            budget.spend_again(&kept.spent)?;
            return Ok(kept);
        }
        let (found, spent) = budget.record(find);
        let found = VertexNormals { crease_cos: crease_cos.into(), spent: spent.into(), ..VertexNormals::new(found?) };
        let before = self.locked_normals().replace(found.clone());
        drop(before);
        Ok(found)
    }

    /// The decoded images.
    pub(crate) fn textures(&self) -> &KeptTextures {
        &self.textures
    }

    /// Memory of what is kept, bytes.
    pub fn bytes(&self) -> u64 {
        let edges = self.edges.known().map_or(0, EdgeList::bytes);
        let normals = self.locked_normals().as_ref().map_or(0, VertexNormals::bytes);
        let picked = self.picked_faces.known().map_or(0, |faces| size_of_val(&faces[..]));
        let runs = self.face_runs.known().map_or(0, FaceRuns::bytes);
        let boxes = self.position_boxes.known().map_or(0, PositionBoxes::bytes);
        let cut_outs = self.cut_outs.known().map_or(0, CutOuts::bytes);
        (edges + normals + picked + runs + boxes + cut_outs) as u64 + self.textures.bytes()
    }

    fn locked_normals(&self) -> MutexGuard<'_, Option<VertexNormals>> {
        self.vertex_normals.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Fact<T> {
    /// The fact, paid for; found by `find`, and kept, if it is not known.
    pub fn get_or_find<E: From<LimitExceeded>>(
        &self,
        budget: &mut Budget,
        find: impl FnOnce(&mut Budget) -> Result<T, E>,
    ) -> Result<Arc<T>, E> {
        if let Some((found, spent)) = self.0.get() {
            budget.spend_again(spent)?;
            return Ok(Arc::clone(found));
        }
        let (found, spent) = budget.record(find);
        let found = Arc::new(found?);
        Ok(Arc::clone(&self.0.get_or_init(|| (found, spent)).0))
    }

    /// The fact, if it is known.
    pub fn known(&self) -> Option<&T> {
        self.0.get().map(|(found, _)| &**found)
    }
}

impl<T> Default for Fact<T> {
    fn default() -> Self {
        Self(OnceLock::new())
    }
}

impl VertexNormals {
    /// Normals that are not kept.
    pub fn new(found: CreasedNormals) -> Self {
        let CreasedNormals { normals, triangles } = found;
        let (crease_cos, spent) = (Arc::default(), Arc::default());
        Self { crease_cos, spent, normals: Arc::new(normals), triangles: triangles.map(Arc::new) }
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.normals[..]) + self.triangles.as_ref().map_or(0, |triangles| size_of_val(&triangles[..]))
    }
}
