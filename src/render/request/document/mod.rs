//! Requests as they are sent: JSON documents and dotted keys, flattened to one list of items.

pub(crate) mod dotted;
pub(crate) mod duplicate_keys;
pub(crate) mod item;
pub(crate) mod json;
pub(crate) mod mesh_reference;
pub(crate) mod unique_keys;
