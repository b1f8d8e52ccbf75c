//! Every format that is read: what becomes of a file, and which files are refused.

pub mod agreement;
pub mod bad;
pub mod bundles;
pub mod corpus;
pub mod costly;
pub mod fbx;
pub mod fbx_scene;
pub mod gltf;
pub mod hostile;
pub mod lines_and_points;
pub mod mtl;
pub mod obj;
pub mod obj_wild;
pub mod off;
pub mod ply;
pub mod polygons;
pub mod report;
pub mod same_shape;
pub mod shared;
pub mod stl;
pub mod three_mf;
