//! The one integration binary: a module per concern.

mod formats;
mod formats_bad;
mod formats_gltf;
mod formats_gltf_document;
mod formats_hostile;
mod formats_obj;
mod formats_polygons;
mod formats_shared;
mod golden;
mod mesh_files;
mod raster;
mod scenes;
mod shapes;
mod shared;
mod structure;
mod twins;
