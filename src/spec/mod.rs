//! What is to be drawn, in the user's terms: a [`Spec`] (looks, camera, light, image) for a mesh.

pub mod color;
mod document;
mod layers;
pub(crate) mod quality;

pub use document::*;
pub use layers::*;
pub use quality::*;
