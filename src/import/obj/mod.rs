//! Wavefront OBJ, parsed by `tobj`. Every line is first cleaned by [`clean`], so that `tobj` sees
//! nothing that it would refuse or misread, every error names its line, and no count is trusted.
//! MTL files are read by [`mtl`], because `tobj` would panic on some. [`materials`] makes slots and
//! images from them.

mod clean;
mod face;
mod lines;
mod map;
mod materials;
mod mtl;
mod skipped;
mod sniff;

pub use sniff::is_obj;

use self::clean::Cleaner;
use super::polygon::Triangulator;
use super::raw::{RawMesh, extend_attribute};
use super::{Format, MeshError, text};
use crate::import::FileMetadata;
use crate::import::context::Context;
use crate::import::metadata;
use crate::mesh::{LineOrPoint, MaterialSlot};
use crate::srgb::srgb_to_linear;
use std::path::Path;
use tobj::{LoadError, LoadOptions};

/// Reads an OBJ file.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    // No triangulation by tobj: it would fan polygons, which is wrong for concave ones. With one
    // index for all attributes, a model whose faces have the same attributes gets arrays of equal
    // length; the cleaner starts a new model where the attributes change.
    let options = LoadOptions { single_index: true, triangulate: false, ignore_points: false, ignore_lines: false };
    let text = text::to_utf8(bytes, cx.budget)?;
    let mut cleaner = Cleaner::new(&text, cx);
    let loaded = tobj::load_obj_buf(&mut cleaner, &options, material_of_its_own);
    let summary = cleaner.finish(loaded.as_ref().err().copied())?;
    let (models, _) = loaded.map_err(|e| MeshError::broken(format!("the OBJ file cannot be read: {e}")))?;

    let mut raw = RawMesh::default();
    raw.report.format = Format::Obj;
    raw.report.file_vertices = summary.vertices;
    raw.report.warnings = summary.skipped.warnings();
    raw.report.metadata = FileMetadata::by(metadata::first_comment(&text, b"#", |_| false));
    let mut triangulator = Triangulator::default();
    for model in models {
        cx.deadline.check()?;
        append(&mut raw, &model.mesh, &mut triangulator)?;
    }
    raw.report.warnings.extend(triangulator.warning());
    linearise(&mut raw.colors);
    let slots = materials::read(&summary.materials, &summary.libraries, &mut raw, cx)?;
    // Slot 0 is for faces before the first `usemtl`, and is dropped without such faces.
    let line_or_point_unnamed = raw.lines_and_points.iter().any(|one| one.material == 0);
    let uses_unnamed = raw.triangle_materials.contains(&0) || line_or_point_unnamed || slots.is_empty();
    raw.materials = std::iter::once(MaterialSlot::default()).chain(slots).skip(usize::from(!uses_unnamed)).collect();
    if !uses_unnamed {
        raw.triangle_materials.iter_mut().for_each(|m| *m -= 1);
        raw.lines_and_points.iter_mut().for_each(|one| one.material -= 1);
    }
    Ok(raw)
}

/// Makes up a material for `mtllib N`, which the cleaner writes before the first `usemtl N`.
/// Without a material of that name, tobj would not keep which faces use it.
fn material_of_its_own(path: &Path) -> tobj::MTLLoadResult {
    let name = path.to_str().ok_or(LoadError::MaterialParseError)?.to_owned();
    let material = tobj::Material { name: name.clone(), ..Default::default() };
    Ok((vec![material], std::iter::once((name, 0)).collect()))
}

/// Adds one of tobj's models: the faces between two changes of material or form.
fn append(raw: &mut RawMesh, mesh: &tobj::Mesh, triangulator: &mut Triangulator) -> Result<(), MeshError> {
    let base = u32::try_from(raw.positions.len()).ok().filter(|base| {
        let end = u64::from(*base) + mesh.positions.len() as u64 / 3;
        end < u64::from(u32::MAX)
    });
    let base = base.ok_or_else(|| MeshError::broken("the OBJ file has more than 4 billion vertices"))?;
    raw.positions.extend(mesh.positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]));
    let (before, after) = (base as usize, raw.positions.len());
    let normals = mesh.normals.chunks_exact(3).map(|n| [n[0] as f32, n[1] as f32, n[2] as f32]);
    extend_attribute(&mut raw.normals, before, after, [0.0; 3], normals);
    // In OBJ v runs up from the image's lower edge, in a raw mesh down from the upper one.
    let uvs = mesh.texcoords.chunks_exact(2).map(|t| [t[0] as f32, (1.0 - t[1]) as f32]);
    extend_attribute(&mut raw.uvs, before, after, [0.0; 2], uvs);
    let colors = mesh.vertex_color.chunks_exact(3).map(|c| [c[0] as f32, c[1] as f32, c[2] as f32, 1.0]);
    extend_attribute(&mut raw.colors, before, after, [1.0; 4], colors);

    let material = mesh.material_id.map_or(0, |id| id as u32 + 1);
    let mut corners = Vec::new();
    let mut at = 0;
    // Without arities all faces are triangles.
    let faces = if mesh.face_arities.is_empty() { mesh.indices.len() / 3 } else { mesh.face_arities.len() };
    for face in 0..faces {
        let arity = mesh.face_arities.get(face).map_or(3, |&n| n as usize);
        let Some(indices) = mesh.indices.get(at..at + arity) else { break };
        at += arity;
        corners.clear();
        corners.extend(indices.iter().map(|i| base + i));
        if let [a] | [a, _] = corners[..] {
            raw.lines_and_points.push(LineOrPoint { ends: [a, corners[arity - 1]], material });
            continue;
        }
        raw.report.polygons_by_arity[arity.min(12)] += 1;
        triangulator.split(&corners, &raw.positions, &mut |triangle, mask| {
            raw.triangles.push(triangle);
            raw.edge_masks.push(mask);
            raw.triangle_materials.push(material);
        });
    }
    Ok(())
}

/// Converts colours, which by convention are sRGB from 0 to 1 or, from some exporters, from 0 to
/// 255.
fn linearise(colors: &mut [[f32; 4]]) {
    let scale = if colors.iter().any(|c| c[..3].iter().any(|&v| v > 1.0 && v.is_finite())) { 255.0 } else { 1.0 };
    for component in colors.iter_mut().flat_map(|c| &mut c[..3]) {
        *component = srgb_to_linear(f64::from(*component) / scale) as f32;
    }
}
