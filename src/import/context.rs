//! The context of an import, given to every importer beside the bytes.

use super::bundle::Folder;
use super::error::MeshError;
use crate::limits::{Budget, Deadline, Limits};

/// The context of an import: limits, budget, deadline and the other files.
pub struct Context<'a> {
    /// The caps.
    pub limits: &'a Limits,
    /// Bytes that may still be allocated.
    pub budget: &'a mut Budget,
    /// Polled inside long loops.
    pub deadline: &'a Deadline,
    /// The files that names in the mesh refer to.
    pub bundle: &'a Folder,
    /// As [`super::Options::time_s`].
    pub time_s: Option<f64>,
    /// As [`super::Options::counts_loose`].
    pub counts_loose: bool,
}

impl Context<'_> {
    /// Refuses more triangles than the limit allows.
    pub fn check_triangles(&self, count: u64) -> Result<(), MeshError> {
        Ok(crate::limits::check("the number of triangles", count, self.limits.triangles, "--limit-triangles")?)
    }
}
