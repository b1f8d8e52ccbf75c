//! The command line.

pub mod baseline;
pub mod batch;
pub mod check;
pub mod commands;
pub mod diff;
mod documents;
pub mod help;
pub mod mistakes;
pub mod outputs;
pub mod recipes;
pub mod reports;
mod repository;
pub mod watch;
