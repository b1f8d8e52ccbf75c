//! Facts about a mesh that do not depend on the picture, kept from one plan of the mesh to the next.
//!
//! Invariant: what is kept changes no byte, no skip and no refusal. A plan that takes it spends what
//! finding it took.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use crate::limits::{Budget, LimitExceeded, Spent};
use crate::mesh::creases::CreasedNormals;
use crate::mesh::edges::EdgeList;
use crate::mesh::topology::Orientation;
use crate::plan::cut_outs::CutOuts;
use crate::plan::edges::face_runs::FaceRuns;
use crate::texture::kept::KeptTextures;

/// Facts about one mesh, which must not change. Each is found when a plan first needs it. Plans that
/// need it at the same time may each find it, and the first one's is kept: a thread that waited for
/// another's work could be one that this work needs.
#[derive(Debug, Default)]
pub struct Prepared {
    token: Arc<MeshToken>,
    edges: OnceLock<(Arc<EdgeList>, Vec<Spent>)>,
    orientation: OnceLock<Orientation>,
    looked_at: OnceLock<(Arc<Vec<u32>>, Vec<Spent>)>,
    face_runs: OnceLock<(Arc<FaceRuns>, Vec<Spent>)>,
    cut_outs: OnceLock<(Arc<CutOuts>, Vec<Spent>)>,
    vertex_normals: Mutex<Option<VertexNormals>>,
    textures: KeptTextures,
}

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

    /// The edges, paid for; found by `find` if they are not known.
    pub fn edges(
        &self,
        budget: &mut Budget,
        find: impl FnOnce(&mut Budget) -> Result<EdgeList, LimitExceeded>,
    ) -> Result<Arc<EdgeList>, LimitExceeded> {
        kept(&self.edges, budget, find)
    }

    /// The runs of faces, paid for; found by `find` if they are not known.
    pub fn face_runs(
        &self,
        budget: &mut Budget,
        find: impl FnOnce(&mut Budget) -> Result<FaceRuns, LimitExceeded>,
    ) -> Result<Arc<FaceRuns>, LimitExceeded> {
        kept(&self.face_runs, budget, find)
    }

    /// Visible parts of the faces with cut-out textures, paid for; found by `find` if it is not known.
    pub fn cut_outs<E: From<LimitExceeded>>(
        &self,
        budget: &mut Budget,
        find: impl FnOnce(&mut Budget) -> Result<CutOuts, E>,
    ) -> Result<Arc<CutOuts>, E> {
        kept(&self.cut_outs, budget, find)
    }

    /// The edges, if they are known.
    pub fn known_edges(&self) -> Option<&EdgeList> {
        self.edges.get().map(|(edges, _)| &**edges)
    }

    /// The orientation of the faces.
    pub fn orientation(&self, find: impl FnOnce() -> Orientation) -> Orientation {
        self.orientation.get().copied().unwrap_or_else(|| {
            let found = find();
            *self.orientation.get_or_init(|| found)
        })
    }

    /// The faces that are looked at for the width of lines, paid for; found by `find` if they are not known.
    pub fn looked_at(
        &self,
        budget: &mut Budget,
        find: impl FnOnce(&mut Budget) -> Result<Vec<u32>, LimitExceeded>,
    ) -> Result<Arc<Vec<u32>>, LimitExceeded> {
        kept(&self.looked_at, budget, find)
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
        let edges = self.edges.get().map_or(0, |(edges, _)| edges.bytes());
        let normals = self.locked_normals().as_ref().map_or(0, VertexNormals::bytes);
        let looked_at = self.looked_at.get().map_or(0, |(faces, _)| size_of_val(&faces[..]));
        let runs = self.face_runs.get().map_or(0, |(runs, _)| runs.bytes());
        let cut_outs = self.cut_outs.get().map_or(0, |(cut_outs, _)| cut_outs.bytes());
        (edges + normals + looked_at + runs + cut_outs) as u64 + self.textures.bytes()
    }

    fn locked_normals(&self) -> MutexGuard<'_, Option<VertexNormals>> {
        self.vertex_normals.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The content of a place, paid for; found by `find`, and kept, if there is none.
fn kept<T, E: From<LimitExceeded>>(
    place: &OnceLock<(Arc<T>, Vec<Spent>)>,
    budget: &mut Budget,
    find: impl FnOnce(&mut Budget) -> Result<T, E>,
) -> Result<Arc<T>, E> {
    if let Some((found, spent)) = place.get() {
        budget.spend_again(spent)?;
        return Ok(Arc::clone(found));
    }
    let (found, spent) = budget.record(find);
    let found = Arc::new(found?);
    Ok(Arc::clone(&place.get_or_init(|| (found, spent)).0))
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
