//! glTF, JSON and GLB.

pub mod basics;
pub mod document;
pub mod instances;
pub mod packed;
pub mod packed_bad;
pub mod pose;
pub mod scene;
pub mod surfaces;
