//! The making of the surface, the part of a plan that colours filled faces and barycentric wires, or
//! only lets faces hide lines: its materials as shaders read them, its textures and lamps, and the
//! arrays that these materials read, such as normals and texture coordinates.

use std::borrow::Cow;
use std::sync::Arc;

use super::edge_masks::edge_masks;
use super::textures::TextureLoader;
use super::{lights, materials};
use crate::limits::Budget;
use crate::mesh::creases::{CreaseAngles, creased, sharp_cos};
use crate::plan::context::PlanContext;
use crate::plan::geometry::Geometry;
use crate::plan::prepared::VertexNormals;
use crate::plan::primitives::depth_cue;
use crate::plan::projection::{Projection, Projector};
use crate::plan::shared_slice::SharedSlice;
use crate::plan::skips::SkipKind;
use crate::plan::{CornerValues, Faces, PlanError, ShadedMaterial, SurfacePass, Textures, flags};
use crate::scene::Scene;
use crate::spec::{Cull, Layers, Samples};
use crate::texture::fault_warnings;

/// The pass that is filled, or only hides lines; None where the request needs neither.
pub fn surface_pass<'m>(
    scene: &Scene<'m, '_>,
    geometry: &Geometry<'m>,
    cx: &mut PlanContext<'_>,
) -> Result<Option<SurfacePass<'m>>, PlanError> {
    let groups = &scene.groups;
    let is_seen = groups.has_fill() || groups.has_barycentric_wire();
    let is_needless = !is_seen && !groups.needs_hiding_surface();
    let why = "the look has no filled surface, and no line that one could hide";
    if cx.skips.skip(SkipKind::Surface, is_needless, why) {
        return Ok(None);
    }
    let why = "the surface is not seen: it only hides lines";
    let is_shaded = !cx.skips.skip(SkipKind::Shading, !is_seen, why);
    let edge_masks = if groups.has_barycentric_wire() || groups.shows_edge_distance() {
        edge_masks(scene, geometry, cx)?
    } else {
        Vec::new()
    };
    let (mut materials, textures) = materials_and_textures(scene, geometry, cx)?;
    let is_one = materials.iter().all(|material| *material == materials[0]);
    let is_one = cx.skips.skip(SkipKind::MaterialIndices, is_one, "every triangle has the same material");
    if is_one {
        materials.truncate(1);
    }
    let mut pass = SurfacePass {
        faces: match groups.common_cull() {
            Cull::None => Faces::Both,
            Cull::Back => Faces::Front,
            Cull::Front => Faces::Back,
        },
        is_shaded,
        materials,
        triangle_materials: if is_one { SharedSlice::default() } else { geometry.triangle_materials.clone() },
        face_normals: SharedSlice::default(),
        vertex_normals: None,
        uvs: None,
        second_uvs: SharedSlice::default(),
        colors: None,
        edge_masks: Cow::Owned(edge_masks),
        textures,
        lights: lights::lights(&scene.spec.light, &scene.camera),
    };
    add_attributes(scene, geometry, &mut pass, cx)?;
    Ok(Some(pass))
}

/// The materials as the shaders read them, and the textures that they sample.
fn materials_and_textures(
    scene: &Scene<'_, '_>,
    geometry: &Geometry<'_>,
    cx: &mut PlanContext<'_>,
) -> Result<(Vec<ShadedMaterial>, Arc<Textures>), PlanError> {
    let mesh = scene.mesh;
    let mut loader = TextureLoader::new(mesh, cx);
    let mut materials = Vec::with_capacity(mesh.materials.len());
    let is_used = used_materials(mesh.materials.len(), geometry);
    for (index, (slot, layers)) in mesh.materials.iter().zip(&scene.groups.by_material).enumerate() {
        loader.for_material(index, is_used[index]);
        let mut material = materials::shaded_material(mesh, slot, layers, &mut loader)?;
        if geometry.colors.is_some() && depth_cue::is_cued(slot, layers) {
            material.flags |= flags::VERTEX_COLORS;
        }
        materials.push(material);
    }
    let samples = materials.iter().any(materials::samples);
    if !loader.cx.skips.skip(SkipKind::Textures, !samples, "nothing samples one") && !samples {
        for (index, slot) in mesh.materials.iter().enumerate() {
            loader.for_material(index, is_used[index]);
            materials::load_all(slot, &mut loader)?;
        }
    }
    // A quarter of a pixel is half as wide.
    let is_adaptive = scene.spec.image.samples == Samples::Adaptive;
    let has_quarters = is_adaptive && materials.iter().any(ShadedMaterial::is_quartered);
    let size_px = scene.size_px().map(|size| if has_quarters { 2 * size } else { size });
    let projector = Projector::new(&Projection::new(&scene.camera, size_px));
    let loaded = loader.finish(geometry, &projector)?;
    materials.iter_mut().for_each(|material| materials::remove_textures(material, mesh, &loaded.broken));
    cx.warnings.extend(fault_warnings(&loaded.faults));
    Ok((materials, loaded.textures))
}

/// By material, whether any triangle has it.
fn used_materials(count: usize, geometry: &Geometry<'_>) -> Vec<bool> {
    let mut is_used = vec![false; count];
    // Runs of faces mostly have one material.
    for run in geometry.triangle_materials.chunks(1024) {
        let is_one = run.iter().fold(true, |is_one, &material| is_one & (material == run[0]));
        for &material in if is_one { &run[..1] } else { run } {
            if let Some(is_used) = is_used.get_mut(material as usize) {
                *is_used = true;
            }
        }
    }
    is_used
}

/// Gives the pass the arrays that its materials read.
fn add_attributes<'m>(
    scene: &Scene<'m, '_>,
    geometry: &Geometry<'m>,
    pass: &mut SurfacePass<'m>,
    cx: &mut PlanContext<'_>,
) -> Result<(), PlanError> {
    let mesh = scene.mesh;
    let all = pass.all_flags();
    let reads = |flag: u32| pass.is_shaded && all & flag != 0;
    let is_unlit = !reads(flags::FACE_NORMALS);
    if !cx.skips.skip(SkipKind::FaceNormals, is_unlit, "no material is lit by them") {
        pass.face_normals = geometry.face_normals.clone();
    }
    let is_faceted = !reads(flags::VERTEX_NORMALS | flags::BY_ANGLE);
    if !cx.skips.skip(SkipKind::VertexNormals, is_faceted, "no material is shaded smoothly") {
        pass.vertex_normals = Some(vertex_normals(scene, geometry, cx)?);
    }
    let skips = &mut cx.skips;
    let samples = pass.is_shaded && pass.materials.iter().any(materials::samples);
    let shows_uvs =
        pass.materials.iter().any(|m| m.flags & flags::DEBUG == super::debug_views::UV << flags::DEBUG_SHIFT);
    if !mesh.uvs.is_empty() && !skips.skip(SkipKind::Uvs, !samples && !shows_uvs, "nothing samples a texture") {
        let triangles = geometry.attribute_triangles.clone();
        pass.uvs = Some(CornerValues { values: (&mesh.uvs).into(), triangles });
        pass.second_uvs = (&mesh.second_uvs).into();
    }
    let is_colorless = !reads(flags::VERTEX_COLORS);
    let has_colors = !mesh.colors.is_empty() || geometry.colors.is_some();
    if has_colors && !skips.skip(SkipKind::VertexColors, is_colorless, "no material shows them") {
        let of_mesh =
            || CornerValues { values: (&mesh.colors).into(), triangles: geometry.attribute_triangles.clone() };
        pass.colors = Some(geometry.colors.clone().unwrap_or_else(of_mesh));
    }
    Ok(())
}

/// The file's own vertex normals; angle-weighted ones with creases where it has none.
fn vertex_normals<'m>(
    scene: &Scene<'m, '_>,
    geometry: &Geometry<'m>,
    cx: &mut PlanContext<'_>,
) -> Result<CornerValues<'m, [f32; 3]>, PlanError> {
    if geometry.normals.is_empty() {
        let found = creased_normals(scene, geometry, cx)?;
        let triangles = found.triangles.map_or_else(|| geometry.triangles.clone(), SharedSlice::Owned);
        return Ok(CornerValues { values: SharedSlice::Owned(found.normals), triangles });
    }
    Ok(CornerValues { values: geometry.normals.clone(), triangles: geometry.attribute_triangles.clone() })
}

/// Vertex normals with the creases of each material's angle.
fn creased_normals(
    scene: &Scene<'_, '_>,
    geometry: &Geometry<'_>,
    cx: &mut PlanContext<'_>,
) -> Result<VertexNormals, PlanError> {
    // A material without a surface has no creases of its own.
    let angle = |layers: &Layers| layers.surface.map_or(180.0, |surface| surface.crease_angle_deg);
    let mut cos: Vec<f64> = scene.groups.by_material.iter().map(|layers| sharp_cos(angle(layers))).collect();
    if cos.iter().all(|one| *one == cos[0]) {
        cos.truncate(1);
    }
    let angles = CreaseAngles { cos_by_material: &cos, triangle_materials: &geometry.triangle_materials };
    let Geometry { positions, triangles, face_normals, .. } = geometry;
    let deadline = cx.deadline;
    let find = |budget: &mut Budget| creased(positions, triangles, face_normals, angles, budget, deadline);
    // Triangles that stand for lines and points have normals of their own picture.
    match cx.prepared.filter(|_| positions.len() == scene.mesh.positions.len()) {
        Some(prepared) => Ok(prepared.vertex_normals(&cos, cx.budget, find)?),
        None => Ok(VertexNormals::new(find(cx.budget)?)),
    }
}
