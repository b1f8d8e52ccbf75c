//! The truth about a picture, in f64, to measure the renderers by. It shares no code with `src/`: who trusts it has only to
//! read it.
//!
//! What is true: a pixel is a unit square with a box filter, its upper left corner at its column and row, y down. A line is
//! the set of points within half its width, on screen, of the visible part of an edge: caps and joins are round, and on a
//! silhouette the outer half is drawn too. An edge is visible where no surface that is not incident to it lies in front.
//!
//! Five parts, each checked against the others by `tests/suite/oracle_*.rs`:
//! 1. [`coverage`]: which pixels a snapped triangle covers, by exact integer signs, and how much of each.
//! 2. [`strip`] and [`capsule`]: straight lines in closed form.
//! 3. [`screen`], [`visible`], [`ink`], [`rays`], [`rim`]: any scene, by many points a pixel.
//! 4. [`light`]: the colour of a lit surface.
//! 5. [`flip`]: how different two pictures look.

// Each binary that includes this module uses its own part of it.
#![allow(dead_code)]

pub mod camera;
pub mod capsule;
pub mod coverage;
pub mod flip;
pub mod ink;
pub mod lattice;
pub mod light;
pub mod obj;
pub mod polygon;
pub mod rays;
pub mod rim;
pub mod screen;
pub mod srgb;
pub mod strip;
pub mod vector;
pub mod visible;
