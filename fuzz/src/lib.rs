//! The body of every fuzz target. The suite includes this file and runs all seeds and all former
//! finds through it, so it may only use meshsnap and `serde_json`.

#![allow(clippy::panic, clippy::unwrap_used, clippy::expect_used)] // a broken promise is a find

use meshsnap_inspect::report::{Extras, Report};
use meshsnap_render::backend::{Backends, GpuHost, HardwareHint};
use meshsnap_render::import::{Bundle, BundleFile, Format, ImportReport, MeshError, Options, import};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::material::{AlphaMode, FileLens};
use meshsnap_render::pipeline;
use meshsnap_render::pipeline::{Context, Job, RenderError};
use meshsnap_render::request;
use meshsnap_render::request::Rules;
use meshsnap_render::spec::BackendChoice;
use std::cell::RefCell;
use std::sync::Arc;

mod meshopt;

/// Every target: one per name of a mesh format, and those that take more or less than a mesh.
pub fn targets() -> Vec<&'static str> {
    [Format::names(), vec!["meshopt", "zip", "request", "pipeline"]].concat()
}

/// Between an OBJ file and the MTL file that it calls `a.mtl`.
const MTL_MARK: &[u8] = b"\n%mtl\n";

/// Runs one input. It may be refused, but must not panic, take long, or become an invalid mesh.
pub fn run(target: &str, bytes: &[u8]) {
    match target {
        "request" => run_request(bytes),
        "pipeline" => run_pipeline(bytes),
        _ => {
            let (bundle, format) = bundle(target, bytes);
            run_import(&bundle, Options { format, time_s: time_s(bytes), counts_loose: true });
        }
    }
}

/// The result of a target's importer, in the rest pose. None for targets that take more than a mesh.
pub fn imported(target: &str, bytes: &[u8]) -> Option<Result<Mesh, MeshError>> {
    if matches!(target, "request" | "pipeline") {
        return None;
    }
    let (bundle, format) = bundle(target, bytes);
    let limits = limits();
    Some(import(&bundle, format, &limits, &mut Budget::new(&limits), &Deadline::default()).map(|(mesh, _)| mesh))
}

fn bundle(target: &str, bytes: &[u8]) -> (Bundle, Option<Format>) {
    match target {
        // A 3MF package is an archive, and is recognised by its contents.
        "zip" | "3mf" => (Bundle::zip(bytes.to_vec()), None),
        "obj" => (obj(bytes), Some(Format::Obj)),
        "meshopt" => (Bundle::of_one(meshopt::glb(bytes)), Some(Format::Glb)),
        name => {
            let format = Format::from_name(name).unwrap_or_else(|| panic!("{name} is no target"));
            (Bundle::of_one(bytes.to_vec()), Some(format))
        }
    }
}

/// A moment within four seconds for two inputs of three. Any change of the bytes changes it.
fn time_s(bytes: &[u8]) -> Option<f64> {
    let sum = bytes.iter().fold(0_u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(*byte)));
    (!sum.is_multiple_of(3)).then(|| f64::from(sum % 256) / 64.0)
}

/// Limits that are small, so that inputs break them soon, and large enough for every seed.
fn limits() -> Limits {
    Limits::default().with(|limits| {
        limits.memory_bytes = 64 << 20;
        limits.triangles = 50_000;
        limits.nodes = 2_000;
        limits.image_px = 64;
        limits.texture_px = 256;
        limits.texture_total_px = 1 << 18;
        limits.bundle_bytes = 4 << 20;
        limits.bundle_entries = 50;
    })
}

fn obj(bytes: &[u8]) -> Bundle {
    let mark = bytes.windows(MTL_MARK.len()).position(|window| window == MTL_MARK);
    let Some(mark) = mark else { return Bundle::of_one(bytes.to_vec()) };
    let file = |name: &str, bytes: &[u8]| BundleFile::new(name, bytes.to_vec()).expect("a good name");
    let files = vec![file("a.obj", &bytes[..mark]), file("a.mtl", &bytes[mark + MTL_MARK.len()..])];
    Bundle::of_files(files).with_entry(Some("a.obj".into()))
}

fn run_import(bundle: &Bundle, options: Options) {
    let limits = limits();
    let mut budget = Budget::new(&limits);
    match import(bundle, options, &limits, &mut budget, &Deadline::default()) {
        Ok((mesh, import)) => {
            check(&mesh, &import);
            let extras = Extras { print: true, parts: true, uv: true };
            let report = Report::of(&mesh, &import, extras, &mut budget, &Deadline::default());
            let Ok(report) = report else { return };
            assert!(!report.text().is_empty());
            serde_json::to_vec(&report).expect("a report is JSON");
        }
        Err(error) => assert!(is_short(&error.detail), "{}", error.detail.len()),
    }
}

/// True if a sentence about a file is short and does not repeat the file.
fn is_short(detail: &str) -> bool {
    !detail.is_empty() && detail.chars().count() <= 1000
}

/// Checks the invariants of every imported mesh.
fn check(mesh: &Mesh, report: &ImportReport) {
    let (positions, triangles) = (mesh.positions.len(), mesh.triangles.len());
    assert!(
        (triangles > 0 || !mesh.lines_and_points.is_empty())
            && mesh.face_normals.len() == triangles
            && mesh.edge_masks.len() == triangles
    );
    assert!(mesh.triangle_materials.len() == triangles && !mesh.materials.is_empty());
    // At most a half, except for a mesh as small as the spacing of f64 at its place: its centre is
    // one of its corners.
    assert!(mesh.positions.iter().flatten().all(|c| c.abs() <= 1.0));
    for [a, b, c] in &mesh.triangles {
        assert!(a != b && b != c && c != a && [a, b, c].iter().all(|v| (**v as usize) < positions));
    }
    let ends_are_good = mesh.lines_and_points.iter().flat_map(|one| one.ends).all(|v| (v as usize) < positions);
    assert!(ends_are_good && mesh.lines_and_points.iter().all(|one| (one.material as usize) < mesh.materials.len()));
    assert!(mesh.triangle_materials.iter().all(|m| (*m as usize) < mesh.materials.len()));
    assert!(mesh.face_normals.iter().flatten().all(|c| c.is_finite()));
    let attributes = [mesh.normals.len(), mesh.uvs.len(), mesh.colors.len()];
    let count = attributes.into_iter().max().unwrap_or(0);
    assert!(attributes.iter().all(|n| *n == 0 || *n == count));
    assert!(count == 0 || mesh.attribute_triangles.len() == triangles);
    assert!(mesh.attribute_triangles.iter().flatten().all(|v| (*v as usize) < count));
    assert!(mesh.normals.iter().flatten().chain(mesh.uvs.iter().flatten()).all(|c| c.is_finite()));
    assert!(mesh.colors.iter().flatten().all(|c| c.is_finite()));
    let slots = &mesh.materials;
    let textures =
        slots.iter().flat_map(|m| [m.base_texture, m.metallic_roughness_texture, m.normal_texture, m.emissive_texture]);
    assert!(textures.flatten().all(|texture| (texture.image as usize) < mesh.images.len()));
    for slot in slots {
        let factors = slot.base_color.iter().flatten().chain(slot.emissive.iter().flatten());
        let mut factors = factors.chain(&slot.metallic).chain(&slot.roughness).chain(&slot.normal_scale);
        assert!(factors.all(|factor| factor.is_finite()), "{slot:?}");
        let textures = [slot.base_texture, slot.metallic_roughness_texture, slot.normal_texture, slot.emissive_texture];
        assert!(textures.iter().flatten().flat_map(|t| t.transform).flatten().all(f32::is_finite), "{slot:?}");
        assert!(slot.name.chars().count() <= 200 && !matches!(slot.alpha, AlphaMode::Mask(at) if !at.is_finite()));
    }
    for camera in &mesh.cameras {
        let lens = match camera.lens {
            FileLens::Perspective { fov_deg } => fov_deg,
            FileLens::Orthographic { height } => height,
        };
        let all_finite = camera.eye.iter().chain(camera.axes.iter().flatten()).all(|c| c.is_finite());
        assert!(all_finite && lens.is_finite() && lens > 0.0 && camera.name.chars().count() <= 200, "{camera:?}");
    }
    assert!(report.warnings.iter().all(|warning| is_short(&warning.detail)));
    assert!(mesh.to_file.scale > 0.0 && mesh.to_file.centre.iter().all(|c| c.is_finite()));
}

/// Reads a document and, after a zero byte, dotted keys with their values, one per line.
fn run_request(bytes: &[u8]) {
    let (document, keys) = split(bytes);
    let keys = String::from_utf8_lossy(keys);
    let overrides: Vec<(String, String)> =
        keys.lines().filter_map(|line| line.split_once('=')).map(|(k, v)| (k.into(), v.into())).collect();
    let rules = Rules { limits: limits(), backend: BackendChoice::Cpu };
    match request::read((!document.is_empty()).then_some(document), &overrides, &rules) {
        Ok(spec) => {
            let side_max = rules.limits.image_px;
            assert!((1..=side_max).contains(&u64::from(spec.image.width_px)));
            assert!((1..=side_max).contains(&u64::from(spec.image.height_px)));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// Draws, small and on the CPU: a document and, after a zero byte, a mesh of any format.
fn run_pipeline(bytes: &[u8]) {
    thread_local! {
        static BACKENDS: RefCell<Backends> = RefCell::new(Backends::new(no_gpu(), 1));
    }
    let (document, mesh) = split(bytes);
    let rules = Rules { limits: limits(), backend: BackendChoice::Cpu };
    let fixed = [("image.width", "32"), ("image.height", "32"), ("backend", "cpu")];
    let overrides = fixed.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let Ok(spec) = request::read((!document.is_empty()).then_some(document), &overrides, &rules) else { return };
    let bundle = Bundle::of_one(mesh.to_vec());
    let job = Job { bundle, format_in: None, spec: &spec };
    let deadline = Deadline::default();
    let budget = Budget::new(&rules.limits);
    let drawn = BACKENDS.with_borrow_mut(|backends| {
        pipeline::render(job, &rules.limits, Context { backends, budget, deadline: &deadline, ended: &mut |_| {} })
    });
    match drawn {
        Ok(output) => assert!(!output.bytes.is_empty()),
        Err(RenderError::Mesh(_) | RenderError::Plan(_)) => {}
        Err(ours) => panic!("{ours}"),
    }
}

fn no_gpu() -> Arc<GpuHost> {
    Arc::new(GpuHost::new(HardwareHint::None { reason: "targets draw on the CPU".into() }, None))
}

/// The bytes before the first zero byte, and those after it.
fn split(bytes: &[u8]) -> (&[u8], &[u8]) {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    (&bytes[..end], bytes.get(end + 1..).unwrap_or_default())
}
