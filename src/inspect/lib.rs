//! Statements about meshes: the [`report`] on one, its [`check`] by rules, and the [`diff`] of two.
//!
//! [`opened`] has the files that are judged or compared, and the pictures of what was found. [`geometry`] has what they
//! compute: distances, thickness, intersections, charts of texture coordinates.

pub mod check;
pub mod diff;
pub mod geometry;
#[cfg(test)]
mod made_obj;
pub mod opened;
pub mod report;
