//! Rules that the source itself keeps.

pub mod structure;
mod systems;
