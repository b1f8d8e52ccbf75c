//! The surface of a plan: its materials, and the arrays that they read.

use std::borrow::Cow;

use super::textures::TextureLoader;
use super::{lights, materials};
use crate::mesh::{Mesh, normals};
use crate::plan::build::projection;
use crate::plan::context::PlanContext;
use crate::plan::edges::Edges;
use crate::plan::lines::build;
use crate::plan::skips::{SkipKind, Skips};
use crate::plan::{CornerValues, Faces, PlanError, SurfacePass, flags};
use crate::scene::camera::Camera;
use crate::scene::material_groups::MaterialGroups;
use crate::spec::{Cull, Spec};

/// What is filled, or only hides lines; None where the look has neither.
pub fn surface_pass<'a>(
    mesh: &'a Mesh,
    spec: &Spec,
    groups: &MaterialGroups<'_>,
    camera: &Camera,
    edges: &mut Edges<'_>,
    skips: &mut Skips<'_>,
    cx: &mut PlanContext<'_>,
) -> Result<Option<SurfacePass<'a>>, PlanError> {
    let is_seen = groups.has_fill() || groups.has_barycentric_wire();
    let is_needless = !is_seen && !groups.needs_occluder();
    let why = "the look has no filled surface, and no line that one could hide";
    if skips.skip(SkipKind::Surface, is_needless, why) {
        return Ok(None);
    }
    let is_shaded = !skips.skip(SkipKind::Shading, !is_seen, "the surface is not seen: it only hides lines");
    let edge_masks = if groups.has_barycentric_wire() || groups.shows_edge_distance() {
        build::edge_masks(mesh, groups, edges, cx)?
    } else {
        Vec::new()
    };
    let mut loader = TextureLoader::new(mesh, cx);
    let mut looks = Vec::with_capacity(mesh.materials.len());
    let used = used_materials(mesh);
    for (index, (slot, layers)) in mesh.materials.iter().zip(&groups.layers).enumerate() {
        loader.for_material(index, used[index]);
        looks.push(materials::look(mesh, slot, layers, &mut loader)?);
    }
    let samples = looks.iter().any(materials::samples);
    if !skips.skip(SkipKind::Textures, !samples, "nothing samples one") && !samples {
        for (index, slot) in mesh.materials.iter().enumerate() {
            loader.for_material(index, used[index]);
            materials::load_all(slot, &mut loader)?;
        }
    }
    let size_px = [spec.image.width_px, spec.image.height_px];
    let textures = loader.finish(&projection(camera, size_px, true), skips)?;
    let is_one = looks.iter().all(|look| *look == looks[0]);
    let one_material = skips.skip(SkipKind::MaterialIndices, is_one, "every triangle has the same material");
    if one_material {
        looks.truncate(1);
    }
    let mut pass = SurfacePass {
        faces: match groups.common_cull() {
            Cull::None => Faces::Both,
            Cull::Back => Faces::Front,
            Cull::Front => Faces::Back,
        },
        is_shaded,
        materials: looks,
        triangle_materials: if one_material { &[] } else { &mesh.triangle_materials },
        face_normals: &[],
        vertex_normals: None,
        uvs: None,
        colors: None,
        edge_masks: Cow::Owned(edge_masks),
        textures,
        lights: lights::lights(&spec.light, camera),
    };
    attributes(mesh, &mut pass, skips);
    Ok(Some(pass))
}

/// Whether any triangle has a material.
fn used_materials(mesh: &Mesh) -> Vec<bool> {
    let mut used = vec![false; mesh.materials.len()];
    for &material in &mesh.triangle_materials {
        if let Some(used) = used.get_mut(material as usize) {
            *used = true;
        }
    }
    used
}

/// Gives the pass the arrays that its materials read.
fn attributes<'a>(mesh: &'a Mesh, pass: &mut SurfacePass<'a>, skips: &mut Skips<'_>) {
    let all = pass.all_flags();
    let reads = |flag: u32| pass.is_shaded && all & flag != 0;
    let faceless = !reads(flags::FACE_NORMALS);
    if !skips.skip(SkipKind::FaceNormals, faceless, "no material is lit by them") {
        pass.face_normals = &mesh.face_normals;
    }
    if !skips.skip(SkipKind::VertexNormals, !reads(flags::VERTEX_NORMALS), "no material is shaded smoothly") {
        let (values, triangles) = normals::smooth(mesh);
        pass.vertex_normals = Some(CornerValues { values, triangles });
    }
    let samples = pass.is_shaded && pass.materials.iter().any(materials::samples);
    let shows_uvs =
        pass.materials.iter().any(|m| m.flags & flags::DEBUG == super::debug_views::UV << flags::DEBUG_SHIFT);
    if !mesh.uvs.is_empty() && !skips.skip(SkipKind::Uvs, !samples && !shows_uvs, "nothing samples a texture") {
        let values = Cow::Borrowed(mesh.uvs.as_slice());
        pass.uvs = Some(CornerValues { values, triangles: &mesh.attribute_triangles });
    }
    let colorless = !reads(flags::VERTEX_COLORS);
    if !mesh.colors.is_empty() && !skips.skip(SkipKind::VertexColors, colorless, "no material shows them") {
        let values = Cow::Borrowed(mesh.colors.as_slice());
        pass.colors = Some(CornerValues { values, triangles: &mesh.attribute_triangles });
    }
}
