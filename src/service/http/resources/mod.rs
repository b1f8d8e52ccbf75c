//! TODO room.

pub(crate) mod capabilities;
pub(crate) mod health;
pub(crate) mod jobs;
pub(crate) mod meshes;
pub(crate) mod pictures;
pub(crate) mod render;
pub(crate) mod schema;
