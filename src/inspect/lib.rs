//! Statements about meshes: the [`report`] on one, its [`check`] by rules, and the [`diff`] of two.
//!
//! [`opened`] has the files that are judged or compared, and the pictures of what was found. [`geometry`] answers questions
//! that drawing does not ask.

pub mod check;
pub mod diff;
pub mod geometry;
mod images;
#[cfg(test)]
mod made_obj;
pub mod opened;
pub mod report;
