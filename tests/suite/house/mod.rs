//! Rules that the source itself keeps.

mod deploy;
pub mod structure;
mod systems;
