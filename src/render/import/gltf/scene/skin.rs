//! Skins: the transforms of joints in the drawn pose. glTF 2.0, 3.7.3.

use super::pose::Pose;
use crate::import::MeshError;
use crate::import::affine::Affine;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::import::gltf::data::attribute::INVERSE_BIND_MATRICES;
use crate::import::gltf::document::schema::Document;
use std::collections::BTreeMap;
use std::rc::Rc;

/// Transforms from mesh to scene space, one per joint of a skin.
pub type Joints = Rc<Vec<Affine>>;

/// The skins of a file, in one pose.
pub struct Skins<'a> {
    doc: &'a Document,
    /// Transforms from node to scene space, computed for the first skin.
    worlds: Option<Vec<Affine>>,
    known: BTreeMap<usize, Joints>,
}

impl<'a> Skins<'a> {
    /// An empty collection for the file's list.
    pub fn new(doc: &'a Document) -> Self {
        Self { doc, worlds: None, known: BTreeMap::new() }
    }

    /// The joints of a skin.
    pub fn joints(
        &mut self,
        index: usize,
        pose: &Pose<'_>,
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<Joints, MeshError> {
        if let Some(known) = self.known.get(&index) {
            return Ok(Rc::clone(known));
        }
        let skin = self
            .doc
            .skins
            .get(index)
            .ok_or_else(|| MeshError::broken(format!("there is no skin {index} in the glTF file")))?;
        if self.worlds.is_none() {
            self.worlds = Some(worlds(self.doc, pose, cx)?);
        }
        let worlds = self.worlds.as_deref().unwrap_or_default();
        cx.budget.spend("joints", skin.joints.len() as u64, size_of::<Affine>() as u64)?;
        let inverse: Vec<[f64; 16]> = match skin.inverse_bind_matrices {
            Some(accessor) => reader.vectors(accessor.0, &INVERSE_BIND_MATRICES, cx)?,
            None => Vec::new(),
        };
        // More matrices than joints are allowed; the rest has no meaning.
        if skin.inverse_bind_matrices.is_some() && inverse.len() < skin.joints.len() {
            return Err(MeshError::broken(format!(
                "skin {index} of the glTF file has {} joints and {} inverse bind matrices",
                skin.joints.len(),
                inverse.len()
            )));
        }
        let joint = |(i, node): (usize, &crate::import::gltf::document::lists::Index)| {
            let inverse = inverse.get(i).map_or(Affine::IDENTITY, |m| Affine::from_columns(*m));
            worlds.get(node.0).copied().unwrap_or(Affine::IDENTITY).after(&inverse)
        };
        let joints: Joints = Rc::new(skin.joints.iter().enumerate().map(joint).collect());
        self.known.insert(index, Rc::clone(&joints));
        Ok(joints)
    }
}

/// Transforms of all nodes to scene space. Several parents are forbidden by the specification; the
/// first one counts.
fn worlds(doc: &Document, pose: &Pose<'_>, cx: &mut Context<'_>) -> Result<Vec<Affine>, MeshError> {
    let count = doc.nodes.len();
    cx.budget.spend("node transforms", count as u64, size_of::<Affine>() as u64 + 32)?;
    cx.deadline.check()?;
    let mut parent = vec![None; count];
    for (i, node) in doc.nodes.iter().enumerate().rev() {
        for child in node.children.iter().filter(|child| child.0 < count) {
            parent[child.0] = Some(i);
        }
    }
    let mut worlds: Vec<Affine> = (0..count).map(|node| pose.local(node)).collect();
    let mut is_done = vec![false; count];
    let mut path = Vec::new();
    for start in 0..count {
        // Walks up to a finished node or a root, then down again. Cycles were refused before.
        let mut at = Some(start);
        while let Some(node) = at.filter(|&node| !is_done[node]) {
            path.push(node);
            at = parent[node];
        }
        while let Some(node) = path.pop() {
            if let Some(parent) = parent[node] {
                worlds[node] = worlds[parent].after(&worlds[node]);
            }
            is_done[node] = true;
        }
    }
    Ok(worlds)
}
