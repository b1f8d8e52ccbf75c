//! Families of shapes: many meshes of one kind, each with what a test needs to know of it.

pub mod lines;
pub mod moved;
pub mod outlines;
pub mod soups;
