//! GPU against CPU, stage by stage.

pub mod flat;
mod gangs;
mod linear;
pub mod pictures;
pub mod shade;
mod shared_pixels;
pub mod visibility;
