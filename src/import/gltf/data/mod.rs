//! TODO room.

pub(crate) mod accessor;
pub(crate) mod attribute;
pub(crate) mod buffers;
pub(crate) mod meshopt;
pub(crate) mod meshopt_filters;
