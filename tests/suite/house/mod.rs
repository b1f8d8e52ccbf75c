//! Rules that the source itself keeps.

mod deploy;
mod documents;
mod library;
pub mod structure;
mod systems;
