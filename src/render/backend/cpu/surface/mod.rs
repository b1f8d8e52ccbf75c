//! The stage shade: from visible samples to colours.
//!
//! The samples of a pixel that show the same triangle form a group, which is shaded once, at the mean of its
//! samples. (Metals that may mirror sharply can have a group in each quarter of a pixel: see [`shade`].) [`together`]
//! finds the groups of eight pixels at a time, which are [`waiting`] until [`point`] shades many of them together.
//! [`shade`] finds those of a single pixel. [`point`] uses the formulas of [`barycentric`] coordinates, [`texture`]
//! lookups, the [`normal`], [`light`], [`occlusion_texture`], [`wire`] and [`debug`] views. `flat` serves pictures in
//! which each triangle has one colour and none is transparent. Twins are in `shaders/surface/`.

pub(crate) mod barycentric;
pub(crate) mod debug;
pub(crate) mod flat;
pub(crate) mod flat_colors;
mod flat_lanes;
pub(crate) mod light;
pub(crate) mod normal;
mod occlusion_texture;
pub(crate) mod point;
pub(crate) mod shade;
pub(crate) mod texture;
pub(crate) mod together;
pub mod waiting;
pub(crate) mod wire;
