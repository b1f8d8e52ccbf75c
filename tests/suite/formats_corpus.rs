//! Agreement with the Khronos glTF validator, on its own test files, where the shared test data is at hand.

use crate::shared::{files, folder};
use meshsnap::limits::{Budget, Deadline, Limits};
use meshsnap::mesh::{Bundle, BundleFile, FileContent, Format, ImportReport, MeshError, MeshFault, import, survey};
use serde_json::Value;
use std::path::Path;

/// Files that the validator calls broken and that are read all the same, and why.
const READ_ALL_THE_SAME: &[(&str, &str)] = &[
    ("accessor_data/invalid_elements_float.gltf", UNUSED),
    ("accessor_data/out_of_range_elements_float.gltf", BOUNDS),
    ("accessor_data/out_of_range_elements_sint16.gltf", BOUNDS),
    ("accessor_data/out_of_range_elements_sint8.gltf", BOUNDS),
    ("accessor_data/out_of_range_elements_uint16.gltf", BOUNDS),
    ("accessor_data/out_of_range_elements_uint32.gltf", BOUNDS),
    ("accessor_data/out_of_range_elements_uint8.gltf", BOUNDS),
    ("buffer_view/empty_array.gltf", EMPTY),
    ("buffer_view/invalid_stride_wrong_target.gltf", HINT),
    ("buffer_view/zero_bytelength.gltf", UNUSED),
    ("json/bom.gltf", BOM),
    ("material/empty_array.gltf", EMPTY),
    ("material/unresolved_basecolor.gltf", UNUSED),
    ("material/unresolved_emissive.gltf", UNUSED),
    ("material/unresolved_mr.gltf", UNUSED),
    ("material/unresolved_normal.gltf", UNUSED),
    ("material/unresolved_occlusion.gltf", UNUSED),
    ("mesh/accessor_attribute_uint32.gltf", UNUSED),
    ("mesh/empty_array.gltf", EMPTY),
    ("mesh/invalid_attribute.gltf", UNUSED),
    ("mesh/invalid_attribute_escaped_name.gltf", UNUSED),
    ("mesh/invalid_indexed_attribute.gltf", UNUSED),
    ("mesh/morph_position_accessor_no_bounds.gltf", BOUNDS),
    ("mesh/position_accessor_no_bounds.gltf", BOUNDS),
    ("mesh/uv.gltf", UVS),
    ("node/empty_array.gltf", EMPTY),
    ("node/empty_children_array.gltf", EMPTY),
    ("node/matrix_indecomposable.gltf", SHEAR),
    ("node/node_parent_override.gltf", PARENTS),
    ("node/rotation_non_unit.gltf", LENGTH),
    ("node/skin_with_no_mesh.gltf", UNUSED),
    ("node/unresolved_camera.gltf", CAMERA),
    ("node/weights_with_no_mesh.gltf", UNUSED),
    ("texture/empty_array.gltf", EMPTY),
    ("texture/unresolved_sampler.gltf", UNUSED),
    ("texture/unresolved_source.gltf", UNUSED),
];

const BOUNDS: &str = "accessor bounds are not read: the data itself is";
const EMPTY: &str = "an empty list says the same as none, and exporters write it";
const UNUSED: &str = "nothing that is drawn uses the broken part";
const HINT: &str = "targets of buffer views are hints that are not read";
const BOM: &str = "a byte order mark is passed over, as RFC 8259 allows readers to";
const UVS: &str = "a texture without its coordinates is left out, and a warning says so";
const SHEAR: &str = "a sheared matrix is drawn as it is";
const PARENTS: &str = "a node with two parents is drawn below both";
const LENGTH: &str = "a quaternion of any length but 0 says how to turn; exporters round";
const CAMERA: &str = "a camera that is not there is left out, and a warning says so";

/// A glTF file and what lies beside it.
fn bundle(path: &Path) -> Bundle {
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    let beside = files(path.parent().unwrap()).into_iter().filter(|p| p.extension().is_some_and(|e| e == "bin"));
    let files = beside.chain([path.to_path_buf()]);
    let files = files.map(|p| BundleFile::new(&name(&p), std::fs::read(&p).unwrap()).unwrap()).collect();
    Bundle::of_files(files).with_entry(Some(name(path)))
}

fn survey_of(bundle: &Bundle) -> Result<ImportReport, MeshError> {
    let limits = Limits::default();
    survey(bundle, Some(Format::Gltf), &limits, &mut Budget::new(&limits), &Deadline::default())
}

#[test]
fn the_validator_and_the_importer_agree() {
    let Some(folder) = folder("corpus/gltf-validator") else { return };
    let (mut table, mut faults, mut listed) = ([[0; 2]; 2], Vec::new(), 0);
    for path in files(&folder).into_iter().filter(|path| path.extension().is_some_and(|e| e == "gltf")) {
        let name = path.strip_prefix(&folder).unwrap().to_string_lossy().into_owned();
        let report: Value =
            serde_json::from_slice(&std::fs::read(format!("{}.report.json", path.display())).unwrap()).unwrap();
        let is_valid = report["issues"]["numErrors"] == 0;
        let bundle = bundle(&path);
        let result = survey_of(&bundle);
        table[usize::from(!is_valid)][usize::from(result.is_err())] += 1;
        println!(
            "{name}: valid {is_valid}, {}",
            result.as_ref().map_or_else(ToString::to_string, |r| format!("{:?}", r.content))
        );
        let tolerated = READ_ALL_THE_SAME.iter().find(|(known, _)| *known == name);
        if let Some((_, why)) = tolerated {
            println!("    although it is broken: {why}");
            listed += 1;
        }
        match (&result, is_valid, tolerated) {
            (Ok(report_of), true, None) => check_counts(&name, &report, report_of.content, &mut faults),
            (Err(_), false, None) | (Ok(_), false, Some(_)) => {}
            (Ok(_), false, None) => faults.push(format!("{name} is broken, and was read")),
            (Err(error), true, _) => faults.push(format!("{name} is valid, and was refused: {error}")),
            (_, _, Some(_)) => faults.push(format!("{name} is listed, and there is no disagreement about it")),
        }
        // Whatever can be read can be drawn, or has nothing to draw.
        if let (Ok(_), Err(error)) = (&result, drawn(&bundle)) {
            assert_eq!(error.fault, MeshFault::Empty, "{name}: {error}");
        }
    }
    let [[valid_read, valid_refused], [broken_read, broken_refused]] = table;
    println!(
        "            read  refused\nvalid   {valid_read:8} {valid_refused:8}\nbroken  {broken_read:8} {broken_refused:8}"
    );
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert_eq!(listed, READ_ALL_THE_SAME.len(), "every listed file is there");
    assert_eq!(table.iter().flatten().sum::<i32>(), 97);
}

fn drawn(bundle: &Bundle) -> Result<(), MeshError> {
    let limits = Limits::default();
    import(bundle, Some(Format::Gltf), &limits, &mut Budget::new(&limits), &Deadline::default()).map(|_| ())
}

fn check_counts(name: &str, report: &Value, content: FileContent, faults: &mut Vec<String>) {
    let info = &report["info"];
    let theirs = ["drawCallCount", "totalVertexCount", "totalTriangleCount"].map(|key| info[key].as_u64());
    let ours = [content.draw_calls, content.vertices, content.triangles].map(Some);
    if theirs != ours {
        faults.push(format!("{name} has {ours:?}, and the validator counts {theirs:?}"));
    }
}
