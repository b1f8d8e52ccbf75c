//! GPU against CPU, stage by stage.

pub mod flat;
pub mod pictures;
pub mod shade;
pub mod visibility;
