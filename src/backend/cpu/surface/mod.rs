//! TODO room.

pub(crate) mod barycentric;
pub(crate) mod debug;
pub(crate) mod light;
pub(crate) mod normal;
pub(crate) mod point;
pub(crate) mod shade;
pub(crate) mod texture;
pub(crate) mod wire;
