//! Surfaces: the visible parts of edges, the pictures that scenes should have, and the colours of
//! what is seen.

pub mod light;
pub mod occlusion;
pub mod rays;
pub mod srgb;
pub mod surroundings;
pub mod texture;
pub mod visible;
