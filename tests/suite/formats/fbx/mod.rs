//! FBX, ASCII and binary.

pub mod basics;
pub mod scene;
