//! Helpers of the plan for work with a mesh's edges: the classes of edges that lines follow, edges that
//! may be silhouette edges, runs of faces that are tested as a whole, and work on long lists.
//!
//! Stages get the edges through [`PlanContext`](super::context::PlanContext), which finds them once.

pub(crate) mod edge_class;
pub(crate) mod face_runs;
pub(crate) mod select;
pub(crate) mod silhouettes;
pub(crate) mod view_of_runs;
