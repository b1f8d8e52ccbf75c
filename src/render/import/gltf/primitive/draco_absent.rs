//! The stand-in for `draco.rs` in a build without the feature `draco`. It refuses primitives that
//! are compressed with Draco, with an error that names the feature.

use std::convert::Infallible;
use std::marker::PhantomData;

use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::{Reader, Shape};
use crate::import::gltf::data::attribute::Rule;
use crate::import::gltf::document::schema::{Draco, Primitive};

/// A decoded primitive, of which there is none.
pub struct Unpacked<'a> {
    never: Infallible,
    source: PhantomData<&'a Draco>,
}

impl<'a> Unpacked<'a> {
    /// Refuses: this build has no decoder.
    pub fn decode(
        what: &str,
        _: &Primitive,
        _: &'a Draco,
        _: &mut Reader<'_>,
        _: &mut Context<'_>,
    ) -> Result<Self, MeshError> {
        Err(MeshError::missing_feature(&format!("{what} of the glTF file is compressed with Draco"), "draco"))
    }

    /// Never called.
    pub fn indices(&self, _: &mut Context<'_>) -> Result<Vec<u32>, MeshError> {
        let _ = self.source;
        match self.never {}
    }

    /// Never called.
    pub fn has(&self, _: &str) -> bool {
        match self.never {}
    }

    /// Never called.
    pub fn vectors<const N: usize>(
        &self,
        _: &str,
        _: &Shape,
        _: &Rule,
        _: &mut Context<'_>,
    ) -> Result<Vec<[f64; N]>, MeshError> {
        match self.never {}
    }
}
