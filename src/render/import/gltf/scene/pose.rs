//! The pose that is drawn: node transforms and morph weights, either the rest pose or a moment of
//! the file's first animation.

use super::animation::{self, Channel};
use super::transform::{self, Trs};
use crate::import::MeshError;
use crate::import::affine::Affine;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::import::gltf::document::lists::{Lists, entry};
use crate::import::gltf::document::schema::Document;
use crate::import::gltf::warn_once;
use crate::warning::Warning;
use std::collections::BTreeMap;

/// A pose of the file's nodes.
pub struct Pose<'a> {
    doc: &'a Document,
    /// Animated nodes, by index.
    animated: BTreeMap<usize, Animated>,
}

/// The animated values of one node.
#[derive(Clone, Debug)]
struct Animated {
    trs: Trs,
    /// True if the animation moves the node, so that `trs` replaces its own transform.
    is_moved: bool,
    weights: Option<Vec<f64>>,
}

impl<'a> Pose<'a> {
    /// The first animation at the job's time, or the rest pose without one.
    pub fn new(
        doc: &'a Document,
        lists: &Lists<'_>,
        reader: &mut Reader<'_>,
        warnings: &mut Vec<Warning>,
        cx: &mut Context<'_>,
    ) -> Result<Self, MeshError> {
        let mut pose = Self { doc, animated: BTreeMap::new() };
        match (cx.time_s, lists.animations.len()) {
            (None, 0) => {}
            (None, _) => {
                let detail =
                    "the file has animations, and is drawn without them: scene.time_s draws a moment of its first";
                warn_once(warnings, "animations_ignored", detail.into());
            }
            (Some(_), 0) => {
                warn_once(warnings, "animation_missing", "scene.time_s is given, and the file has no animation".into());
            }
            (Some(time_s), count) => {
                if count > 1 {
                    let detail = format!("of the file's {count} animations the first is drawn");
                    warn_once(warnings, "animations_left_out", detail);
                }
                let first: animation::Animation = entry("animation", &lists.animations, 0)?;
                pose.animate(&first, time_s, reader, warnings, cx)?;
            }
        }
        Ok(pose)
    }

    fn animate(
        &mut self,
        animation: &animation::Animation,
        time_s: f64,
        reader: &mut Reader<'_>,
        warnings: &mut Vec<Warning>,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let mut sampling = animation::Sampling::new(animation, time_s);
        for (i, channel) in animation.channels.iter().enumerate() {
            let what = format!("channel {i} of the first animation");
            let broken = |detail: &str| MeshError::broken(format!("{what} of the glTF file {detail}"));
            let Some(target) = channel.target.node else {
                if channel.target.path == "pointer" {
                    let detail = "an animation changes what is no node's, which is not drawn";
                    warn_once(warnings, "animation_pointers_ignored", detail.into());
                }
                continue;
            };
            let node = self.doc.nodes.get(target.0).ok_or_else(|| broken("moves a node that is not there"))?;
            let path = channel.target.path.as_str();
            cx.budget.spend("animated nodes", 1, 2 * size_of::<Animated>() as u64)?;
            let fresh = || Animated { trs: Trs::of(node), is_moved: false, weights: None };
            let mut changed = self.animated.get(&target.0).cloned().unwrap_or_else(fresh);
            if path != "weights" && node.matrix.is_some() {
                return Err(broken("moves a node that has a matrix"));
            }
            changed.is_moved |= path != "weights";
            let from = Channel { what: &what, sampler: channel.sampler };
            match path {
                "translation" => changed.trs.translation = sampling.vector(&from, reader, cx)?,
                "scale" => changed.trs.scale = sampling.vector(&from, reader, cx)?,
                "rotation" => changed.trs.rotation = sampling.rotation(&from, reader, cx)?,
                "weights" => {
                    let mesh = node.mesh.and_then(|mesh| self.doc.meshes.get(mesh.0));
                    let targets = mesh.and_then(|mesh| mesh.primitives.first()).map_or(0, |p| p.targets.len());
                    changed.weights = Some(sampling.weights(&from, targets, reader, cx)?);
                }
                _ => return Err(broken("changes something that nodes do not have")),
            }
            self.animated.insert(target.0, changed);
        }
        Ok(())
    }

    /// The transform of a node relative to its parent.
    pub fn local(&self, node: usize) -> Affine {
        match self.animated.get(&node).filter(|animated| animated.is_moved) {
            Some(animated) => animated.trs.into(),
            None => self.doc.nodes.get(node).map_or(Affine::IDENTITY, transform::of_node),
        }
    }

    /// Morph weights of a mesh at a node: the animation's, else the node's, else the mesh's.
    pub fn weights(&self, mesh: usize, node: Option<usize>) -> &[f64] {
        let animated = node.and_then(|node| self.animated.get(&node)?.weights.as_deref());
        let of_node = || node.and_then(|node| self.doc.nodes.get(node)?.weights.as_deref());
        let of_mesh = || self.doc.meshes.get(mesh)?.weights.as_deref();
        animated.or_else(of_node).or_else(of_mesh).unwrap_or_default()
    }
}
