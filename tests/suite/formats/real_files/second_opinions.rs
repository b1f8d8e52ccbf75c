//! Second opinions: every valid OBJ and glTF file at hand is read by the crates `tobj` and `gltf`
//! too, and compared. Both may panic on bad files, so only files that meshsnap reads, and that no
//! validator calls broken, are given to them.

use std::path::{Path, PathBuf};

use crate::support::files::mesh::Read;
use base64::Engine as _;
use gltf::mesh::Mode;
use meshsnap_render::import::{Bundle, BundleFile};

use crate::support::data::{self, files};
use crate::support::files::bundle::read_bundle;
use crate::support::files::mesh::corners;

type Corners = [[f64; 3]; 3];

/// The distance that two readers' positions may have, as a share of the mesh's longest side: the
/// Mesh keeps f32 in a unit box.
const APART_MAX: f64 = 2e-6;

#[test]
fn tobj_reads_the_same_from_every_obj() {
    let [models, corpus, examples] = own_folders();
    assert!(compare_all(&[models, corpus, examples], "obj", compare_obj) >= OBJ_FILES_MIN);
}

#[test]
fn the_gltf_crate_reads_the_same_from_every_gltf() {
    let [models, corpus, examples] = own_folders();
    let all = [models, corpus, examples];
    let compared = compare_all(&all, "gltf", compare_gltf) + compare_all(&all, "glb", compare_gltf);
    assert!(compared >= GLTF_FILES_MIN);
}

#[test]
fn other_readers_read_the_same_from_every_large_model() {
    let Some(models) = data::large_folder("models") else { return };
    let folders = [models];
    let gltf = compare_all(&folders, "gltf", compare_gltf) + compare_all(&folders, "glb", compare_gltf);
    let obj = compare_all(&folders, "obj", compare_obj);
    assert!(obj >= LARGE_FILES_MIN[0] && gltf >= LARGE_FILES_MIN[1], "{obj} OBJ and {gltf} glTF files");
}

/// Files of the repository that are compared, at least.
const OBJ_FILES_MIN: usize = 46;
const GLTF_FILES_MIN: usize = 9;
/// OBJ and glTF files of the large data that are compared, at least. That folder may grow.
const LARGE_FILES_MIN: [usize; 2] = [10, 8];

/// Files on which the readers disagree, and the reason. Each must go on to disagree.
const EXPLAINED: [(&str, &str); 3] = [
    (
        "issue-319-002.obj",
        "a corner lies between its neighbours: we cut a polygon into one triangle fewer than tobj counts",
    ),
    ("line-prim.obj", "tobj takes a polyline for a polygon"),
    ("points-prim.obj", "tobj drops points"),
];

fn own_folders() -> [PathBuf; 3] {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("api/examples");
    [data::folder("models"), data::folder("corpus"), examples]
}

/// Compares all valid files of an extension. Gives how many there were.
fn compare_all(folders: &[PathBuf], extension: &str, compare: fn(&Path, &Read) -> Result<bool, String>) -> usize {
    let (mut faults, mut compared) = (Vec::new(), 0);
    for path in folders.iter().flat_map(|folder| files(folder)) {
        if path.extension().is_none_or(|e| e != extension) || is_called_broken(&path) {
            continue;
        }
        let Ok(mesh) = read_bundle(&bundle(&path)) else { continue };
        let why = EXPLAINED.iter().find(|(name, _)| path.ends_with(name)).map(|(_, why)| why);
        match (compare(&path, &mesh), why) {
            (Ok(is_comparable), None) => compared += usize::from(is_comparable),
            (Ok(_), Some(why)) => faults.push(format!("{}: explained by \"{why}\", and the same", path.display())),
            (Err(_), Some(_)) => compared += 1,
            (Err(fault), None) => faults.push(format!("{}: {fault}", path.display())),
        }
    }
    println!("{compared} {extension} files compared");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    compared
}

/// The glTF validator's report lies beside each file that it was given.
fn is_called_broken(path: &Path) -> bool {
    let Ok(report) = std::fs::read(format!("{}.report.json", path.display())) else { return false };
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    report["issues"]["numErrors"] != 0
}

/// The file, and what lies beside it.
fn bundle(path: &Path) -> Bundle {
    let folder = path.parent().unwrap();
    let name = |path: &Path| path.file_name().unwrap().to_str().unwrap().to_owned();
    let is_beside = |other: &PathBuf| {
        let is_mesh = other
            .extension()
            .is_some_and(|e| ["obj", "gltf", "glb", "stl", "ply", "off"].contains(&e.to_str().unwrap()));
        other.parent() == Some(folder) && !is_mesh && other.as_path() != path
    };
    let paths = std::iter::once(path.to_owned()).chain(files(folder).into_iter().filter(is_beside));
    let files = paths.map(|path| BundleFile::new(&name(&path), std::fs::read(&path).unwrap()).unwrap()).collect();
    Bundle::of_files(files).with_entry(Some(name(path)))
}

/// Compares the counts of polygons, lines and points, and the corners of each polygon in the order
/// of the file.
fn compare_obj(path: &Path, mesh: &Read) -> Result<bool, String> {
    let text = std::fs::read(path).unwrap();
    let options = tobj::LoadOptions::default();
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    // Files that tobj alone refuses (empty corners, bytes that are not UTF-8) have no second
    // opinion.
    let Ok((models, _)) = tobj::load_obj_buf(&mut text.as_slice(), &options, no_materials) else { return Ok(false) };
    let mut polygons: Vec<Vec<[f64; 3]>> = Vec::new();
    let mut lines_and_points = 0;
    for tobj::Model { mesh, .. } in &models {
        let mut indices = mesh.indices.iter();
        let all_triangles = vec![3; mesh.indices.len() / 3];
        let arities = if mesh.face_arities.is_empty() { &all_triangles } else { &mesh.face_arities };
        for &arity in arities {
            let corners = indices.by_ref().take(arity as usize);
            let at = |&v: &u32| [0, 1, 2].map(|k| mesh.positions[3 * v as usize + k]);
            let corners: Vec<[f64; 3]> = corners.map(at).collect();
            if arity < 3 { lines_and_points += 1 } else { polygons.push(corners) }
        }
    }
    let report = &mesh.report;
    let counted = report.polygons_by_arity[3..].iter().sum::<u64>();
    same("polygons", counted, polygons.len() as u64)?;
    same("lines and points", mesh.lines_and_points.len() as u64 + report.dropped_lines_and_points, lines_and_points)?;
    if has_dropped(mesh) {
        return Ok(true);
    }
    same("triangles", mesh.triangles.len(), polygons.iter().map(|polygon| polygon.len() - 2).sum::<usize>())?;
    // Each polygon's triangles use its corners and no other point.
    let tolerance = tolerance(mesh);
    let (ours, mut next) = (corners(mesh), 0);
    for polygon in &polygons {
        let triangles = &ours[next..next + polygon.len() - 2];
        next += triangles.len();
        for corner in triangles.iter().flatten() {
            if !polygon.iter().any(|theirs| apart(corner, theirs) <= tolerance) {
                return Err(format!("{corner:?} is none of {polygon:?}"));
            }
        }
        for theirs in polygon {
            if !triangles.iter().flatten().any(|corner| apart(corner, theirs) <= tolerance) {
                return Err(format!("no triangle uses {theirs:?}"));
            }
        }
    }
    Ok(true)
}

/// Compares the triangles of the scene, in its order: indices, positions and node transforms
/// together.
fn compare_gltf(path: &Path, mesh: &Read) -> Result<bool, String> {
    // The crate's validation refuses required extensions that it does not know.
    let Ok(gltf) = gltf::Gltf::from_slice(&std::fs::read(path).unwrap()) else { return Ok(false) };
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let (Some(scene), Some(buffers)) = (scene, buffers(&gltf, path)) else { return Ok(false) };
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    let mut theirs = Triangles { buffers: &buffers, corners: Vec::new(), is_moved: false };
    for node in scene.nodes() {
        if !theirs.add(&node, &identity) {
            return Ok(false);
        }
    }
    let dropped = mesh.report.dropped_degenerate_faces
        + mesh.report.dropped_collapsed_faces
        + mesh.report.dropped_nonfinite_faces;
    same("triangles", mesh.triangles.len() as u64 + dropped, theirs.corners.len() as u64)?;
    if has_dropped(mesh) || theirs.is_moved {
        return Ok(true);
    }
    let tolerance = tolerance(mesh);
    for (i, (ours, theirs)) in corners(mesh).iter().zip(&theirs.corners).enumerate() {
        let is_turned = |by: usize| (0..3).all(|k| apart(&ours[k], &theirs[(k + by) % 3]) <= tolerance);
        if !(0..3).any(is_turned) {
            return Err(format!("triangle {i} is {ours:?}, and not {theirs:?}"));
        }
    }
    Ok(true)
}

/// The buffers' bytes; None where one is not at hand.
fn buffers(gltf: &gltf::Gltf, path: &Path) -> Option<Vec<Vec<u8>>> {
    let load = |buffer: gltf::Buffer<'_>| match buffer.source() {
        gltf::buffer::Source::Bin => gltf.blob.clone(),
        gltf::buffer::Source::Uri(uri) => match uri.strip_prefix("data:") {
            Some(data) => base64::engine::general_purpose::STANDARD.decode(data.split_once(',')?.1).ok(),
            None => std::fs::read(path.parent()?.join(uri)).ok(),
        },
    };
    gltf.buffers().map(load).collect()
}

type Matrix = [[f64; 4]; 4];

/// Triangles as the `gltf` crate has them.
struct Triangles<'a> {
    buffers: &'a [Vec<u8>],
    corners: Vec<Corners>,
    /// Skins or morph targets move vertices, and the crate does not apply them.
    is_moved: bool,
}

impl Triangles<'_> {
    /// Adds a node and its children. False where it holds what the crate cannot read.
    fn add(&mut self, node: &gltf::Node<'_>, parent: &Matrix) -> bool {
        let world = product(parent, &node.transform().matrix().map(|column| column.map(f64::from)));
        self.is_moved |= node.skin().is_some();
        let primitives = node.mesh().into_iter().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>());
        for primitive in primitives {
            self.is_moved |= primitive.morph_targets().next().is_some();
            if !self.add_primitive(&primitive, &world) {
                return false;
            }
        }
        node.children().all(|child| self.add(&child, &world))
    }

    fn add_primitive(&mut self, primitive: &gltf::Primitive<'_>, world: &Matrix) -> bool {
        let positions = primitive.get(&gltf::Semantic::Positions);
        let is_float = positions.is_some_and(|accessor| accessor.data_type() == gltf::accessor::DataType::F32);
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(Vec::as_slice));
        let Some(positions) = reader.read_positions().filter(|_| is_float) else { return false };
        let positions: Vec<[f64; 3]> = positions.map(|p| placed(world, p.map(f64::from))).collect();
        let indices: Vec<usize> = match reader.read_indices() {
            Some(indices) => indices.into_u32().map(|i| i as usize).collect(),
            None => (0..positions.len()).collect(),
        };
        let count = indices.len();
        let triangles: Vec<[usize; 3]> = match primitive.mode() {
            Mode::Triangles => (0..count / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            Mode::TriangleStrip => {
                let turned = |i: usize| if i.is_multiple_of(2) { [i, i + 1, i + 2] } else { [i + 1, i, i + 2] };
                (0..count.saturating_sub(2)).map(turned).collect()
            }
            Mode::TriangleFan => (1..count.saturating_sub(1)).map(|i| [i, i + 1, 0]).collect(),
            _ => Vec::new(),
        };
        // A mirrored node turns its triangles inside out; readers give them back their side.
        let is_mirrored = determinant(world) < 0.0;
        let corner = |i: usize| positions.get(indices[i]).copied();
        for [a, b, c] in triangles {
            let (b, c) = if is_mirrored { (c, b) } else { (b, c) };
            let (Some(a), Some(b), Some(c)) = (corner(a), corner(b), corner(c)) else { return false };
            self.corners.push([a, b, c]);
        }
        true
    }
}

/// Columns, as glTF has them.
fn product(a: &Matrix, b: &Matrix) -> Matrix {
    b.map(|column| std::array::from_fn(|row| (0..4).map(|k| a[k][row] * column[k]).sum()))
}

fn placed(m: &Matrix, p: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| m[0][row] * p[0] + m[1][row] * p[1] + m[2][row] * p[2] + m[3][row])
}

fn determinant(m: &Matrix) -> f64 {
    let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
    m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
}

fn has_dropped(mesh: &Read) -> bool {
    let report = &mesh.report;
    report.dropped_degenerate_faces + report.dropped_collapsed_faces + report.dropped_nonfinite_faces > 0
}

fn tolerance(mesh: &Read) -> f64 {
    let [low, high] = mesh.bounds;
    let side = (0..3).map(|k| f64::from(high[k]) - f64::from(low[k])).fold(0.0, f64::max);
    APART_MAX * side * mesh.to_file.scale
}

fn apart(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max)
}

fn same<T: PartialEq + std::fmt::Debug>(what: &str, ours: T, theirs: T) -> Result<(), String> {
    if ours == theirs { Ok(()) } else { Err(format!("{ours:?} {what}, and the other reader has {theirs:?}")) }
}
