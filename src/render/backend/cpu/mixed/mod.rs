//! Stage mixed, per pixel, of plans with adaptive samples: pixels near which faces meet that differ in
//! colour are drawn again, from 64 or 256 coverage points each.
//!
//! [`find`] says which pixels are mixed, by what decides the colours of their faces ([`find::look`]). [`lists`] has the
//! triangles that each may show, of those of the band ([`band_triangles`]). [`points`] has the points of a pixel,
//! [`triangle`] says which of them a triangle covers, [`faces`] and [`crowd`] which face each sees, [`shares`] and
//! [`color`] what colour that makes. [`thinness`] is the test for triangles that samples miss. [`draw`] runs all for a
//! band.

pub(crate) mod band_triangles;
mod color;
mod crowd;
pub(crate) mod draw;
mod faces;
pub(crate) mod find;
pub(crate) mod lists;
pub(crate) mod points;
mod recent;
mod shares;
mod spans;
pub(crate) mod thinness;
pub(crate) mod triangle;
