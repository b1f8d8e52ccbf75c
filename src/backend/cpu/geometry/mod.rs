//! Stages transform and visibility: from vertices to the nearest triangle of each sample.
//!
//! [`transform`] moves vertices to snapped screen coordinates, [`clip`] cuts what reaches behind
//! the eye, [`visibility`] finds the samples of a triangle, and [`nearest`] keeps the nearest of
//! them in the buffer of [`samples`]. Integers and single roundings decide everything here, so that
//! both back-ends agree on every sample. Twins are in `shaders/geometry/`.

pub(crate) mod clip;
pub(crate) mod nearest;
pub(crate) mod samples;
pub(crate) mod transform;
pub(crate) mod visibility;
