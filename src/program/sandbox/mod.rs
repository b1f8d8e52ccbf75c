//! The sandbox: processes in which decoders written in C or C++ read files that may be hostile. Each
//! is another run of this program. It gives up its rights before the first byte of a file
//! ([`confine`]), and reads one file: if that file takes it over, it sees no other file.
//!
//! [`pool`] starts the processes (on a server ahead of their jobs), hands each its file, and says
//! why one ended. [`child`] is what they run.

mod child;
mod confine;
mod message;
mod pool;

pub use child::run;
pub use pool::Pool;

/// The argument that makes a run of this program such a process.
pub const ARGUMENT: &str = "decode-one-file-in-a-sandbox";
