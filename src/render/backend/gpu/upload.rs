//! The upload of a plan (all that is to be drawn for one picture) to the GPU: for each stage, the buffers that it
//! reads are filled, and those that it writes are made large enough. Data of a mesh that are on the GPU already are
//! not written again.

use super::buffers::Buffers;
use super::device::Gpu;
use super::params::{
    attributes, corner_triangles, edge_lists, hull_materials, line_colors, sample_masks, texture_table,
};
use super::pipelines::Slot;
use super::residents::{ListLookup, Source};
use super::schedule::Schedule;
use super::schedule::sizes::{
    PEEL_STATE_BYTES, SAMPLE_BYTES, STROKES_BYTES, color_bytes, has_visibility, occlusion_bytes, owner_bytes, samples,
    work_bytes,
};
use crate::backend::DrawError;
use crate::image::srgb8_thresholds;
use crate::plan::{CornerValues, DrawPlan, ScreenVertex, SurfacePass};

/// Supplies the input of transform and visibility, and reserves their output.
pub fn upload_geometry(
    gpu: &Gpu,
    buffers: &mut Buffers,
    plan: &DrawPlan<'_>,
    schedule: &Schedule,
) -> Result<(), DrawError> {
    let mesh = plan.mesh.as_ref();
    let positions = Source::of(&plan.positions, mesh);
    supply(gpu, buffers, Slot::Positions, positions, &[bytemuck::cast_slice(&plan.positions)])?;
    let (corners, own) = plan.hull.as_ref().map_or((&[][..], &[][..]), |hull| (&hull.triangles, &hull.vertices));
    let triangles = Source::of(&plan.triangles, mesh).filter(|_| corners.is_empty());
    let slices = [bytemuck::cast_slice(&plan.triangles), bytemuck::cast_slice(corners)];
    supply(gpu, buffers, Slot::Triangles, triangles, &slices)?;
    let gpu = &gpu.handles;
    let transformed = plan.positions.len() as u64 * size_of::<ScreenVertex>() as u64;
    buffers.upload_at(gpu, Slot::Vertices, transformed, bytemuck::cast_slice(own))?;
    if let Some(hull) = &plan.hull {
        buffers.upload(gpu, Slot::HullMaterials, &hull_materials(hull))?;
    }
    if !has_visibility(plan) {
        return Ok(());
    }
    buffers.upload(gpu, Slot::PassMasks, &plan.pass_masks)?;
    buffers.reserve(gpu, Slot::Samples, schedule.banding.seen_samples(plan) * SAMPLE_BYTES)?;
    let samples = samples(plan, schedule.banding.rows);
    if plan.peeling().is_some() {
        buffers.reserve(gpu, Slot::PeelLayer, samples * SAMPLE_BYTES)?;
        buffers.reserve(gpu, Slot::PeelState, samples * PEEL_STATE_BYTES)?;
        buffers.reserve(gpu, Slot::PeelRounds, u64::from(schedule.layers) * 4)?;
    }
    buffers.reserve(gpu, Slot::Work, work_bytes(schedule.work_items))?;
    Ok(())
}

/// Supplies the input of shade, lines and resolve, and reserves their output.
pub fn upload_shading(
    gpu: &Gpu,
    buffers: &mut Buffers,
    plan: &DrawPlan<'_>,
    schedule: &Schedule,
) -> Result<(), DrawError> {
    let band_pixels = u64::from(plan.width_px) * u64::from(schedule.banding.rows);
    if !schedule.is_painted(plan) && (has_visibility(plan) || !plan.lines.is_empty()) {
        buffers.reserve(&gpu.handles, Slot::Colors, band_pixels * color_bytes(plan))?;
    }
    if plan.has_mixed() {
        buffers.reserve(&gpu.handles, Slot::Mixed, schedule.banding.mixed_bytes(plan))?;
        buffers.reserve(&gpu.handles, Slot::Lists, schedule.banding.lists_bytes(plan))?;
        // It is all zeros when a job begins: mixed_color.wgsl clears what it reads, a new buffer is clear, and a job
        // that fails does not give its buffers back.
        buffers.reserve(&gpu.handles, Slot::Points, schedule.banding.points_bytes(plan))?;
    }
    if plan.occlusion.is_some() {
        buffers.reserve(&gpu.handles, Slot::Occlusion, occlusion_bytes(plan))?;
    }
    if let Some(surface) = &plan.surface {
        upload_surface(gpu, buffers, plan, surface)?;
    }
    if !plan.lines.is_empty() {
        let (lists, _) = edge_lists(&plan.lines);
        let slices: Vec<&[u8]> = lists.iter().map(|list| bytemuck::cast_slice(list)).collect();
        let source = plan.lines.first().filter(|_| lists.len() == 1);
        let source = source.and_then(|lines| Source::of_arc(&lines.edges, size_of_val(&lines.edges[..])));
        supply(gpu, buffers, Slot::Edges, source, &slices)?;
        let gpu = &gpu.handles;
        buffers.upload(gpu, Slot::LineColors, bytemuck::cast_slice(&line_colors(&plan.lines)))?;
        buffers.upload(gpu, Slot::SampleMasks, bytemuck::cast_slice(&sample_masks(plan.samples)))?;
        buffers.reserve(gpu, Slot::Strokes, band_pixels * STROKES_BYTES)?;
        buffers.reserve(gpu, Slot::Progress, schedule.progress_bytes)?;
        if owner_bytes(plan) > 0 {
            buffers.reserve(gpu, Slot::Owners, band_pixels * owner_bytes(plan))?;
        }
    }
    buffers.upload(&gpu.handles, Slot::Thresholds, bytemuck::cast_slice(&srgb8_thresholds()))?;
    Ok(())
}

/// Supplies what shading reads of the surface.
fn upload_surface(
    gpu: &Gpu,
    buffers: &mut Buffers,
    plan: &DrawPlan<'_>,
    surface: &SurfacePass<'_>,
) -> Result<(), DrawError> {
    let mesh = plan.mesh.as_ref();
    if surface.edge_masks.is_empty() {
        let materials = &surface.triangle_materials;
        supply(gpu, buffers, Slot::Attributes, Source::of(materials, mesh), &[bytemuck::cast_slice(materials)])?;
    } else {
        buffers.upload(&gpu.handles, Slot::Attributes, &attributes(surface))?;
    }
    buffers.upload(&gpu.handles, Slot::Materials, bytemuck::cast_slice(&surface.materials))?;
    let face_normals = &surface.face_normals;
    supply(gpu, buffers, Slot::FaceNormals, Source::of(face_normals, mesh), &[bytemuck::cast_slice(face_normals)])?;
    if let Some(CornerValues { values, .. }) = &surface.vertex_normals {
        supply(gpu, buffers, Slot::Normals, Source::of(values, mesh), &[bytemuck::cast_slice(values)])?;
    }
    if let Some(CornerValues { values, .. }) = &surface.uvs {
        let sets: [&[u8]; 2] = [bytemuck::cast_slice(values), bytemuck::cast_slice(&surface.second_uvs)];
        let source = Source::of(values, mesh).map(|source| source.followed_by(sets[1].len()));
        supply(gpu, buffers, Slot::Uvs, source, &sets)?;
    }
    if let Some(CornerValues { values, .. }) = &surface.colors {
        supply(gpu, buffers, Slot::VertexColors, Source::of(values, mesh), &[bytemuck::cast_slice(values)])?;
    }
    let lists = corner_triangles(surface, &plan.triangles).0;
    let all = [
        surface.vertex_normals.as_ref().map(|normals| &normals.triangles),
        surface.uvs.as_ref().map(|uvs| &uvs.triangles),
        surface.colors.as_ref().map(|colors| &colors.triangles),
    ];
    let source = match lists[..] {
        [list] => all.into_iter().flatten().find(|of| std::ptr::eq(&of[..], list)).and_then(|of| Source::of(of, mesh)),
        _ => None,
    };
    let slices: Vec<&[u8]> = lists.into_iter().map(bytemuck::cast_slice).collect();
    supply(gpu, buffers, Slot::CornerTriangles, source, &slices)?;
    let images = texture_table(&surface.textures);
    let mut parts: Vec<&[u8]> = vec![bytemuck::cast_slice(&images)];
    parts.extend(surface.textures.images.iter().map(|image| bytemuck::cast_slice::<_, u8>(&image.texels)));
    let source = Source::of_arc(&surface.textures, parts.iter().map(|part| part.len()).sum());
    supply(gpu, buffers, Slot::Texels, source, &parts)
}

/// Gives a slot its input: the buffer that is kept for its source, or else the slices.
fn supply(
    gpu: &Gpu,
    buffers: &mut Buffers,
    slot: Slot,
    source: Option<Source>,
    parts: &[&[u8]],
) -> Result<(), DrawError> {
    if let Some(source) = &source {
        let buffer = match gpu.residents.find(slot, source) {
            ListLookup::Buffer(buffer) => Some(buffer),
            ListLookup::Wanted => {
                let buffer = Buffers::filled(&gpu.handles, parts)?;
                buffers.keep_later(slot, source, &buffer);
                Some(buffer)
            }
            ListLookup::Unwanted => None,
        };
        if let Some(buffer) = buffer {
            buffers.bind(slot, buffer);
            return Ok(());
        }
    }
    buffers.upload_slices(&gpu.handles, slot, parts)
}
