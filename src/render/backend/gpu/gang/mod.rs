//! Gangs: jobs that share dispatches, because each alone would leave most of a large GPU idle.
//!
//! A kernel that draws for a gang (shaders/gang.wgsl) has the uniforms of all its jobs, and tells their workgroups
//! apart by the third coordinate. What kernels write lies one job after the other in the same buffers. What they read
//! of the mesh is bound once, so the jobs of a gang draw the same mesh with the same materials: they differ in the
//! camera, the light, the background and the size.
//!
//! In reading order: [`seat`] (a job's share, and which jobs are alike), [`turns`] (who draws, and for whom), [`mod@draw`]
//! (the commands).

mod draw;
mod seat;
mod turns;

pub use self::draw::{Pictures, draw};
pub use self::seat::{GangShare, may_share};
use self::turns::Turns;
pub use self::turns::{Leading, Seat, Turn};

/// The gangs of a device.
pub type Gangs = Turns<GangShare, Pictures>;
