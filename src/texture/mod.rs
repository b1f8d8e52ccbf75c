//! TODO room.

pub(crate) mod basis;
pub(crate) mod decode;
pub(crate) mod half;
pub(crate) mod mips;
pub(crate) mod png;
