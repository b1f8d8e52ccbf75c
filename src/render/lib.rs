//! The renderer behind meshsnap, from the bytes of a mesh to the bytes of a picture.
//!
//! ```text
//! bytes -> Mesh -> Scene -> DrawPlan -> backend (gpu | cpu) -> Image -> encoded bytes
//! ```
//!
//! [`pipeline`] shows that line in one function. ARCHITECTURE.md in the repository is the map.
//!
//! This crate is the common ground of the other crates of meshsnap, and its interface follows their
//! needs. Programs that draw use the crate `meshsnap`, whose interface is small and kept stable.

pub mod backend;
pub mod caption;
pub mod encode;
pub mod guard;
pub mod image;
pub mod import;
pub mod limits;
pub mod mesh;
pub mod parallel;
pub mod pipeline;
pub mod plan;
pub mod pluralise;
pub mod request;
pub mod scene;
pub mod sheet;
pub mod spec;
pub mod srgb;
pub mod texture;
pub mod warning;
