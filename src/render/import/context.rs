//! The context of an import, given to every importer beside the bytes of the file: limits, the
//! memory that may still be allocated, the deadline, the other files of the upload, and options.

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

    /// The number of vertices, of so many, that are not among the `used` ones. None where it is not to be counted.
    pub fn loose(&self, vertices: usize, used: impl Iterator<Item = u32>) -> Result<Option<u64>, MeshError> {
        if !self.counts_loose {
            return Ok(None);
        }
        self.budget.clone().spend("the vertices that are used", vertices as u64, 1)?;
        let mut is_used = vec![false; vertices];
        for vertex in used {
            if let Some(is_used) = is_used.get_mut(vertex as usize) {
                *is_used = true;
            }
        }
        Ok(Some(is_used.iter().filter(|is_used| !**is_used).count() as u64))
    }
}
