//! Stages transform and visibility: from vertices to the nearest triangle of each sample.
//!
//! [`transform`] moves vertices to snapped screen coordinates, [`clip`] cuts what reaches behind
//! the eye, [`visibility`] finds the samples of a triangle ([`batch`] those of eight small ones), and
//! [`nearest`] keeps the nearest of them in the buffer of [`samples`]. [`tiles`] tell what lies
//! behind them, [`steepness`] how fast depth changes. Integers and single roundings decide everything here, so that
//! both back-ends agree on every sample. Twins are in `shaders/geometry/`.

pub(crate) mod batch;
pub(crate) mod clip;
pub(crate) mod nearest;
pub(crate) mod samples;
pub(crate) mod setups;
pub(crate) mod steepness;
pub(crate) mod tiles;
pub(crate) mod transform;
pub(crate) mod visibility;
