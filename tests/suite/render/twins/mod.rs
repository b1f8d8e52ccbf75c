//! GPU against CPU: `visibility` compares samples, `shade` and `flat` colours, `pictures` whole pictures, `linear` those in
//! linear light, `gangs` jobs that share dispatches; `shared_pixels` reads pictures where the GPU has written them.

pub mod flat;
mod gangs;
mod linear;
pub mod pictures;
pub mod shade;
mod shared_pixels;
pub mod visibility;
