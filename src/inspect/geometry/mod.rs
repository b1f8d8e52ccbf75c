//! Questions about a mesh that drawing does not ask: which faces intersect, how far surfaces are apart, how thick walls are,
//! how a texture is laid out.

pub mod charts;
pub mod intersections;
pub mod measure;
pub mod nearest;
pub mod thickness;
