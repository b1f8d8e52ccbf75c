//! Processes in which decoders written in C read strangers' files. Each is another run of this program, which gives up
//! all rights before its first byte of a file ([`confine`]), and reads one file: what takes it over sees no other.
//!
//! [`pool`] starts them ahead of their jobs, hands each its file, and says why one ended. [`child`] is what they run.

mod child;
mod confine;
mod message;
mod pool;

pub use child::run;
pub use pool::Pool;

/// The argument that makes a run of this program such a process.
pub const ARGUMENT: &str = "decode-one-file-in-a-sandbox";
