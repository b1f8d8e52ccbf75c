//! Files that other programs wrote: read, and compared with what other readers say of them.

pub mod agreement;
pub mod explained;
pub mod models;
pub mod second_opinions;
