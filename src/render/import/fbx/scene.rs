//! The reader of FBX files. The library `ufbx` loads the scene, within limits of memory and time,
//! and then the scene's geometry, materials and metadata are taken from it.

use super::{bombs, costs, geometry, materials};
use crate::guard::guarded;
use crate::import::FileMetadata;
use crate::import::context::Context;
use crate::import::metadata;
use crate::import::raw::RawMesh;
use crate::import::report::counted_warnings;
use crate::import::{Format, MeshError, MeshFault, text};
use crate::limits;
use crate::mesh::UpAxis;
use crate::warning::Warning;
use ufbx::{
    AllocatorOpts, CoordinateAxis, Error, ErrorType, FileFormat, LoadOpts, OpenFileCb, ProgressCb, ProgressResult,
    Scene, SceneRoot,
};

/// Depth of the node tree. Skeletons of hair and ropes are deep.
const NODE_DEPTH_MAX: u32 = 1024;
/// Bytes between two deadline checks.
const BYTES_PER_POLL: u64 = 1 << 16;

/// Reads an FBX file.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    guarded("FBX", || read_scene(bytes, cx))?
}

fn read_scene(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    costs::check(bytes, cx)?;
    bombs::check(bytes, cx.deadline)?;
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

/// Loads the scene. Each of the library's two memory pools gets half of the remaining budget.
fn load(bytes: &[u8], cx: &mut Context<'_>) -> Result<SceneRoot, MeshError> {
    let left = cx.limits.memory_bytes.saturating_sub(cx.budget.spent_bytes());
    // 0 would mean unlimited.
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
        progress_interval_hint: BYTES_PER_POLL,
        ..LoadOpts::default()
    };
    let scene = ufbx::load_memory(bytes, options).map_err(|error| mesh_error(&error, left, cx))?;
    cx.budget.spend("the FBX scene", scene.metadata.result_memory_used as u64, 1)?;
    Ok(scene)
}

/// Turns an error of the library into one of the file, of a limit or of the deadline.
fn mesh_error(error: &Error, left: u64, cx: &mut Context<'_>) -> MeshError {
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

/// Warnings for content that is not drawn.
fn ignored(scene: &Scene) -> Vec<Warning> {
    let nurbs = scene.nurbs_curves.len() + scene.nurbs_surfaces.len();
    let all = [
        (nurbs as u64, "curves_ignored", "free-form curves and surfaces are not drawn (in the file:"),
        (
            (scene.skin_deformers.len() + scene.blend_deformers.len()) as u64,
            "deformers_ignored",
            "skins and blend shapes are drawn as they were modelled, not posed (in the file:",
        ),
    ];
    counted_warnings(all).collect()
}
