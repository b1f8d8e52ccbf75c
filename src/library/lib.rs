//! meshsnap turns a 3D mesh and a little material JSON into an image.
//!
//! From bytes to a picture in ten lines:
//!
//! ```
//! use meshsnap::{Mesh, Renderer, Spec};
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     # std::env::set_current_dir("../..")?;
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
//! - [`Spec`] says what to draw: a style, setters for what is asked for often, and the keys of the request document.
//! - [`Renderer`] draws, on the CPU or on a GPU, and gives an [`Image`]. A [`Watch`] reports the end of each stage
//!   and can stop the drawing. [`Renderer::linear`] gives linear light as half floats ([`struct@f16`] is that of the
//!   crate `half`), and [`Renderer::faces`] tells the triangle and the distance of each pixel.
//! - [`Error`] says what went wrong; [`Error::fault`] says who can mend it.
//!
//! # Features
//!
//! All are on by default. Without any, the crate is a renderer on the CPU in pure Rust.
//!
//! | feature | adds | costs |
//! |---|---|---|
//! | `gpu` | drawing on a GPU, by Vulkan | wgpu |
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
//! That line is the whole program. ARCHITECTURE.md in the repository is the map of it. The command line is the crate
//! `meshsnap-cli`, the HTTP service the crate `meshsnap-server`.

mod error;
mod mesh;
mod renderer;
mod spec;

pub use error::{Error, Fault};
pub use mesh::{Mesh, MeshReader};
pub use renderer::{Picture, Renderer, Watch};
pub use spec::Spec;

#[doc(inline)]
pub use meshsnap_render::backend::{BackendKind, DrawError};
#[doc(inline)]
pub use meshsnap_render::encode::EncodeError;
#[doc(inline)]
pub use meshsnap_render::image::{Image, ImageFormat, LinearImage, Pixels, f16};
#[doc(inline)]
pub use meshsnap_render::import::{Format, MeshError, MeshFault};
#[doc(inline)]
pub use meshsnap_render::limits::{Deadline, LimitExceeded, Limits, Stopped};
#[doc(inline)]
pub use meshsnap_render::mesh::UpAxis;
#[doc(inline)]
pub use meshsnap_render::pipeline::{FaceBuffer, Stage};
#[doc(inline)]
pub use meshsnap_render::plan::{PlanError, Skip, SkipKind};
#[doc(inline)]
pub use meshsnap_render::request::{RequestError, RequestFault};
#[doc(inline)]
pub use meshsnap_render::spec::{Hidden, NamedView as View, Samples, WireEdges};
#[doc(inline)]
pub use meshsnap_render::warning::Warning;
