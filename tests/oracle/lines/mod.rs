//! Lines: how much of each pixel they cover.

pub mod capsule;
pub mod coverage;
pub mod silhouette;
pub mod strip;
