//! Binary data: buffers and their views, decompression, accessors and the rules for attributes.

pub(crate) mod accessor;
pub(crate) mod attribute;
pub(crate) mod buffers;
#[cfg_attr(not(feature = "meshopt"), path = "meshopt_absent.rs")]
pub(crate) mod meshopt;
#[cfg(all(feature = "meshopt", feature = "isolate"))]
pub(crate) mod meshopt_apart;
#[cfg(feature = "meshopt")]
pub(crate) mod meshopt_filters;
