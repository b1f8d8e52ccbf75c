//! Geometry of a mesh for reports, rules and comparisons: which faces intersect, how far surfaces are apart, how
//! large area and volume are, how thick walls are, how a texture is laid out.

pub mod charts;
pub mod intersections;
pub mod measure;
pub mod nearest;
pub mod thickness;
