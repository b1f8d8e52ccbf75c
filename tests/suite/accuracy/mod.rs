//! The distance of pictures from the truth, which `tests/oracle/` computes. A gate is the largest
//! error that a test lets pass; `mutations.rs` tests that gates can fail.

pub mod adaptive;
pub mod behind_eye;
pub mod bench;
pub mod error_table;
pub mod geometry;
pub mod mutations;
pub mod occlusion;
pub mod oracle_flip;
pub mod oracle_parts;
pub mod oracle_scenes;
pub mod outlines;
pub mod over;
pub mod shading;
pub mod textures;
pub mod wires;
