//! Rules that the source itself keeps.

mod deploy;
mod documents;
pub mod structure;
mod systems;
