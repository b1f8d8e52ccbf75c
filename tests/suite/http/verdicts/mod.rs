//! `/v1/check` and `/v1/diff` over HTTP: verdicts on meshes, and differences between them.

mod check;
mod diff;
