//! The real server over HTTP.

pub mod answers;
pub mod bad;
pub mod guards;
pub mod jobs;
pub mod kept;
pub mod memory;
pub mod meshes;
pub mod meshes_bad;
pub mod meshes_pictures;
pub mod meshes_room;
pub mod metrics;
pub mod mistakes;
pub mod openapi;
pub mod page;
pub mod quality_target;
pub mod schema;
pub mod shared_queue;
pub mod shared_store;
pub mod sheets;
pub mod verdicts;
