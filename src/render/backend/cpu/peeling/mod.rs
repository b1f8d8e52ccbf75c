//! Depth peeling, by which transparent surfaces are drawn: it finds their layers at each sample from front to back
//! (stage peeling).
//!
//! Each round, [`emit_layer`] finds the next layer of every sample, and [`composite`] shades it under the layers in
//! front. [`state`] is what a sample keeps from round to round, and [`tints`] is the colour that layers give to the
//! lines behind them. Twins are in `shaders/peeling/`.

pub(crate) mod composite;
pub(crate) mod emit_layer;
pub(crate) mod state;
pub(crate) mod tints;
