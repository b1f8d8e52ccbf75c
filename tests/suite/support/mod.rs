//! Helpers that tests share: meshes, scenes, servers, data, and the list of skipped tests.

pub mod allocations;
pub mod data;
pub mod fake_gpus;
pub mod families;
pub mod files;
pub mod gpus;
pub mod likeness;
pub mod scenes;
pub mod seen;
pub mod server;
pub mod shadow;
pub mod shapes;
pub mod skip;
pub mod truth;
pub mod work;
