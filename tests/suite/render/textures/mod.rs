//! Textures: images decoded into levels, and how pictures show them.

pub mod bad;
pub mod basis;
pub mod closeup;
pub mod cut_out;
pub mod cut_out_borders;
pub mod formulas;
pub mod levels;
pub mod occlusion;
pub mod second_uvs;
pub mod without;
