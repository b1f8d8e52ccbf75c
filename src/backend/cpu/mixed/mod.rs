//! Stage mixed, per pixel, of plans with adaptive samples: pixels near which faces meet that differ in
//! colour are drawn again, from 256 coverage points each.
//!
//! [`look`] says what decides the colour of a face, [`find`] which pixels are mixed, [`points`] what each
//! point of a pixel sees, and [`draw`] runs them for a band.
//! Only the CPU has this stage.

pub(crate) mod draw;
pub(crate) mod find;
pub(crate) mod look;
pub(crate) mod points;
