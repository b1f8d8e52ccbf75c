//! TODO room.

pub(crate) mod contour;
pub(crate) mod coverage;
pub(crate) mod edge;
pub(crate) mod hidden_lines;
pub(crate) mod line_light;
pub(crate) mod profile;
pub(crate) mod segment;
pub(crate) mod stroke;
