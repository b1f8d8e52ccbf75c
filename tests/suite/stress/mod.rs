//! What extreme numbers may do to a picture, and what they may not.

pub mod depth;
pub mod faces;
pub mod order;
pub mod report;
pub mod scale;
pub mod translation;
pub mod views;
