//! glTF 2.0, as JSON or GLB. The `gltf` crate gives the typed JSON model; what the model says is checked and read here.
//!
//! Reading order: [`container`], [`document`], [`scene`] (which nodes are shown, and where), [`primitive`], [`accessor`],
//! [`buffers`].

mod accessor;
mod buffers;
mod container;
mod document;
mod primitive;
mod scene;
mod transform;

use self::accessor::Reader;
use self::primitive::Primitive;
use super::import::Context;
use super::raw::RawMesh;
use super::{Format, MaterialSlot, MeshError, Warning};
use gltf::json::Root;
use std::rc::Rc;

/// Reads either kind.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let mut raw = RawMesh::default();
    let (json, bin) = if bytes.starts_with(b"glTF") {
        raw.report.format = Format::Glb;
        let glb = container::split(bytes)?;
        raw.report.warnings = glb.warnings;
        (glb.json, glb.bin)
    } else {
        raw.report.format = Format::Gltf;
        (bytes, None)
    };
    let root = document::parse(json, cx)?;
    let instances = scene::instances(&root, cx)?;

    let mut primitives = Primitives { root: &root, reader: Reader::new(&root, bin), of_mesh: Vec::new() };
    primitives.of_mesh.resize(root.meshes.len(), None);
    let default_material = root.materials.len();
    let mut uses_default = false;
    for instance in &instances {
        for primitive in primitives.of(instance.mesh, &mut raw.report.warnings, cx)?.iter() {
            uses_default |= primitive.material().is_none();
            primitive.append(&mut raw, &instance.transform, default_material, cx)?;
        }
    }
    warn_of_unread(&root, &mut raw.report.warnings);
    raw.materials = materials(&root);
    if uses_default {
        raw.materials.push(MaterialSlot::default());
    }
    Ok(raw)
}

/// The decoded primitives of the meshes that were asked for.
struct Primitives<'a> {
    root: &'a Root,
    reader: Reader<'a>,
    of_mesh: Vec<Option<Rc<Vec<Primitive>>>>,
}

impl Primitives<'_> {
    fn of(
        &mut self,
        mesh: usize,
        warnings: &mut Vec<Warning>,
        cx: &mut Context<'_>,
    ) -> Result<Rc<Vec<Primitive>>, MeshError> {
        let json = self
            .root
            .meshes
            .get(mesh)
            .ok_or_else(|| MeshError::broken(format!("there is no mesh {mesh} in the glTF file")))?;
        if let Some(done) = &self.of_mesh[mesh] {
            return Ok(Rc::clone(done));
        }
        let mut primitives = Vec::new();
        for (i, primitive) in json.primitives.iter().enumerate() {
            let what = format!("primitive {i} of mesh {mesh}");
            let material = primitive.material.map(|m| m.value());
            if material.is_some_and(|m| m >= self.root.materials.len()) {
                let material = material.unwrap_or_default();
                return Err(MeshError::broken(format!(
                    "{what} of the glTF file uses material {material}, which is not there"
                )));
            }
            primitives.extend(Primitive::read(&what, primitive, &mut self.reader, warnings, cx)?);
        }
        let primitives = Rc::new(primitives);
        self.of_mesh[mesh] = Some(Rc::clone(&primitives));
        Ok(primitives)
    }
}

fn materials(root: &Root) -> Vec<MaterialSlot> {
    root.materials
        .iter()
        .map(|material| MaterialSlot {
            name: material.name.clone().unwrap_or_default(),
            base_color: Some(material.pbr_metallic_roughness.base_color_factor.0),
            ..MaterialSlot::default()
        })
        .collect()
}

fn warn_of_unread(root: &Root, warnings: &mut Vec<Warning>) {
    let skinned = root.nodes.iter().any(|node| node.skin.is_some());
    let morphed = root.meshes.iter().flat_map(|mesh| &mesh.primitives).any(|primitive| primitive.targets.is_some());
    let unread = [
        (skinned, "skins_ignored", "skins are not applied: vertices are where the mesh has them"),
        (morphed, "morph_targets_ignored", "morph targets are not applied"),
        (!root.animations.is_empty(), "animations_ignored", "animations are not applied"),
    ];
    let unread = unread.into_iter().filter(|u| u.0);
    warnings.extend(unread.map(|(_, code, detail)| Warning { code, detail: detail.into() }));
}
