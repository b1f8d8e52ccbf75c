//! The stage lines: edges are drawn over the colours as lines of exact width.
//!
//! For each [`edge`], [`contour`] tells if it is drawn in this view, [`segment`] is its position on
//! screen, and [`hidden_lines`] finds the intervals to draw ([`farthest`], [`candidates`] and
//! [`coplanar`] help it). Each interval is a [`stroke`]: the area within half the line's width of
//! it. Between its ends, its area in a pixel comes from [`profile`]. [`coverage`] unites a pixel's
//! strokes and composites them over the colours, under the light of [`line_light`]. Twins of most
//! are in `shaders/lines/`.
//!
//! Most pixels need no strokes if all edges of an opaque surface are drawn
//! ([`has_holes_under`](crate::plan::DrawPlan::has_holes_under) has all conditions): [`holes`]
//! finds the parts of faces that lines leave free, and all else is covered. Mainly the pixels near
//! rims, where the surface ends on screen, get strokes then. Where hidden parts of lines fade, [`fringes`] tell
//! what whole edges cover.

pub(crate) mod candidates;
pub(crate) mod contour;
pub(crate) mod coplanar;
pub(crate) mod coverage;
pub(crate) mod edge;
pub(crate) mod farthest;
pub(crate) mod fringes;
pub(crate) mod hidden_lines;
pub(crate) mod holes;
pub(crate) mod line_light;
pub(crate) mod plain;
pub(crate) mod profile;
pub(crate) mod segment;
pub(crate) mod stroke;
