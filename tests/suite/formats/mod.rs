//! Every format that is read: what a file becomes, and which files are refused.

pub mod bundles;
pub mod fbx;
pub mod gltf;
pub mod lines_and_points;
pub mod obj;
pub mod off;
pub mod ply;
pub mod real_files;
pub mod refused;
pub mod report;
pub mod same_shape;
pub mod stl;
pub mod three_mf;
