//! TODO room.

pub(crate) mod composite;
pub(crate) mod emit_layer;
pub(crate) mod state;
