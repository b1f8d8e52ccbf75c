//! Extreme numbers, and events in any order: the changes to a picture that they may cause, and those that they
//! may not.

pub mod depth;
pub mod faces;
pub mod interleavings;
pub mod intersections;
pub mod order;
pub mod report;
pub mod scale;
pub mod translation;
pub mod views;
