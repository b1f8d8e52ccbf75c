//! Rules that the source itself keeps.

pub mod structure;
