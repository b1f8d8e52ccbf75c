//! Stage lines: lines of exact width.
//!
//! For each [`edge`], [`contour`] tells if it is drawn in this view, [`segment`] is its position on
//! screen, and [`hidden_lines`] finds the intervals to draw. Each interval is a [`stroke`] in the
//! pixels that it touches; its area comes from [`profile`]. [`coverage`] unites a pixel's strokes
//! and composites them over the colours, under the light of [`line_light`]. Twins are in
//! `shaders/lines/`.
//!
//! Most pixels need no strokes where all edges of a surface are drawn: [`holes`] in its faces are
//! what its lines leave free. Only the pixels near rims get strokes then.

pub(crate) mod candidates;
pub(crate) mod contour;
pub(crate) mod coplanar;
pub(crate) mod coverage;
pub(crate) mod edge;
pub(crate) mod farthest;
pub(crate) mod hidden_lines;
pub(crate) mod holes;
pub(crate) mod line_light;
pub(crate) mod plain;
pub(crate) mod profile;
pub(crate) mod segment;
pub(crate) mod stroke;
