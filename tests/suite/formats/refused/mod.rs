//! Files that are broken or made to cost a lot, in every format.

pub mod bad;
pub mod costly;
pub mod limits;
