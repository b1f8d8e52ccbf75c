//! Lines: the share of each pixel that they cover.

pub mod capsule;
pub mod coverage;
pub mod silhouette;
pub mod strip;
