//! 3MF, the format of 3D printing: a zip package whose model parts are XML. Read are the 3MF
//! Consortium's "Core Specification" 1.3, "Production Extension" 1.1 and the colour groups of
//! "Materials and Properties Extension" 1.2.
//!
//! [`package`] finds the first part, [`xml`] reads elements and attributes, [`namespaces`] resolves
//! their namespaces, [`model`] keeps one part, [`parts`] all parts that it refers to, and [`build`]
//! places their objects.

mod build;
mod model;
mod namespaces;
mod package;
mod parts;
mod values;
mod xml;

pub use package::start_part;

use super::raw::RawMesh;
use super::{Format, MeshError};
use crate::import::context::Context;
use crate::mesh::UpAxis;

/// Reads the package in `cx.bundle`, whose entry is its first model part.
pub fn read(cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let mut raw = RawMesh { up: UpAxis::Z, ..RawMesh::default() };
    raw.report.format = Format::ThreeMf;
    let parts = parts::read(&mut raw, cx)?;
    build::assemble(&parts, &mut raw, cx)?;
    Ok(raw)
}
