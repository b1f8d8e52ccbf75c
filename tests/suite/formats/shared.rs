//! Real files, where the shared test data is at hand.

use crate::support::mesh_files::read;
use crate::support::shared::{files, folder};
use meshsnap::import::MeshFault;
use std::path::Path;
use std::time::{Duration, Instant};

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

#[test]
fn all_models_import() {
    let Some(folder) = folder("models") else { return };
    let mut imported = 0;
    let mut refused = Vec::new();
    for path in files(&folder) {
        if !["obj", "stl", "ply", "off", "glb", "gltf"].contains(&extension(&path).as_str()) {
            continue;
        }
        let name = path.strip_prefix(&folder).unwrap().to_string_lossy().into_owned();
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
    // In several files.
    let expected = [
        ("BoxDraco/BoxDraco.gltf", MeshFault::OutsideBundle),
        ("PalmTree/PalmTree.gltf", MeshFault::OutsideBundle),
        ("meshopt-fallback/meshopt-fallback.gltf", MeshFault::OutsideBundle),
        ("meshopt-no-fallback/meshopt-no-fallback.gltf", MeshFault::OutsideBundle),
    ];
    let refused: Vec<(&str, MeshFault)> = refused.iter().map(|(n, e)| (n.as_str(), e.fault.clone())).collect();
    assert_eq!(refused, expected);
    assert_eq!(imported, 38);
}

#[test]
fn known_models_have_their_known_sizes() {
    let Some(folder) = folder("models") else { return };
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
    for (name, triangles, polygons) in cases {
        let mesh = read(&std::fs::read(folder.join(name)).unwrap()).unwrap();
        let by_arity = mesh.report.polygons_by_arity;
        assert_eq!((mesh.triangles.len(), by_arity[4..].iter().sum::<u64>()), (triangles, polygons), "{name}");
    }
}

/// Hundreds of odd and broken files: none may panic or take long, and whatever it is called, the answer is typed.
#[test]
fn the_corpus_is_survived() {
    let Some(folder) = folder("corpus") else { return };
    let (mut seen, mut imported) = (0, 0);
    for path in files(&folder) {
        let bytes = std::fs::read(&path).unwrap();
        let start = Instant::now();
        let result = read(&bytes);
        assert!(start.elapsed() < Duration::from_secs(1), "{}", path.display());
        println!("{}: {:?}", path.display(), result.as_ref().map(|m| m.triangles.len()).map_err(ToString::to_string));
        seen += 1;
        imported += usize::from(result.is_ok());
    }
    assert_eq!(seen, 299);
    assert_eq!(imported, 49);
}
