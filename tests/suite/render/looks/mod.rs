//! How pictures look by default; and backgrounds, the ground's shadow and the style `xray`.

pub mod backgrounds;
pub mod defaults;
pub mod first_sight;
pub mod ground;
pub mod xray;
