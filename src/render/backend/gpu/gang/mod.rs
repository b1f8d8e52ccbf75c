//! Gangs: groups of up to 16 jobs (one picture each) that are drawn by the same dispatches, because
//! each job alone would leave most of a large GPU idle.
//!
//! A kernel that draws for a gang (shaders/gang.wgsl) has the uniforms of all its jobs. The third
//! coordinate of a workgroup is the number of its job. What kernels write lies in the same buffers,
//! one job's part after the other's; all parts have the same size. The data of the mesh is bound
//! once. So the jobs of a gang draw the same mesh with the same materials by the same pipelines, and
//! their pictures have equally many pixels. They may differ in the camera, the light and the
//! background, and in width and height.
//!
//! In reading order: [`seat`] (what a job brings to a gang, and which jobs can be in one gang),
//! [`turns`] (which job draws, when, and for which others), [`mod@draw`] (the commands).

mod draw;
mod seat;
mod turns;

pub use self::draw::{Pictures, draw};
pub use self::seat::{GangShare, may_share};
use self::turns::Turns;
pub use self::turns::{Leading, Seat, Turn};

/// The gangs of a device.
pub type Gangs = Turns<GangShare, Pictures>;
