//! Surfaces: what is seen of them, and its colour.

pub mod light;
pub mod occlusion;
pub mod rays;
pub mod srgb;
pub mod surroundings;
pub mod texture;
pub mod visible;
