//! 3MF, the format of 3D printing (3MF Consortium, "3D Manufacturing Format Core Specification" 1.3, "Production Extension" 1.1,
//! and of "Materials and Properties Extension" 1.2 the colour groups): a zip package whose model parts are XML.
//!
//! [`package`] finds the part to begin with, [`xml`] is how elements and attributes are read, [`spaces`] whose they are, [`model`] keeps one part,
//! [`parts`] all that it refers to, and [`build`] places them.

mod build;
mod model;
mod package;
mod parts;
mod spaces;
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
