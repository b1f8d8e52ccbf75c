//! The binary data of a glTF file: buffers and their views, decompression, accessors (typed arrays
//! in a view) and the rules for their types.

pub(crate) mod accessor;
pub(crate) mod attribute;
pub(crate) mod buffers;
#[cfg_attr(not(feature = "meshopt"), path = "meshopt_absent.rs")]
pub(crate) mod meshopt;
#[cfg(all(feature = "meshopt", feature = "isolate"))]
pub(crate) mod meshopt_apart;
#[cfg(feature = "meshopt")]
pub(crate) mod meshopt_filters;
