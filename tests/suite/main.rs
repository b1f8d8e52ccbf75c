//! The one integration binary: a module per concern.

// Helpers outside of #[test] functions may give up as loudly as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod accuracy_behind_eye;
mod accuracy_bench;
mod accuracy_geometry;
mod accuracy_outlines;
mod accuracy_shading;
mod accuracy_wires;
mod bundles;
mod bundles_http;
mod bundles_zip;
mod cli;
mod examples;
mod formats;
mod formats_bad;
mod formats_gltf;
mod formats_gltf_document;
mod formats_gltf_scene;
mod formats_gltf_surfaces;
mod formats_hostile;
mod formats_mtl;
mod formats_obj;
mod formats_ply;
mod formats_ply_bad;
mod formats_ply_hostile;
mod formats_ply_surfaces;
mod formats_polygons;
mod formats_shared;
mod golden;
mod http;
mod http_bad;
mod jobs;
mod layers;
mod layers_hull;
mod likeness;
mod line_looks;
mod lines_scenes;
#[path = "../bench/accuracy/measure/mod.rs"]
mod measure;
mod mesh_files;
mod models;
mod mutations;
#[path = "../oracle/mod.rs"]
mod oracle;
mod oracle_flip;
mod oracle_parts;
mod oracle_scenes;
mod ply_files;
mod raster;
mod scenes;
mod schema;
mod seen;
mod select;
mod select_fakes;
mod server;
mod shapes;
mod shared;
mod skips;
mod soups;
mod structure;
mod texture_formulas;
mod textures;
mod textures_closeup;
mod truth;
mod twins;
mod twins_flat;
mod twins_shade;
mod twins_visibility;
mod views;
mod wire_formulas;
