//! The one integration binary: a module per concern.

mod golden;
mod raster;
mod scenes;
mod shapes;
mod structure;
mod twins;
