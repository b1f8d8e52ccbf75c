//! Line and point primitives of the file, which have no area.
//!
//! Those whose material has a filled surface are triangles that face the camera and are shaded with
//! the surface ([`geometry`]). The others are lines of exact width in pixels ([`line_passes`]) if
//! their material has a wire or an outline, and are not drawn if it has neither.

pub mod depth_cue;
mod lines;
mod triangles;

pub use lines::line_passes;
pub use triangles::geometry;

use crate::mesh::LineOrPoint;
use crate::scene::{Fill, MaterialGroups};

/// True if a primitive is drawn as triangles.
pub fn is_filled(groups: &MaterialGroups<'_>, primitive: &LineOrPoint) -> bool {
    groups.fill(primitive.material as usize) != Fill::None
}

/// True if a primitive is drawn as a line.
pub fn is_line(groups: &MaterialGroups<'_>, primitive: &LineOrPoint) -> bool {
    let layers = groups.by_material.get(primitive.material as usize);
    layers.is_some_and(|layers| layers.wire.is_some() || layers.outline.is_some()) && !is_filled(groups, primitive)
}

#[cfg(test)]
mod tests;
