//! PLY.

pub mod bad;
pub mod hostile;
pub mod properties;
pub mod surfaces;
