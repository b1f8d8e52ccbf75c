//! GPU against CPU, stage by stage.

pub mod flat;
mod gangs;
pub mod pictures;
pub mod shade;
mod shared_pixels;
pub mod visibility;
