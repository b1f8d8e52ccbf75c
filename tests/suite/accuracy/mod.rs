//! How far pictures are from the truth, and whether the gates that say so can fail.

pub mod behind_eye;
pub mod bench;
pub mod error_table;
pub mod geometry;
pub mod mutations;
pub mod oracle_flip;
pub mod oracle_parts;
pub mod oracle_scenes;
pub mod outlines;
pub mod over;
pub mod shading;
pub mod wires;
