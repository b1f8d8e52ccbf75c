//! The crate that judges and compares meshes: the [`report`] on one, its [`check`] by rules, and
//! the [`diff`] of two, or of two pictures.
//!
//! [`read`] reads the meshes, [`drawing`] makes pictures of what was found. [`geometry`] has what
//! reports, rules and differences compute: distances, thickness, intersections, charts of texture
//! coordinates.

pub mod check;
pub mod diff;
pub mod drawing;
pub mod geometry;
mod images;
#[cfg(test)]
mod made_obj;
pub mod report;

use meshsnap_render::import::{Bundle, MeshError, Options};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::pipeline::Model;

/// Reads a mesh, to judge it or to compare it. What is worked out of it later comes from the rest of the budget.
pub fn read(
    bundle: &Bundle,
    options: impl Into<Options>,
    limits: &Limits,
    budget: Budget,
    deadline: &Deadline,
) -> Result<Model, MeshError> {
    Model::read(bundle, Options { counts_loose: true, ..options.into() }, limits, budget, deadline)
}
