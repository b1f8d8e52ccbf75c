//! Real files are imported, and odd and broken ones are survived.

use crate::support::data::{self, files};
use crate::support::files::mesh::read;
use crate::support::work::within_bytes;
use meshsnap_render::import::MeshFault;
use std::path::Path;

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

#[test]
fn all_models_import() {
    all_import(&data::folder("models"), 16, &["BoxDraco/BoxDraco.gltf"]);
}

#[test]
fn all_large_models_import() {
    let Some(folder) = data::large_folder("models") else { return };
    let in_several_files = [
        "BoxDraco/BoxDraco.gltf",
        "PalmTree/PalmTree.gltf",
        "meshopt-fallback/meshopt-fallback.gltf",
        "meshopt-no-fallback/meshopt-no-fallback.gltf",
    ];
    all_import(&folder, 38, &in_several_files);
}

fn all_import(folder: &Path, count: usize, in_several_files: &[&str]) {
    let mut imported = 0;
    let mut refused = Vec::new();
    for path in files(folder) {
        if !["obj", "stl", "ply", "off", "glb", "gltf"].contains(&extension(&path).as_str()) {
            continue;
        }
        let name = path.strip_prefix(folder).unwrap().to_string_lossy().into_owned();
        match read(&std::fs::read(&path).unwrap()) {
            Err(error) => refused.push((name, error)),
            Ok(mesh) => {
                imported += 1;
                let count = mesh.triangles.len();
                assert!(count > 0 || !mesh.lines_and_points.is_empty(), "{name}");
                assert_eq!([mesh.face_normals.len(), mesh.edge_masks.len(), mesh.triangle_materials.len()], [count; 3]);
                let positions = mesh.positions.len() as u32;
                assert!(mesh.triangles.iter().flatten().all(|&v| v < positions), "{name}");
                assert!(mesh.positions.iter().flatten().all(|c| c.abs() <= 0.5), "{name}");
                let attributes = [mesh.normals.len(), mesh.uvs.len(), mesh.colors.len()];
                let most = attributes.into_iter().max().unwrap();
                assert!(attributes.iter().all(|&n| n == 0 || n == most), "{name}");
                assert_eq!(mesh.attribute_triangles.len(), if most == 0 { 0 } else { count }, "{name}");
                assert!(mesh.attribute_triangles.iter().flatten().all(|&v| (v as usize) < most), "{name}");
                let slots = mesh.materials.len() as u32;
                assert!(mesh.triangle_materials.iter().all(|&m| m < slots), "{name}");
            }
        }
    }
    let expected: Vec<_> = in_several_files.iter().map(|&name| (name, MeshFault::OutsideBundle)).collect();
    let refused: Vec<(&str, MeshFault)> = refused.iter().map(|(n, e)| (n.as_str(), e.fault.clone())).collect();
    assert_eq!(refused, expected);
    // The large folder may grow.
    assert!(imported >= count, "{imported} imported, and {count} expected");
}

#[test]
fn known_models_have_their_known_sizes() {
    // Name, triangles, polygons that are not triangles.
    let cases = [
        ("made/star-prism.obj", 36, 12),
        ("made/torus-quads.obj", 2304, 1152),
        ("made/torus-big.ply", 2304, 1152),
        ("made/torus.off", 2304, 1152),
        ("made/stepped-shaft.stl", 576, 0),
        ("BoxTextured.glb", 12, 0),
    ];
    have_sizes(&data::folder("models"), &cases);
}

#[test]
fn large_models_have_their_known_sizes() {
    let Some(folder) = data::large_folder("models") else { return };
    // Name, triangles, polygons that are not triangles.
    let cases = [
        ("suzanne.obj", 968, 468),
        ("stanford-bunny.obj", 69451, 0),
        ("horse_quad.obj", 4796, 2398),
        ("quadknot.obj", 2880, 1440),
        ("polygonfaces.obj", 3, 1),
        ("negative_indices.obj", 12, 6),
        ("Duck.glb", 4212, 0),
        ("BoxTextured.glb", 12, 0),
        ("featuretype.STL", 3476, 0),
        ("featuretype.ply", 3476, 0),
        ("cube_blender_uv.ply", 12, 6),
    ];
    have_sizes(&folder, &cases);
}

fn have_sizes(folder: &Path, cases: &[(&str, usize, u64)]) {
    for &(name, triangles, polygons) in cases {
        let mesh = read(&std::fs::read(folder.join(name)).unwrap()).unwrap();
        let by_arity = mesh.report.polygons_by_arity;
        assert_eq!((mesh.triangles.len(), by_arity[4..].iter().sum::<u64>()), (triangles, polygons), "{name}");
    }
}

/// Hundreds of odd and broken files: none may panic or cost much, and the answer is typed.
#[test]
fn the_corpus_is_survived() {
    let (mut seen, mut imported) = (0, 0);
    for path in files(&data::folder("corpus")) {
        let bytes = std::fs::read(&path).unwrap();
        let result = within_bytes(16 << 20, &path.display().to_string(), || read(&bytes));
        println!("{}: {:?}", path.display(), result.as_ref().map(|m| m.triangles.len()).map_err(ToString::to_string));
        seen += 1;
        imported += usize::from(result.is_ok());
    }
    assert_eq!(seen, 299);
    assert_eq!(imported, 49);
}
