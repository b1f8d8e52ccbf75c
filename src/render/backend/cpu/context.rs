//! The input that all stages of the CPU rasterizer share: the plan (what to draw), the vertices on screen, and
//! results for the whole picture, such as the colours of faces and how much darker hollows are.

use std::ops::Range;

use super::geometry::transform::ScreenVertex;
use super::isa::{Isa, LANES};
use super::occlusion::Occlusion;
use super::resolve::SrgbEncoder;
use super::stopwatch::Stopwatch;
use super::surface::flat_colors::FlatColors;
use crate::limits::Deadline;
use crate::plan::{DrawPlan, OcclusionPass};

/// Input of every stage.
pub struct RasterContext<'a> {
    pub(super) plan: &'a DrawPlan<'a>,
    pub(super) deadline: &'a Deadline,
    /// The positions', then the hull's own.
    pub(super) vertices: &'a [ScreenVertex],
    pub(super) isa: Isa,
    pub(super) watch: &'a Stopwatch,
    pub(super) srgb: &'a SrgbEncoder,
    /// The colour of each triangle, where every material is flat.
    pub(super) flat: Option<&'a FlatColors>,
    /// The light that pixels go without, where they do.
    pub(super) occlusion: Option<(&'a OcclusionPass, &'a Occlusion)>,
    /// As [`DrawPlan::has_quarters`].
    pub(super) has_quarters: bool,
    /// See [`is_plain`](Self::is_plain).
    pub(super) is_plain: bool,
}

impl RasterContext<'_> {
    /// True if no shortcuts are taken: by the renderer that tests compare with, `CpuRenderer::plain`. Programs are built
    /// without that feature, and the compiler leaves out what only this renderer runs.
    #[inline(always)]
    pub(super) fn is_plain(&self) -> bool {
        cfg!(feature = "plain") && self.is_plain
    }

    /// Vertex indices of a triangle.
    #[inline(always)]
    pub(super) fn triangle(&self, id: u32) -> [u32; 3] {
        let id = id as usize;
        match (self.plan.triangles.get(id), &self.plan.hull) {
            (Some(triangle), _) => *triangle,
            (None, Some(hull)) => hull.triangles[id - self.plan.triangles.len()],
            (None, None) => [0; 3],
        }
    }

    /// Vertex indices of the triangles with these ids; None if they are not all of the mesh or all
    /// of the outline mesh.
    pub(super) fn triangles_of(&self, ids: &Range<usize>) -> Option<&[[u32; 3]]> {
        let own: &[[u32; 3]] = &self.plan.triangles;
        let from_hull = || {
            let first = ids.start.checked_sub(own.len())?;
            self.plan.hull.as_ref()?.triangles.get(first..ids.end - own.len())
        };
        own.get(ids.clone()).or_else(from_hull)
    }

    /// Vertex indices of eight triangles.
    #[inline(always)]
    pub(super) fn indices_of(&self, ids: &[u32; LANES]) -> [[u32; 3]; LANES] {
        let triangles: &[[u32; 3]] = &self.plan.triangles;
        let mut indices = [[0; 3]; LANES];
        for l in 0..LANES {
            indices[l] = match triangles.get(ids[l] as usize) {
                Some(triangle) => *triangle,
                None => self.triangle(ids[l]),
            };
        }
        indices
    }

    /// True if a triangle belongs to the outline mesh.
    #[inline(always)]
    pub(super) fn is_hull(&self, id: u32) -> bool {
        id as usize >= self.plan.triangles.len()
    }

    /// The vertices of an id on screen.
    #[inline(always)]
    pub(super) fn screen_triangle(&self, id: u32) -> [ScreenVertex; 3] {
        // Not in a closure, which would be compiled for the baseline.
        let [a, b, c] = self.triangle(id);
        [self.vertices[a as usize], self.vertices[b as usize], self.vertices[c as usize]]
    }
}
