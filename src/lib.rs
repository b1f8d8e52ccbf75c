//! meshsnap turns a 3D mesh and a little material JSON into an image.
//!
//! ```text
//! bytes -> Mesh -> Scene -> DrawPlan -> backend (gpu | cpu) -> Image -> encoded bytes
//! ```
//!
//! That line is the whole program, and [`pipeline::render`] shows it in one function. In reading order:
//!
//! - [`limits`]: every cap, and what a job may spend.
//! - [`mesh`]: importers, and the one `Mesh` that they end in.
//! - [`scene`]: what a request says, the camera, colour.
//! - [`plan`]: what is drawn and what is skipped, decided before any pixel.
//! - [`backend`]: two ways to fill a plan, stage by stage the same.
//! - [`image`] and [`encode`]: the picture and its bytes.
//! - [`pipeline`]: all of the above, in order.
//! - [`report`]: what is in a file, for whoever asks instead of drawing it.
//! - [`request`]: the request document, from JSON and dotted keys to a [`scene::Spec`].
//! - [`jobs`]: the bounded queue and the workers.
//! - [`store`]: meshes that stay, named by what is in them.
//! - [`http`], [`cli`], [`config`], [`telemetry`]: the edges.

pub mod backend;
pub mod cli;
pub mod config;
pub mod encode;
pub mod image;
pub mod import;
pub mod limits;
pub mod mesh;
pub mod pipeline;
pub mod plan;
pub(crate) mod pluralise;
pub mod report;
pub mod request;
pub mod scene;
pub mod service;
pub mod spec;
pub mod srgb;
pub mod telemetry;
pub(crate) mod texture;
pub mod warning;
