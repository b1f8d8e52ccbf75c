//! Stage shade for transparent surfaces: depth peeling.
//!
//! Each round, [`emit_layer`] finds the next layer of every sample with the triangles of the stage
//! visibility, and [`composite`] shades it under the layers in front. [`state`] is what a sample
//! keeps from round to round, and [`tints`] the tint that lines behind layers take. Twins are in `shaders/peeling/`.

pub(crate) mod composite;
pub(crate) mod emit_layer;
pub(crate) mod state;
pub(crate) mod tints;
