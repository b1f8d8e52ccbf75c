//! glTF 2.0, as JSON or GLB.
//!
//! Reading order: [`container`] (the chunks of a GLB), [`document`] (the JSON, parsed and checked),
//! [`data`] (buffers, accessors, decompression), [`scene`] (nodes, pose, skins, cameras),
//! [`primitive`] (vertices and triangles, morphed and skinned), [`material`] (materials and
//! images).

mod container;
mod data;
mod document;
mod material;
mod primitive;
mod scene;

#[cfg(all(feature = "meshopt", feature = "isolate"))]
pub use data::meshopt_apart::answer;

use self::document::check;
use self::document::lists::Lists;
use self::document::schema::Document;
use self::material::Materials;
use self::primitive::shape::Shape;
use self::primitive::{Primitive, triangles};
use self::scene::Instance;
use self::scene::pose::Pose;
use self::scene::skin::Skins;
use self::scene::{cameras, instancing};
use super::affine::Affine;
use super::raw::RawMesh;
use super::{Format, MeshError, text};
use crate::import::FileContent;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::mesh::MaterialSlot;
use crate::warning::Warning;
use rapidhash::RapidHashMap;
use std::rc::Rc;

/// True if the bytes begin as a GLB container.
pub fn is_glb(bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
}

/// True if the bytes are JSON with the property that glTF requires.
pub fn is_gltf(bytes: &[u8]) -> bool {
    let text = text::trim_start(bytes);
    text.starts_with(b"{") && text.windows(7).any(|word| word == b"\"asset\"")
}

/// Reads either kind of file.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let mut raw = RawMesh::default();
    let (json, bin) = if is_glb(bytes) {
        raw.report.format = Format::Glb;
        let glb = container::split(bytes)?;
        raw.report.warnings = glb.warnings;
        (glb.json, glb.bin)
    } else {
        raw.report.format = Format::Gltf;
        (bytes, None)
    };
    let doc = document::parse(json, cx)?;
    let lists = Lists::of(json)?;
    check::check(&doc, &lists)?;
    raw.report.content = Some(content(&doc));
    let mut reader = Reader::new(&doc, bin);
    let pose = Pose::new(&doc, &lists, &mut reader, &mut raw.report.warnings, cx)?;
    let scene = scene::scene(&doc, &pose, cx)?;
    raw.cameras = cameras::cameras(&scene.cameras, &lists, &mut raw.report.warnings, cx)?;

    let mut meshes = Meshes {
        doc: &doc,
        pose: &pose,
        reader,
        skins: Skins::new(&doc),
        materials: Materials::new(&lists, cx)?,
        of_mesh: vec![None; doc.meshes.len()],
        uses_default_material: false,
        instances: vec![0; doc.meshes.len()],
        used: RapidHashMap::default(),
    };
    for instance in &scene.instances {
        if let Some(count) = meshes.instances.get_mut(instance.mesh) {
            *count += 1;
        }
    }
    for instance in &scene.instances {
        meshes.show(instance, &mut raw, cx)?;
    }
    if cx.counts_loose {
        let loose = meshes.used.values().flatten().filter(|is_used| !**is_used).count();
        raw.report.loose_vertices = Some(loose as u64);
    }
    raw.is_f32 = true;
    let uses_default = meshes.uses_default_material;
    let (slots, images) = meshes.materials.into_slots();
    raw.report.warnings.extend(images.warnings(cx.bundle.origin()));
    (raw.materials, raw.images) = (slots, images.sources);
    if uses_default {
        raw.materials.push(MaterialSlot::default());
    }
    raw.report.metadata = document::metadata::metadata(json);
    Ok(raw)
}

/// Adds instances of meshes to a raw mesh, and keeps decoded primitives.
struct Meshes<'a> {
    doc: &'a Document,
    pose: &'a Pose<'a>,
    reader: Reader<'a>,
    skins: Skins<'a>,
    materials: Materials<'a>,
    of_mesh: Vec<Option<Rc<Vec<Primitive>>>>,
    uses_default_material: bool,
    /// Number of instances of each mesh.
    instances: Vec<u32>,
    /// By accessor of positions, where unused vertices are counted: the vertices that a primitive uses. Several
    /// primitives may share an accessor.
    used: RapidHashMap<usize, Vec<bool>>,
}

impl Meshes<'_> {
    /// Adds one instance of a mesh.
    fn show(&mut self, instance: &Instance, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
        cx.deadline.check()?;
        let primitives = self.primitives(instance.mesh, &mut raw.report.warnings, cx)?;
        let node = instance.node.and_then(|index| self.doc.nodes.get(index));
        let weights = self.pose.weights(instance.mesh, instance.node);
        let joints = match node.and_then(|node| node.skin) {
            Some(skin) => Some(self.skins.joints(skin.0, self.pose, &mut self.reader, cx)?),
            None => None,
        };
        // Skinned vertices follow their joints alone, so the node's own transform is ignored.
        let transform = if joints.is_some() { Affine::IDENTITY } else { instance.transform };
        let placements = match node.and_then(|node| node.extensions.instancing.as_ref()) {
            Some(instancing) => {
                let own = primitives.iter().map(Primitive::triangle_count).sum();
                let counts = [raw.triangles.len() as u64, own];
                let index = instance.node.unwrap_or_default();
                instancing::placements(index, instancing, &transform, counts, &mut self.reader, cx)?
            }
            None => vec![transform],
        };
        // Without instances, morphing and skinning would be wasted.
        if placements.is_empty() {
            return Ok(());
        }
        let default_material = self.materials.count();
        let keeps_shape = joints.is_none() && weights.iter().all(|weight| *weight == 0.0);
        if let ([placement], true, 1) = (&placements[..], keeps_shape, self.instances[instance.mesh]) {
            self.of_mesh[instance.mesh] = None;
            if let Some(primitives) = Rc::into_inner(primitives) {
                for primitive in primitives {
                    self.uses_default_material |= primitive.material().is_none();
                    primitive.append_only(raw, placement, default_material, cx)?;
                }
            }
            return Ok(());
        }
        for primitive in primitives.iter() {
            self.uses_default_material |= primitive.material().is_none();
            let mut shape = Shape::of(primitive);
            shape.morph(primitive, weights, &mut self.reader, cx)?;
            if let Some(joints) = &joints {
                shape.skin(&primitive.what, &primitive.influences, joints, cx)?;
            }
            for placement in &placements {
                primitive.append(&shape, raw, placement, default_material, cx)?;
            }
        }
        Ok(())
    }

    /// The decoded primitives of a mesh.
    fn primitives(
        &mut self,
        mesh: usize,
        warnings: &mut Vec<Warning>,
        cx: &mut Context<'_>,
    ) -> Result<Rc<Vec<Primitive>>, MeshError> {
        let json = self
            .doc
            .meshes
            .get(mesh)
            .ok_or_else(|| MeshError::broken(format!("there is no mesh {mesh} in the glTF file")))?;
        if let Some(done) = &self.of_mesh[mesh] {
            return Ok(Rc::clone(done));
        }
        let ngons_are_used = self.doc.uses("FB_ngon_encoding");
        let mut primitives = Vec::new();
        for (i, primitive) in json.primitives.iter().enumerate() {
            let source = primitive::Source {
                what: format!("primitive {i} of mesh {mesh}"),
                json: primitive,
                has_ngons: ngons_are_used && primitive.extensions.ngons.is_some(),
                has_skins: !self.doc.skins.is_empty(),
            };
            let read = Primitive::read(&source, &mut self.reader, &mut self.materials, warnings, cx)?;
            if let Some(read) = &read
                && let Some(accessor) = primitive.attributes.get("POSITION").filter(|_| cx.counts_loose)
            {
                let is_used = self.used.entry(accessor.0).or_default();
                cx.budget.spend("glTF vertices", read.positions.len().saturating_sub(is_used.len()) as u64, 1)?;
                read.mark_used(is_used);
            }
            primitives.extend(read);
        }
        let primitives = Rc::new(primitives);
        self.of_mesh[mesh] = Some(Rc::clone(&primitives));
        Ok(primitives)
    }
}

/// Totals of the document's meshes, by their accessors.
fn content(doc: &Document) -> FileContent {
    let mut content = FileContent::default();
    let count = |accessor: usize| doc.accessors.get(accessor).map_or(0, |accessor| accessor.count.0);
    for primitive in doc.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        let vertices = primitive.attributes.get("POSITION").or_else(|| primitive.attributes.values().next());
        let vertices = vertices.map_or(0, |accessor| count(accessor.0));
        let corners = primitive.indices.map_or(vertices, |accessor| count(accessor.0));
        content.draw_calls += 1;
        content.vertices = content.vertices.saturating_add(vertices);
        content.triangles = content.triangles.saturating_add(triangles::count(primitive.mode(), corners));
        let [segments, points] = triangles::count_lines_and_points(primitive.mode(), corners);
        content.segments = content.segments.saturating_add(segments);
        content.points = content.points.saturating_add(points);
    }
    content
}

/// Adds a warning once per code: a file may have 100,000 primitives of a kind that is not drawn.
fn warn_once(warnings: &mut Vec<Warning>, code: &'static str, detail: String) {
    if warnings.iter().all(|w| w.code != code) {
        warnings.push(Warning { code, detail });
    }
}
