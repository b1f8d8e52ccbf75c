//! GPU against CPU, stage by stage.

pub mod flat;
mod gangs;
pub mod pictures;
pub mod shade;
pub mod visibility;
