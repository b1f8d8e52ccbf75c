//! What is to be drawn, in the user's terms: a [`Spec`] (looks, camera, light, image) for a mesh.
//!
//! [`spec`] holds the request document's meaning after presets and defaults, [`layers`] that of its looks; [`camera`] turns a camera wish and a mesh
//! into matrices; [`color`] is the one definition of colour; [`Ask`] is an error or a time in place of techniques.

mod ask;
pub mod camera;
pub mod color;
mod layers;
mod spec;

pub use ask::*;
pub use layers::*;
pub use spec::*;
