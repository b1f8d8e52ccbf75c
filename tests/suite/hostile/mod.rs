//! Bytes that were made to do harm.

pub mod bombs;
pub mod cut;
pub mod fuzzed;
pub mod panics;
pub mod sandbox;
