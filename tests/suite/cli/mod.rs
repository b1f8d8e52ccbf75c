//! The command line.

pub mod batch;
pub mod check;
pub mod commands;
pub mod help;
pub mod mistakes;
pub mod outputs;
pub mod reports;
pub mod watch;
