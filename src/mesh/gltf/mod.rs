//! glTF 2.0, as JSON or GLB. The `gltf` crate gives the typed JSON model; what the model says is checked and read here.
//!
//! Reading order: [`container`], [`document`], [`scene`] (which nodes are shown, and where), [`primitive`], [`accessor`],
//! [`buffers`]; and for surfaces [`model`] (the document's other half), [`materials`], [`images`], [`cameras`].

mod accessor;
mod buffers;
mod cameras;
mod container;
mod document;
mod facts;
mod images;
mod materials;
mod model;
mod ngons;
mod primitive;
mod scene;
mod transform;

use self::accessor::Reader;
use self::materials::Materials;
use self::model::Lists;
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
    let lists = Lists::of(json);
    let scene = scene::scene(&root, cx)?;
    raw.cameras = cameras::cameras(&scene.cameras, &lists, &mut raw.report.warnings);

    let mut primitives = Primitives {
        root: &root,
        lists: &lists,
        reader: Reader::new(&root, bin),
        materials: Materials::new(&lists, cx)?,
        of_mesh: vec![None; root.meshes.len()],
    };
    let default_material = primitives.materials.count();
    let mut uses_default = false;
    for instance in &scene.instances {
        for primitive in primitives.of(instance.mesh, &mut raw.report.warnings, cx)?.iter() {
            uses_default |= primitive.material().is_none();
            primitive.append(&mut raw, &instance.transform, default_material, cx)?;
        }
    }
    raw.is_f32 = true;
    warn_of_unread(&root, &mut raw.report.warnings);
    let (slots, images) = primitives.materials.into_slots();
    (raw.materials, raw.images) = (slots, images.sources);
    if uses_default {
        raw.materials.push(MaterialSlot::default());
    }
    raw.report.facts = facts::facts(json);
    Ok(raw)
}

/// The decoded primitives of the meshes that were asked for.
struct Primitives<'a> {
    root: &'a Root,
    lists: &'a Lists<'a>,
    reader: Reader<'a>,
    materials: Materials<'a>,
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
        let has_ngons = self.ngons(mesh);
        let mut primitives = Vec::new();
        for (i, primitive) in json.primitives.iter().enumerate() {
            let source = primitive::Source {
                what: format!("primitive {i} of mesh {mesh}"),
                json: primitive,
                has_ngons: has_ngons.get(i).copied().unwrap_or(false),
            };
            primitives.extend(Primitive::read(&source, &mut self.reader, &mut self.materials, warnings, cx)?);
        }
        let primitives = Rc::new(primitives);
        self.of_mesh[mesh] = Some(Rc::clone(&primitives));
        Ok(primitives)
    }

    /// Which primitives of a mesh keep their polygons in the order of triangles.
    fn ngons(&self, mesh: usize) -> Vec<bool> {
        if !self.root.extensions_used.iter().any(|name| name == "FB_ngon_encoding") {
            return Vec::new();
        }
        let json: model::MeshExtensions = model::entry("mesh", &self.lists.meshes, mesh).unwrap_or_default();
        json.primitives.iter().map(|primitive| primitive.extensions.ngons.is_some()).collect()
    }
}

/// A file may have 100,000 primitives of a kind that is not drawn.
fn warn_once(warnings: &mut Vec<Warning>, code: &'static str, detail: String) {
    if warnings.iter().all(|w| w.code != code) {
        warnings.push(Warning { code, detail });
    }
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
