//! GPU against CPU, stage by stage.

pub mod flat;
mod gangs;
mod lent;
pub mod pictures;
pub mod shade;
pub mod visibility;
