//! The command line.

pub mod commands;
pub mod outputs;
