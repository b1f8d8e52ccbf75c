//! Verdicts on meshes over HTTP.

mod check;
mod diff;
