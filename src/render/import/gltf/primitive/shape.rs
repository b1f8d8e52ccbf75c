//! The shape of a glTF primitive at one node: its positions and normals after they are morphed
//! (moved by weighted morph targets) and then skinned (moved by joints).

use super::Primitive;
use crate::import::MeshError;
use crate::import::affine::Affine;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::import::gltf::data::attribute::{MORPH_NORMAL, MORPH_POSITION, Rule};
use std::borrow::Cow;

/// Positions and normals in the space of the node, or of the scene if skinned.
pub struct Shape<'a> {
    /// One per vertex.
    pub positions: Cow<'a, [[f64; 3]]>,
    /// One per vertex, of any length; or empty.
    pub normals: Cow<'a, [[f64; 3]]>,
    /// Vertices whose skinning transform mirrors; or empty.
    pub mirrored: Vec<bool>,
}

/// One set of four joints and weights per vertex.
#[derive(Debug)]
pub struct Influences {
    /// Indices of joints.
    pub joints: Vec<[u16; 4]>,
    /// Their weights.
    pub weights: Vec<[f64; 4]>,
}

impl<'a> Shape<'a> {
    /// The undeformed shape of a primitive.
    pub fn of(primitive: &'a Primitive) -> Self {
        let (positions, normals) = (Cow::Borrowed(&primitive.positions[..]), Cow::Borrowed(&primitive.normals[..]));
        Self { positions, normals, mirrored: Vec::new() }
    }

    /// Adds morph targets, each times its weight.
    pub fn morph(
        &mut self,
        primitive: &Primitive,
        weights: &[f64],
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        for (target, &weight) in primitive.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            let mut add = |to: &mut Cow<'a, [[f64; 3]]>, accessor: Option<usize>, rule: &Rule| {
                let Some(accessor) = accessor.filter(|_| !to.is_empty()) else { return Ok(()) };
                let moves: Vec<[f64; 3]> = reader.vectors(accessor, rule, cx)?;
                if matches!(to, Cow::Borrowed(_)) {
                    cx.budget.spend("morphed vertices", moves.len() as u64, 24)?;
                }
                for (value, by) in to.to_mut().iter_mut().zip(moves) {
                    *value = std::array::from_fn(|k| value[k] + weight * by[k]);
                }
                Ok::<(), MeshError>(())
            };
            add(&mut self.positions, target.positions, &MORPH_POSITION)?;
            add(&mut self.normals, target.normals, &MORPH_NORMAL)?;
        }
        Ok(())
    }

    /// Skins every vertex.
    pub fn skin(
        &mut self,
        what: &str,
        sets: &[Influences],
        joints: &[Affine],
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        cx.deadline.check()?;
        let count = self.positions.len();
        cx.budget.spend("skinned vertices", count as u64, 24 + 24 + 1)?;
        self.mirrored = vec![false; count];
        let has_normals = !self.normals.is_empty();
        let (positions, normals) = (self.positions.to_mut(), self.normals.to_mut());
        for i in 0..count {
            let map = blend(sets, i, joints).ok_or_else(|| {
                MeshError::broken(format!(
                    "{what} of the glTF file has a joint that its skin of {} has not",
                    joints.len()
                ))
            })?;
            positions[i] = map.point(positions[i]);
            self.mirrored[i] = map.is_mirroring();
            if has_normals {
                let (m, n) = (map.normal_matrix(), normals[i]);
                normals[i] = std::array::from_fn(|r| m[r][0] * n[0] + m[r][1] * n[1] + m[r][2] * n[2]);
            }
        }
        Ok(())
    }
}

/// The transform of one vertex. Weights are divided by their sum, because quantised ones rarely add
/// up to 1. Without weights the first joint counts.
fn blend(sets: &[Influences], vertex: usize, joints: &[Affine]) -> Option<Affine> {
    let pairs =
        || sets.iter().flat_map(move |set| (0..4).map(move |k| (set.joints[vertex][k], set.weights[vertex][k])));
    let held = || pairs().filter(|(_, weight)| *weight != 0.0);
    let sum: f64 = held().map(|(_, weight)| weight).sum();
    if sum == 0.0 || !sum.is_finite() {
        return pairs().next().and_then(|(joint, _)| joints.get(usize::from(joint)).copied());
    }
    if held().any(|(joint, _)| usize::from(joint) >= joints.len()) {
        return None;
    }
    Some(Affine::blend(held().map(|(joint, weight)| (joints[usize::from(joint)], weight / sum))))
}
