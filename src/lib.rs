//! meshsnap turns a 3D mesh and a little material JSON into an image.
//!
//! From bytes to a picture in ten lines:
//!
//! ```
//! use meshsnap::{Mesh, Renderer, Spec};
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let bytes = std::fs::read("api/examples/knot.obj")?;
//!     let mesh = Mesh::read(&bytes)?;
//!     let image = Renderer::cpu().render(&mesh, &Spec::wire())?;
//!     let png = image.to_png()?;
//!     assert!(png.starts_with(b"\x89PNG"));
//!     Ok(())
//! }
//! ```
//!
//! - [`Mesh`] is read once, from the bytes of any format that is known, and drawn as often as needed.
//! - [`Spec`] says what to draw: a style, and the keys of the request document.
//! - [`Renderer`] draws, on the CPU or on a GPU, and gives an [`Image`].
//! - [`Error`] says what went wrong; [`Error::fault`] says who can mend it.
//!
//! # Features
//!
//! All are on by default. Without any, the crate is a renderer on the CPU in pure Rust.
//!
//! | feature | adds | costs |
//! |---|---|---|
//! | `gpu` | drawing on a GPU, by Vulkan | wgpu |
//! | `service` | the HTTP service | tokio, axum |
//! | `cli` | the program `meshsnap`; includes `service` | clap |
//! | `fbx` | reading FBX | a C compiler |
//! | `meshopt` | reading glTF compressed by meshoptimizer | a C++ compiler |
//! | `draco` | reading glTF compressed by Draco | |
//! | `basis` | reading Basis Universal textures | |
//!
//! # How it works
//!
//! ```text
//! bytes -> Mesh -> Scene -> DrawPlan -> backend (gpu | cpu) -> Image -> encoded bytes
//! ```
//!
//! That line is the whole program. ARCHITECTURE.md in the repository is the map of it.

// Everything below is how it works: public for the program's own tests and tools, and free to change.
#[doc(hidden)]
pub mod backend;
mod caption;
#[doc(hidden)]
pub mod check;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[cfg(feature = "service")]
#[doc(hidden)]
pub mod config;
#[doc(hidden)]
pub mod diff;
#[doc(hidden)]
pub mod encode;
#[doc(hidden)]
pub mod guard;
#[doc(hidden)]
pub mod image;
#[doc(hidden)]
pub mod import;
mod library;
#[doc(hidden)]
pub mod limits;
#[cfg(test)]
mod made_obj;
#[doc(hidden)]
pub mod mesh;
mod parallel;
#[cfg(feature = "service")]
mod percent;
#[doc(hidden)]
pub mod pipeline;
#[doc(hidden)]
pub mod plan;
mod pluralise;
#[doc(hidden)]
pub mod report;
#[doc(hidden)]
pub mod request;
#[cfg(all(feature = "cli", target_os = "linux"))]
#[doc(hidden)]
pub mod sandbox;
#[doc(hidden)]
pub mod scene;
#[cfg(feature = "service")]
#[doc(hidden)]
pub mod service;
mod sheet;
#[doc(hidden)]
pub mod spec;
#[doc(hidden)]
pub mod srgb;
#[cfg(feature = "service")]
#[doc(hidden)]
pub mod telemetry;
mod texture;
#[doc(hidden)]
pub mod warning;

pub use backend::{BackendKind, DrawError};
pub use encode::EncodeError;
pub use image::{Image, ImageFormat, Pixels};
pub use import::{Format, MeshError, MeshFault};
pub use library::{Error, Fault, Mesh, MeshReader, Picture, Renderer, Spec};
pub use limits::{Deadline, LimitExceeded, Limits, Stopped};
pub use plan::{PlanError, Skip, SkipKind};
pub use request::{RequestError, RequestFault};
pub use warning::Warning;
