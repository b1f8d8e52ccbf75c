//! Several files that belong together: forms, archives, folders.

pub mod names;
pub mod program;
pub mod zip;
