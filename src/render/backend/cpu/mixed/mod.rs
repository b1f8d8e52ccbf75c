//! The stage mixed, for plans with adaptive samples. Pixels near which faces of different colours
//! meet are called mixed. They are drawn a second time, from 64 or 256 points each instead of the
//! few samples that all pixels have.
//!
//! [`draw`] runs these steps for a band, a range of pixel rows:
//!
//! 1. [`find`] finds the mixed pixels. It compares the looks of their faces, which is what decides
//!    colours ([`find::look`]), and adds pixels with triangles so thin that samples miss them
//!    ([`find::thin`]; [`thinness`] tells which triangles these are).
//! 2. [`lists`] lists the triangles of the band ([`band_triangles`]) that may be visible in each of
//!    these pixels.
//! 3. [`triangle`] finds the points of the pixel that a triangle covers. [`points`] defines the
//!    points.
//! 4. [`faces`] finds the nearest face at each point. [`crowd`] does so for pixels with many faces.
//! 5. [`color`] shades each of these faces, and sums their colours by their [`shares`] of the
//!    points.

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
