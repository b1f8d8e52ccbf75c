//! The truth about a picture, in f64, to measure the renderers by. It shares no code with `src/`,
//! so that a reader can trust it from its own files alone.
//!
//! The truth: a pixel is a unit square with a box filter, its upper left corner at its column and
//! row, y down. A line is the set of points within half its width, on screen, of the visible part
//! of an edge: caps and joins are round, and on a silhouette the outer half is drawn too. An edge
//! is visible where no surface that is not incident to it lies in front.
//!
//! It has five parts. `tests/suite/accuracy/oracle_*.rs` check 1 to 3 against each other and
//! against known values, and light and FLIP against known values.
//! 1. [`coverage`]: which pixels a snapped triangle covers, by exact integer signs, and how much of
//!    each.
//! 2. [`lines::strip`] and [`lines::capsule`]: straight lines in closed form.
//! 3. Any scene: [`screen`] has its triangles, [`surface::visible`] the visible parts of its edges.
//!    [`lines::coverage`], [`surface::rays`] and [`lines::silhouette`] use many points per pixel.
//! 4. [`surface::light`]: the colour of a lit surface; [`surface::surroundings`]: what metals
//!    mirror; [`surface::occlusion`]: the light that hollows lose; [`surface::texture`]: the mean
//!    of a texture over a pixel.
//! 5. [`flip`]: how different two pictures look.
//!
//! And of a mesh: [`contacts`], which triangles intersect.

// Each binary that includes this module uses its own part of it.
#![allow(dead_code)]

pub mod camera;
pub mod contacts;
pub mod coverage;
pub mod flip;
pub mod lattice;
pub mod lines;
pub mod obj;
pub mod polygon;
pub mod screen;
pub mod surface;
pub mod vector;
