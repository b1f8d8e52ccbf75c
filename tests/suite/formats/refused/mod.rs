//! Files that are broken or made to cost a lot, in several formats. The folders of the formats have
//! more.

pub mod bad;
pub mod costly;
pub mod limits;
