//! The check of a glTF document (the JSON) before any binary data is read: references lead to
//! something that exists, related sizes agree, and no node is its own ancestor. Checked on use
//! instead: the default scene, cameras, animations, the content of materials, and compressed and
//! other binary data.

use super::lists::{Index, Lists};
use super::schema::{Attributes, Document, MeshJson, Node, mode};
use crate::import::MeshError;

/// Fails where a picture of the file would be a guess.
pub fn check(doc: &Document, lists: &Lists<'_>) -> Result<(), MeshError> {
    for (i, view) in doc.buffer_views.iter().enumerate() {
        check_view(doc, i, view.buffer, view.byte_offset.0, view.byte_length.0)?;
        check_stride(doc, i)?;
    }
    for (i, accessor) in doc.accessors.iter().enumerate() {
        let sparse = accessor.sparse.as_ref().map(|s| [s.indices.buffer_view, s.values.buffer_view]);
        for view in accessor.buffer_view.iter().chain(sparse.iter().flatten()) {
            refer("buffer view", *view, doc.buffer_views.len(), || format!("accessor {i}"))?;
        }
    }
    for (i, mesh) in doc.meshes.iter().enumerate() {
        check_mesh(doc, lists, i, mesh)?;
    }
    for (i, skin) in doc.skins.iter().enumerate() {
        let what = || format!("skin {i}");
        if skin.joints.is_empty() {
            return Err(broken(&what(), "has no joints"));
        }
        for joint in &skin.joints {
            refer("node", *joint, doc.nodes.len(), what)?;
        }
        if let Some(accessor) = skin.inverse_bind_matrices {
            refer("accessor", accessor, doc.accessors.len(), what)?;
        }
    }
    for (i, node) in doc.nodes.iter().enumerate() {
        check_node(doc, i, node)?;
    }
    for (i, scene) in doc.scenes.iter().enumerate() {
        for node in &scene.nodes {
            refer("node", *node, doc.nodes.len(), || format!("scene {i}"))?;
        }
    }
    check_no_loops(doc)
}

/// The view lies within the declared length of its buffer.
fn check_view(doc: &Document, index: usize, buffer: Index, offset: u64, length: u64) -> Result<(), MeshError> {
    refer("buffer", buffer, doc.buffers.len(), || format!("buffer view {index}"))?;
    let has = doc.buffers[buffer.0].byte_length.0;
    if offset.checked_add(length).is_none_or(|end| end > has) {
        let detail = format!("spans bytes {offset} to {offset} + {length}, and its buffer has {has}");
        return Err(broken(&format!("buffer view {index}"), &detail));
    }
    Ok(())
}

/// Some exporters write 0 for none.
fn check_stride(doc: &Document, index: usize) -> Result<(), MeshError> {
    let view = &doc.buffer_views[index];
    match view.byte_stride.map_or(0, |stride| stride.0) {
        0 => Ok(()),
        stride if (4..=252).contains(&stride) && stride % 4 == 0 && stride <= view.byte_length.0 => Ok(()),
        stride => {
            let detail =
                format!("has a stride of {stride} bytes in {}: multiples of 4 up to 252 are", view.byte_length.0);
            Err(broken(&format!("buffer view {index}"), &(detail + " allowed, and no more than its length")))
        }
    }
}

fn check_mesh(doc: &Document, lists: &Lists<'_>, index: usize, mesh: &MeshJson) -> Result<(), MeshError> {
    for (i, primitive) in mesh.primitives.iter().enumerate() {
        let what = || format!("primitive {i} of mesh {index}");
        let accessor = |accessor: &Index| refer("accessor", *accessor, doc.accessors.len(), what);
        primitive.attributes.values().chain(&primitive.indices).try_for_each(accessor)?;
        primitive.targets.iter().flat_map(Attributes::values).try_for_each(accessor)?;
        if let Some(material) = primitive.material {
            refer("material", material, lists.materials.len(), what)?;
        }
        if primitive.mode() > mode::TRIANGLE_FAN {
            return Err(broken(&what(), "has an unknown mode"));
        }
        let targets = |primitive: &super::schema::Primitive| primitive.targets.len();
        if targets(primitive) != targets(&mesh.primitives[0]) {
            return Err(broken(&what(), "has more or fewer morph targets than the mesh's first"));
        }
        if let Some(name) = primitive
            .targets
            .iter()
            .flat_map(Attributes::keys)
            .find(|name| is_morphed(name) && !primitive.attributes.contains_key(*name))
        {
            return Err(broken(&what(), &format!("has a morph target for {name}, and no {name}")));
        }
        check_influences(&primitive.attributes, what)?;
    }
    check_weights(&format!("mesh {index}"), mesh.weights.as_deref(), mesh)
}

/// Attributes of morph targets that are read.
pub fn is_morphed(attribute: &str) -> bool {
    ["POSITION", "NORMAL"].contains(&attribute)
}

/// Joints and weights come in pairs, numbered from 0.
fn check_influences(attributes: &Attributes, what: impl Fn() -> String) -> Result<(), MeshError> {
    let count = |prefix: &str| attributes.keys().filter(|name| name.starts_with(prefix)).count();
    let pairs = (0..).take_while(|set| {
        attributes.contains_key(&format!("JOINTS_{set}")) && attributes.contains_key(&format!("WEIGHTS_{set}"))
    });
    let pairs = pairs.count();
    if [count("JOINTS_"), count("WEIGHTS_")] == [pairs; 2] {
        return Ok(());
    }
    Err(broken(&what(), "has JOINTS_n and WEIGHTS_n that do not come in pairs from 0 up"))
}

fn check_weights(what: &str, weights: Option<&[f64]>, mesh: &MeshJson) -> Result<(), MeshError> {
    let targets = mesh.primitives.first().map_or(0, |primitive| primitive.targets.len());
    match weights {
        Some(weights) if weights.len() != targets && !(weights.is_empty() || mesh.primitives.is_empty()) => {
            Err(broken(what, &format!("has {} weights, and {targets} morph targets", weights.len())))
        }
        _ => Ok(()),
    }
}

fn check_node(doc: &Document, index: usize, node: &Node) -> Result<(), MeshError> {
    let what = || format!("node {index}");
    for child in &node.children {
        refer("node", *child, doc.nodes.len(), what)?;
    }
    if let Some(skin) = node.skin {
        refer("skin", skin, doc.skins.len(), what)?;
    }
    for accessor in node.extensions.instancing.iter().flat_map(|instancing| instancing.attributes.values()) {
        refer("accessor", *accessor, doc.accessors.len(), what)?;
    }
    if node.matrix.is_some() && (node.translation.is_some() || node.rotation.is_some() || node.scale.is_some()) {
        return Err(broken(&what(), "has a matrix, and a translation, rotation or scale beside it"));
    }
    let Some(mesh) = node.mesh else { return Ok(()) };
    refer("mesh", mesh, doc.meshes.len(), what)?;
    let mesh = &doc.meshes[mesh.0];
    check_weights(&what(), node.weights.as_deref(), mesh)?;
    let is_rigid = |primitive: &super::schema::Primitive| !primitive.attributes.contains_key("JOINTS_0");
    if node.skin.is_some() && mesh.primitives.iter().any(is_rigid) {
        return Err(broken(&what(), "has a skin, and a mesh of which a part has no JOINTS_0"));
    }
    Ok(())
}

/// No node is its own ancestor, in any scene or none. Its own stack, since a file may be 100,000
/// nodes deep.
fn check_no_loops(doc: &Document) -> Result<(), MeshError> {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        OnPath,
        Done,
    }
    let mut states = vec![State::New; doc.nodes.len()];
    for root in 0..doc.nodes.len() {
        // Each entry: a node, and the index of its next child.
        let mut path = vec![(root, 0)];
        while let Some((node, next)) = path.last_mut() {
            let node = *node;
            if *next == 0 && states[node] == State::Done {
                path.pop();
                continue;
            }
            states[node] = State::OnPath;
            let Some(child) = doc.nodes[node].children.get(*next) else {
                states[node] = State::Done;
                path.pop();
                continue;
            };
            *next += 1;
            match states[child.0] {
                State::Done => {}
                State::New => path.push((child.0, 0)),
                State::OnPath => return Err(broken(&format!("node {}", child.0), "is its own ancestor")),
            }
        }
    }
    Ok(())
}

fn refer(kind: &str, index: Index, count: usize, what: impl Fn() -> String) -> Result<(), MeshError> {
    if index.0 < count {
        return Ok(());
    }
    Err(broken(&what(), &format!("refers to {kind} {}, which is not there", index.0)))
}

fn broken(what: &str, detail: &str) -> MeshError {
    MeshError::broken(format!("{what} of the glTF file {detail}"))
}
