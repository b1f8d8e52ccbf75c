//! Tests of pictures: the back-ends agree, and pictures are compared with stored ones, with
//! formulas and with independent computations.

pub mod adaptive;
pub mod diagnostics;
pub mod examples;
pub mod golden;
pub mod hulls;
pub mod layers;
pub mod layers_hull;
pub mod lines;
pub mod looks;
pub mod models;
pub mod outlines;
pub mod prepared;
pub mod raster;
pub mod select;
pub mod shortcuts;
pub mod skips;
pub mod textures;
pub mod twins;
pub mod views;
