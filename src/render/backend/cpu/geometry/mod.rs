//! The stages transform and visibility: from vertices to the nearest triangle of each sample. A
//! sample is one of the 1 to 16 places in a pixel at which the picture is computed.
//!
//! - [`transform`] moves vertices to screen coordinates, which are rounded to 1/256 px.
//! - [`clip`] cuts off what reaches behind the near plane, or far outside the picture.
//! - [`visibility`] finds the samples that a triangle covers, [`batch`] does so for many triangles.
//!   [`setups`] prepares these eight at a time.
//! - [`nearest`] keeps the nearest triangle of each sample in the buffer of [`samples`].
//! - [`tiles`] hold the farthest depth in each square of pixels, to find triangles that are hidden
//!   there.
//! - [`steepness`] tells how fast a triangle's depth changes on screen.
//!
//! Integers and single roundings decide everything here, so that both back-ends agree on every
//! sample. Twins are in `shaders/geometry/`.

pub(crate) mod batch;
pub(crate) mod clip;
pub(crate) mod nearest;
pub(crate) mod samples;
pub(crate) mod setups;
pub(crate) mod steepness;
pub(crate) mod tiles;
pub(crate) mod transform;
pub(crate) mod visibility;
