//! What tests share: meshes, scenes, servers, and where data lies.

pub mod bomb_files;
pub mod damage;
pub mod fake_gpus;
pub mod fbx_files;
pub mod likeness;
pub mod lines_scenes;
pub mod mesh_files;
pub mod moved_meshes;
pub mod outline_shapes;
pub mod ply_files;
pub mod scenes;
pub mod seen;
pub mod server;
pub mod shadow;
pub mod shapes;
pub mod shared;
pub mod soups;
pub mod truth;
