//! What a request adds around the surface, and how it shows it.

pub mod backgrounds;
pub mod defaults;
pub mod first_sight;
pub mod ground;
pub mod xray;
