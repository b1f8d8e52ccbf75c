//! The default scene of a glTF file: the visible meshes and cameras, each with the transform from
//! its own space to that of the scene.

pub(crate) mod animation;
pub(crate) mod cameras;
pub(crate) mod instancing;
pub(crate) mod pose;
pub(crate) mod skin;
pub(crate) mod transform;
use self::cameras::Placed;
use self::pose::Pose;
use crate::import::affine::Affine;
use crate::import::context::Context;
use crate::import::gltf::document::schema::Document;
use crate::import::{MeshError, text};
use crate::limits;

/// One instance of a mesh.
#[derive(Debug)]
pub struct Instance {
    /// Index of the mesh.
    pub mesh: usize,
    /// Index of the node, if the file has any.
    pub node: Option<usize>,
    /// Transform from mesh to scene space.
    pub transform: Affine,
}

/// Meshes and cameras of the default scene, in the order of the node tree.
#[derive(Debug, Default)]
pub struct Scene {
    /// Its meshes.
    pub instances: Vec<Instance>,
    /// Its cameras.
    pub cameras: Vec<Placed>,
}

/// The default scene. A file without nodes shows all its meshes.
pub fn scene(doc: &Document, pose: &Pose<'_>, cx: &mut Context<'_>) -> Result<Scene, MeshError> {
    if doc.nodes.is_empty() && doc.scenes.is_empty() {
        let all = 0..doc.meshes.len();
        let instances = all.map(|mesh| Instance { mesh, node: None, transform: Affine::IDENTITY }).collect();
        return Ok(Scene { instances, cameras: Vec::new() });
    }
    let roots = roots(doc)?;
    Walk { doc, pose, on_path: vec![false; doc.nodes.len()], met: 0, found: Scene::default() }.run(roots, cx)
}

/// The root nodes of the default scene. Without a default it is the first scene; without scenes,
/// all nodes without a parent.
fn roots(doc: &Document) -> Result<Vec<usize>, MeshError> {
    let index = doc.scene.map_or(0, |scene| scene.0);
    match doc.scenes.get(index) {
        Some(scene) => Ok(scene.nodes.iter().map(|node| node.0).collect()),
        None if doc.scene.is_some() => Err(MeshError::broken(format!("there is no scene {index} in the glTF file"))),
        None => {
            let mut is_child = vec![false; doc.nodes.len()];
            for child in doc.nodes.iter().flat_map(|node| &node.children) {
                if let Some(flag) = is_child.get_mut(child.0) {
                    *flag = true;
                }
            }
            Ok((0..doc.nodes.len()).filter(|&node| !is_child[node]).collect())
        }
    }
}

/// A depth-first walk with its own stack, since a hostile file may be 100,000 nodes deep.
struct Walk<'a> {
    doc: &'a Document,
    pose: &'a Pose<'a>,
    on_path: Vec<bool>,
    met: u64,
    found: Scene,
}

enum Step {
    Enter(usize, Affine),
    Leave(usize),
}

impl Walk<'_> {
    fn run(mut self, roots: Vec<usize>, cx: &mut Context<'_>) -> Result<Scene, MeshError> {
        self.meet(roots.len(), cx)?;
        let mut steps: Vec<Step> = roots.into_iter().rev().map(|node| Step::Enter(node, Affine::IDENTITY)).collect();
        while let Some(step) = steps.pop() {
            match step {
                Step::Leave(node) => self.on_path[node] = false,
                Step::Enter(node, parent) => self.enter(node, &parent, &mut steps, cx)?,
            }
        }
        Ok(self.found)
    }

    /// Counts nodes when they are put on the stack, so that the stack is bounded too.
    fn meet(&mut self, count: usize, cx: &Context<'_>) -> Result<(), MeshError> {
        self.met += count as u64;
        Ok(limits::check("the number of scene nodes", self.met, cx.limits.nodes, "--limit-nodes")?)
    }

    fn enter(
        &mut self,
        index: usize,
        parent: &Affine,
        steps: &mut Vec<Step>,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let node = self
            .doc
            .nodes
            .get(index)
            .ok_or_else(|| MeshError::broken(format!("there is no node {index} in the glTF file")))?;
        if std::mem::replace(&mut self.on_path[index], true) {
            return Err(MeshError::broken(format!("node {index} of the glTF file is its own ancestor")));
        }
        // Children of a hidden node are hidden too, but joints among them still move visible
        // meshes.
        if node.extensions.visibility.as_ref().is_some_and(|v| v.visible == Some(false)) {
            self.on_path[index] = false;
            return Ok(());
        }
        let transform = parent.after(&self.pose.local(index));
        if let Some(mesh) = node.mesh {
            self.found.instances.push(Instance { mesh: mesh.0, node: Some(index), transform });
        }
        if let Some(camera) = node.camera {
            // Paid for twice, with their names: here and in the mesh.
            cx.budget.spend("cameras", 1, 2 * 1024)?;
            let name = node.name.as_deref().map(text::name);
            self.found.cameras.push(Placed { camera: camera.0, name, transform });
        }
        steps.push(Step::Leave(index));
        self.meet(node.children.len(), cx)?;
        steps.extend(node.children.iter().rev().map(|child| Step::Enter(child.0, transform)));
        Ok(())
    }
}
