//! Draws a tiny plan at start and checks its pixels.
