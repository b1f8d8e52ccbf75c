//! The exceptions of `agreement.rs`, one line for each with its reason: files on which meshsnap and
//! the validator disagree, and files that are refused though no validator speaks of them.
//! `agreement.rs` holds that there are no others, and that none of these is out of date.

/// Files that the validator calls broken and that are read all the same; that are valid, and
/// refused; that are refused, though no validator speaks of them.
pub const EXPLAINED: &[(&str, &str)] = &[
    ("corpus/emptyIO/obj_empty.obj", COMMENTS),
    ("corpus/emptyIO/obj_points.obj", VERTICES),
    ("corpus/emptyIO/ply_empty_ascii.ply", NO_FACES),
    ("corpus/emptyIO/ply_empty_bin.ply", NO_FACES),
    ("corpus/emptyIO/ply_empty_header.ply", NO_FACES),
    ("corpus/emptyIO/stl_empty_ascii.stl", NO_FACES),
    ("corpus/emptyIO/stl_empty_bin.stl", NO_FACES),
    ("corpus/gltf-validator/accessor_data/get_elements.gltf", NOTHING),
    ("corpus/gltf-validator/accessor_data/get_elements_matrix.gltf", NOTHING),
    ("corpus/gltf-validator/accessor_data/get_elements_sparse.gltf", NOTHING),
    ("corpus/gltf-validator/accessor_data/invalid_elements_float.gltf", UNUSED),
    ("corpus/gltf-validator/accessor_data/out_of_range_elements_float.gltf", BOUNDS),
    ("corpus/gltf-validator/accessor_data/out_of_range_elements_sint16.gltf", BOUNDS),
    ("corpus/gltf-validator/accessor_data/out_of_range_elements_sint8.gltf", BOUNDS),
    ("corpus/gltf-validator/accessor_data/out_of_range_elements_uint16.gltf", BOUNDS),
    ("corpus/gltf-validator/accessor_data/out_of_range_elements_uint32.gltf", BOUNDS),
    ("corpus/gltf-validator/accessor_data/out_of_range_elements_uint8.gltf", BOUNDS),
    ("corpus/gltf-validator/buffer_view/custom_property.gltf", NOTHING),
    ("corpus/gltf-validator/buffer_view/empty_array.gltf", EMPTY),
    ("corpus/gltf-validator/buffer_view/invalid_stride_wrong_target.gltf", HINT),
    ("corpus/gltf-validator/buffer_view/valid.gltf", NOTHING),
    ("corpus/gltf-validator/buffer_view/zero_bytelength.gltf", UNUSED),
    ("corpus/gltf-validator/json/bom.gltf", BOM),
    ("corpus/gltf-validator/json/empty_file.gltf", NO_BYTES),
    ("corpus/gltf-validator/json/integer_written_as_float.gltf", UNSHOWN),
    ("corpus/gltf-validator/material/alpha_modes.gltf", NOTHING),
    ("corpus/gltf-validator/material/custom_property.gltf", NOTHING),
    ("corpus/gltf-validator/material/empty_array.gltf", EMPTY),
    ("corpus/gltf-validator/material/empty_object.gltf", NOTHING),
    ("corpus/gltf-validator/material/multiple_extensions.gltf", NOTHING),
    ("corpus/gltf-validator/material/unresolved_basecolor.gltf", UNUSED),
    ("corpus/gltf-validator/material/unresolved_emissive.gltf", UNUSED),
    ("corpus/gltf-validator/material/unresolved_mr.gltf", UNUSED),
    ("corpus/gltf-validator/material/unresolved_normal.gltf", UNUSED),
    ("corpus/gltf-validator/material/unresolved_occlusion.gltf", UNUSED),
    ("corpus/gltf-validator/material/valid.gltf", NOTHING),
    ("corpus/gltf-validator/mesh/accessor_attribute_uint32.gltf", UNUSED),
    ("corpus/gltf-validator/mesh/custom_property.gltf", ZEROS),
    ("corpus/gltf-validator/mesh/empty_array.gltf", EMPTY),
    ("corpus/gltf-validator/mesh/invalid_attribute.gltf", UNUSED),
    ("corpus/gltf-validator/mesh/invalid_attribute_escaped_name.gltf", UNUSED),
    ("corpus/gltf-validator/mesh/invalid_indexed_attribute.gltf", UNUSED),
    ("corpus/gltf-validator/mesh/morph_position_accessor_no_bounds.gltf", BOUNDS),
    ("corpus/gltf-validator/mesh/position_accessor_no_bounds.gltf", BOUNDS),
    ("corpus/gltf-validator/mesh/primitive_generated_tangent_space.gltf", ZEROS),
    ("corpus/gltf-validator/mesh/primitive_incompatible_mode.gltf", ZEROS),
    ("corpus/gltf-validator/mesh/primitive_no_position.gltf", NO_POSITION),
    ("corpus/gltf-validator/mesh/uv.gltf", UVS),
    ("corpus/gltf-validator/mesh/valid.gltf", ZEROS),
    ("corpus/gltf-validator/node/custom_property.gltf", NOTHING),
    ("corpus/gltf-validator/node/empty_array.gltf", EMPTY),
    ("corpus/gltf-validator/node/empty_children_array.gltf", EMPTY),
    ("corpus/gltf-validator/node/matrix_default.gltf", NOTHING),
    ("corpus/gltf-validator/node/matrix_indecomposable.gltf", SHEAR),
    ("corpus/gltf-validator/node/node_empty.gltf", NOTHING),
    ("corpus/gltf-validator/node/node_parent_override.gltf", PARENTS),
    ("corpus/gltf-validator/node/node_skinned_mesh_without_skin.gltf", ZEROS),
    ("corpus/gltf-validator/node/node_weights_override.gltf", ZEROS),
    ("corpus/gltf-validator/node/rotation_non_unit.gltf", LENGTH),
    ("corpus/gltf-validator/node/skin_with_no_mesh.gltf", UNUSED),
    ("corpus/gltf-validator/node/unresolved_camera.gltf", CAMERA),
    ("corpus/gltf-validator/node/valid.gltf", ZEROS),
    ("corpus/gltf-validator/node/weights_with_no_mesh.gltf", UNUSED),
    ("corpus/gltf-validator/texture/custom_property.gltf", NOTHING),
    ("corpus/gltf-validator/texture/empty_array.gltf", EMPTY),
    ("corpus/gltf-validator/texture/empty_object.gltf", NOTHING),
    ("corpus/gltf-validator/texture/unresolved_sampler.gltf", UNUSED),
    ("corpus/gltf-validator/texture/unresolved_source.gltf", UNUSED),
    ("corpus/gltf-validator/texture/valid.gltf", NOTHING),
    ("corpus/gltf/BoundsChecking/integer-out-of-bounds.gltf", INTEGER),
    ("corpus/gltf/BoundsChecking/invalid-buffer-index.gltf", BEYOND),
    ("corpus/gltf/BoundsChecking/invalid-buffer-view-index.gltf", BEYOND),
    ("corpus/gltf/BoundsChecking/invalid-primitive-indices.gltf", BEYOND),
    ("corpus/obj/clusterfuzz-testcase-minimized-fuzz_ParseFromString-4877060179886080", FRAGMENT),
    ("corpus/obj/invalid-face-definition.obj", CORNERS),
    ("corpus/obj/invalid-relative-texture-index.obj", BEYOND),
    ("corpus/obj/invalid-relative-vertex-index.obj", BEYOND),
    ("corpus/obj/issue-140-zero-face-idx.obj", ZERO),
    ("corpus/obj/issue-356-leading-spaces-newmtl.obj", MATERIALS),
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

const NOTHING: &str = "valid, and there is no mesh in it to draw";
const ZEROS: &str = "valid, and all vertices are in one place: accessors without data are zeros";
const NO_POSITION: &str = "valid, and its only primitive has no positions to draw";
const UNSHOWN: &str = "valid, and none of its nodes shows its mesh";
const NO_BYTES: &str = "not one byte: nothing that any reader could take for glTF";
const NO_FACES: &str = "well formed, and without a face, line or point to draw";
const VERTICES: &str = "vertices alone: nothing says that they are points (`p`)";
const COMMENTS: &str = "comments alone: nothing in it says that it is OBJ";
const INTEGER: &str = "a length of 1e300 bytes, which is no integer that a file may have";
const BEYOND: &str = "an index that leads beyond what there is";
const FRAGMENT: &str = "a fuzzer's fragment of one line, which is no vertex";
const CORNERS: &str = "its faces have one and two corners";
const ZERO: &str = "faces use index 0, and OBJ counts from 1";
const MATERIALS: &str = "names a material and nothing else: nothing in it says that it is OBJ";

/// Files whose pictures of CPU and GPU differ by more than twins may, and why.
pub const UNLIKE: &[(&str, &str)] = &[];
