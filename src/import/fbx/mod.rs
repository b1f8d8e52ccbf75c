//! Autodesk FBX, binary and ASCII, parsed by `ufbx`: it gets bytes, a cap on memory and a look at the deadline, and opens
//! nothing. What it gives is checked again where it is an index.
//!
//! [`costs`] refuses what would take it too long, [`shown`] says what is hidden, [`geometry`] places the meshes of the scene and cuts their polygons, [`materials`] are their slots and images.

mod costs;
mod geometry;
mod materials;
mod packed;
mod shown;

use super::raw::RawMesh;
use super::{Format, MeshError, MeshFault, sniff, text};
use crate::import::FileMetadata;
use crate::import::context::Context;
use crate::import::metadata;
use crate::limits;
use crate::mesh::UpAxis;
use crate::warning::Warning;
use ufbx::{
    AllocatorOpts, CoordinateAxis, Error, ErrorType, FileFormat, LoadOpts, OpenFileCb, ProgressCb, ProgressResult,
    Scene, SceneRoot,
};

/// How far into a text its first telling word may be.
const TEXT_SNIFF_BYTES: usize = 4096;
/// Nodes below nodes. Skeletons of hair and ropes are deep.
const NODE_DEPTH_MAX: u32 = 1024;
/// Bytes between two looks at the deadline.
const BYTES_PER_LOOK: u64 = 1 << 16;

/// Whether the bytes begin as an FBX file of either kind.
pub fn is_fbx(bytes: &[u8]) -> bool {
    if bytes.starts_with(b"Kaydara FBX Binary") {
        return true;
    }
    let text = sniff::trim_start(bytes);
    let head = &text[..text.len().min(TEXT_SNIFF_BYTES)];
    let has = |word: &[u8]| head.windows(word.len()).any(|w| w == word);
    head.starts_with(b"; FBX") || (has(b"FBXHeaderExtension:") && has(b"{"))
}

/// Reads an FBX file.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    costs::check(bytes, cx)?;
    packed::check(bytes, cx.deadline)?;
    let scene = load(bytes, cx)?;
    limits::check("the number of scene nodes", scene.nodes.len() as u64, cx.limits.nodes, "--limit-nodes")?;
    let mut raw = RawMesh::default();
    raw.report.format = Format::Fbx;
    raw.report.metadata = FileMetadata {
        generator: metadata::tidy(scene.metadata.creator.as_bytes()),
        nodes: Some(scene.nodes.len() as u64),
        meshes: Some(scene.meshes.len() as u64),
        animations: Some(scene.anim_stacks.len() as u64),
        skins: Some(scene.skin_deformers.len() as u64),
        cameras: Some(scene.cameras.len() as u64),
        ..FileMetadata::default()
    };
    raw.up = up_axis(&scene);
    let materials = geometry::read(&scene, &mut raw, cx)?;
    materials::read(&scene, &materials, &mut raw, cx)?;
    raw.report.warnings.extend(ignored(&scene));
    Ok(raw)
}

/// Two pools of memory, each with half of what the job has left.
fn load(bytes: &[u8], cx: &mut Context<'_>) -> Result<SceneRoot, MeshError> {
    let left = cx.limits.memory_bytes.saturating_sub(cx.budget.spent_bytes());
    // 0 would mean no limit.
    let pool = || AllocatorOpts { memory_limit: (left / 2).max(1) as usize, ..AllocatorOpts::default() };
    let deadline = cx.deadline;
    deadline.check()?;
    let progress = |_: &ufbx::Progress| match deadline.check() {
        Ok(()) => ProgressResult::Continue,
        Err(_) => ProgressResult::Cancel,
    };
    let options = LoadOpts {
        temp_allocator: pool(),
        result_allocator: pool(),
        ignore_animation: true,
        skip_skin_vertices: true,
        load_external_files: false,
        open_file_cb: OpenFileCb::Ref(&|_, _| None),
        file_format: FileFormat::Fbx,
        no_format_from_content: true,
        no_format_from_extension: true,
        node_depth_limit: NODE_DEPTH_MAX,
        progress_cb: ProgressCb::Ref(&progress),
        progress_interval_hint: BYTES_PER_LOOK,
        ..LoadOpts::default()
    };
    let scene = ufbx::load_memory(bytes, options).map_err(|error| told(&error, left, cx))?;
    cx.budget.spend("the FBX scene", scene.metadata.result_memory_used as u64, 1)?;
    Ok(scene)
}

/// What went wrong, as an error of the file, of a limit or of time.
fn told(error: &Error, left: u64, cx: &mut Context<'_>) -> MeshError {
    match error.type_ {
        ErrorType::MemoryLimit | ErrorType::AllocationLimit | ErrorType::OutOfMemory => {
            let refused = cx.budget.spend("the FBX scene", left.saturating_add(1), 1);
            refused.map_or_else(MeshError::from, |()| MeshError::broken("the FBX file needs too much memory"))
        }
        ErrorType::Cancelled => limits::Stopped.into(),
        ErrorType::UnsupportedVersion => MeshError::new(
            MeshFault::Unsupported,
            "the FBX file is of a version that is not read: save it as 7.4 or 7.5",
        ),
        ErrorType::NodeDepthLimit => {
            MeshError::broken(format!("the nodes of the FBX file are more than {NODE_DEPTH_MAX} deep"))
        }
        _ => {
            let info = error.info();
            let info = if info.is_empty() { String::new() } else { format!(" ({info})") };
            MeshError::broken(format!(
                "the FBX file cannot be read: {}",
                text::foreign(format_args!("{}{info}", &*error.description))
            ))
        }
    }
}

fn up_axis(scene: &Scene) -> UpAxis {
    match scene.settings.axes.up {
        CoordinateAxis::PositiveX => UpAxis::X,
        CoordinateAxis::NegativeX => UpAxis::NegX,
        CoordinateAxis::NegativeY => UpAxis::NegY,
        CoordinateAxis::PositiveZ => UpAxis::Z,
        CoordinateAxis::NegativeZ => UpAxis::NegZ,
        CoordinateAxis::PositiveY | CoordinateAxis::Unknown => UpAxis::Y,
    }
}

/// What the file has that is not drawn.
fn ignored(scene: &Scene) -> Vec<Warning> {
    let nurbs = scene.nurbs_curves.len() + scene.nurbs_surfaces.len();
    let all = [
        (nurbs, "curves_ignored", "free-form curves and surfaces are not drawn (in the file:"),
        (
            scene.skin_deformers.len() + scene.blend_deformers.len(),
            "deformers_ignored",
            "skins and blend shapes are drawn as they were modelled, not posed (in the file:",
        ),
    ];
    let met = all.into_iter().filter(|(count, ..)| *count > 0);
    met.map(|(count, code, what)| Warning { code, detail: format!("{what} {count})") }).collect()
}
