//! Stage shade: from visible samples to colours.
//!
//! [`together`] groups a pixel's samples by triangle, eight pixels at a time, and [`shade`] those of a pixel by itself.
//! [`point`] shades each group once, at the mean of its samples; groups of a band are [`waiting`] until many are
//! shaded together. The rest is its formulas: [`barycentric`] coordinates, [`texture`] lookups, the [`normal`],
//! [`light`], [`occlusion_texture`], [`wire`] and [`debug`] views. Twins are in `shaders/surface/`.

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
