//! TODO room.

pub(crate) mod clip;
pub(crate) mod nearest;
pub(crate) mod samples;
pub(crate) mod transform;
pub(crate) mod visibility;
