//! The daemon: [`http`] in front of [`jobs`] (the queue, the workers and their results) and
//! [`store`] (meshes that stay).
//!
//! Architecture invariant: [`jobs`] and [`store`] do not know HTTP.

pub mod http;
pub mod jobs;
pub mod store;
