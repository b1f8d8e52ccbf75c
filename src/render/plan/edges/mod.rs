//! Questions about a mesh's edges: which may be silhouette edges, and of which class each is.
//!
//! Stages get the edges through [`PlanContext`](super::context::PlanContext), which finds them
//! once.

pub(crate) mod edge_class;
pub(crate) mod face_runs;
pub(crate) mod select;
pub(crate) mod silhouettes;
pub(crate) mod view_of_runs;
