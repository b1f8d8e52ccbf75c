//! TODO room.

pub mod camera;
pub(crate) mod material_groups;
