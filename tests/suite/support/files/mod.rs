//! Mesh files of many formats: made from one description, packed, damaged, or built to be costly.

pub mod archive;
pub mod bombs;
pub mod bundle;
pub mod damage;
pub mod fbx;
pub mod mesh;
pub mod ply;
pub mod same;
