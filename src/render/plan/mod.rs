//! The plan of a picture: a [`DrawPlan`] lists all that is drawn, already decided. It is made from
//! a scene (a mesh, a request and the placed camera). Back-ends only draw it: they see slices and
//! numbers, never a mesh or a scene.
//!
//! [`build()`] makes the plan in stages, such as `primitives` (lines and points), `lines`,
//! `surface`, `outline` (hulls) and `peeling` (transparent layers). Where a request has a quality
//! target, `quality` first chooses the values that the request leaves open.
//!
//! Invariant: work that a scene does not need is left out here, and [`DrawPlan::skips`] lists the
//! kinds of work that are left out.

mod build;
mod context;
mod costs;
mod cut_outs;
mod edges;
mod error;
mod framing;
mod geometry;
mod ground;
pub mod heat;
mod lines;
mod margin;
mod outline;
mod peeling;
mod prepared;
mod primitives;
mod projection;
mod quality;
mod shared_slice;
mod skips;
mod surface;
mod uv_layout;
mod warnings;

pub use crate::texture::{Texels, Texture, TextureError, Textures};
pub use build::{build, build_from, build_keeping};
pub use error::PlanError;
pub use framing::framing;
pub use heat::Legend;
pub use lines::{Edge, FaceSide, LineFade, LinePass, Shown};
pub use outline::{HullPass, ScreenVertex};
pub use peeling::{ALPHA_MIN, FADE, PeelingPass, TINTS, pass_mask};
pub use prepared::{MeshToken, Prepared};
pub use projection::{PX, Projection, Projector};
pub use quality::{QualitySelection, SelectedSpec, select_quality};
pub use shared_slice::SharedSlice;
pub use skips::{Skip, SkipKind};
pub use surface::occlusion::{OcclusionPass, TAPS, TAPS_PER_PIXEL};
pub use surface::{
    CornerValues, Lamp, Lights, MIRROR_ROUGHNESS, ShadedMaterial, SurfacePass, TEXTURE_NONE, TextureUse, debug_views,
    flags, samplers, slots,
};
pub use uv_layout::{GRID_BYTES as UV_GRID_BYTES, UvLayout, overlapping as overlapping_uvs};
pub use warnings::{is_out_of_view, out_of_view, undrawn_primitives, unknown_materials};

use crate::warning::Warning;
use std::borrow::Cow;
use std::sync::Arc;

/// Everything a back-end needs for one picture.
///
/// Screen space: x right, y down, in units of 1/256 pixel from the picture's centre. Depth is
/// reversed: larger is nearer, 0 is infinitely far or nothing.
#[derive(Debug)]
pub struct DrawPlan<'a> {
    /// Columns, at most 4096.
    pub width_px: u32,
    /// Rows, at most 4096.
    pub height_px: u32,
    /// Pixels beyond the picture, on each side, that have visibility samples too. What is there
    /// hides the middle of lines whose flanks are in the picture. Nothing else is drawn there.
    pub margin_px: u32,
    /// Visibility samples per pixel: 1, 4, 8 or 16.
    pub samples: u32,
    /// True if pixels near which faces meet that differ in colour are drawn from coverage points
    /// instead of samples.
    pub is_adaptive: bool,
    /// Positions in the unit box.
    pub positions: SharedSlice<'a, [f32; 3]>,
    /// Triangles over `positions`. An id in the visibility buffer is an index here, or past them
    /// one into the hull's triangles.
    pub triangles: SharedSlice<'a, [u32; 3]>,
    /// The passes that draw each triangle: bits of [`pass_mask`]. Empty where all are
    /// [`pass_mask::SURFACE`].
    pub pass_masks: Cow<'a, [u8]>,
    /// Unit box to screen.
    pub projection: Projection,
    /// The surface, filled or only hiding lines; None where a request has neither.
    pub surface: Option<SurfacePass<'a>>,
    /// The light that does not reach the bottom of the surface's hollows; None where nothing is dimmed.
    pub occlusion: Option<OcclusionPass>,
    /// Transparent layers over the surface; None where nothing shines through.
    pub peeling: Option<PeelingPass>,
    /// The outline around the surface; None where a request has none.
    pub hull: Option<HullPass<'a>>,
    /// Lines of exact width, drawn over everything else, in this order.
    pub lines: Vec<LinePass>,
    /// True if the edges of lines name all of their faces, because none has more than two.
    pub names_all_faces: bool,
    /// Premultiplied linear RGBA behind everything, at the picture's upper edge.
    pub background: [f32; 4],
    /// Change of the background from row to row; 0 where it has one colour.
    pub background_step: [f32; 4],
    /// Work that the plan leaves out, and why.
    pub skips: Vec<Skip>,
    /// Chains of lines that are left out because they are short: see `wire.min_length` and
    /// `outline.min_length`.
    pub short_chains: u32,
    /// The meaning of the colours of diagnostics.
    pub legends: Vec<Legend>,
    /// What the picture goes without although it was asked for, and why.
    pub warnings: Vec<Warning>,
    /// The mesh that the plan borrows from, where it may be drawn again.
    pub mesh: Option<Arc<MeshToken>>,
}

/// The side of triangles that a pass draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Faces {
    /// Both sides.
    Both,
    /// Counter-clockwise on screen.
    Front,
    /// Clockwise on screen.
    Back,
}

impl<'a> DrawPlan<'a> {
    /// A plan that draws nothing yet, at 1 sample per pixel, on a transparent background.
    pub fn new(
        size_px: [u32; 2],
        positions: &'a [[f32; 3]],
        triangles: &'a [[u32; 3]],
        projection: Projection,
    ) -> Self {
        Self {
            width_px: size_px[0],
            height_px: size_px[1],
            margin_px: 0,
            samples: 1,
            is_adaptive: false,
            positions: positions.into(),
            triangles: triangles.into(),
            pass_masks: Cow::Borrowed(&[]),
            projection,
            surface: None,
            occlusion: None,
            peeling: None,
            hull: None,
            lines: Vec::new(),
            names_all_faces: true,
            background: [0.0; 4],
            background_step: [0.0; 4],
            skips: Vec::new(),
            short_chains: 0,
            legends: Vec::new(),
            warnings: Vec::new(),
            mesh: None,
        }
    }

    /// True if the background is not the same in all rows.
    #[inline(always)]
    pub fn has_gradient(&self) -> bool {
        self.background_step != [0.0; 4]
    }

    /// The background in the middle of a row. Twin of `background_at` in `shaders/over.wgsl`.
    #[inline(always)]
    pub fn background_at(&self, row: u32) -> [f32; 4] {
        let rows = row as f32 + 0.5;
        std::array::from_fn(|k| self.background[k] + self.background_step[k] * rows)
    }

    /// The peeling pass, where there are layers to look for.
    pub fn peeling(&self) -> Option<&PeelingPass> {
        let has_triangles = self.surface.is_some() || self.hull.is_some();
        self.peeling.as_ref().filter(|layers| layers.count_max > 0 && has_triangles)
    }

    /// True if the hull is drawn into the layers and not into the visibility buffer.
    pub fn has_peeled_hull(&self) -> bool {
        self.hull.is_some() && self.peeling().is_some_and(|layers| !layers.behind_surface)
    }

    /// The passes that draw a triangle.
    #[inline(always)]
    pub fn pass_mask(&self, triangle: usize) -> u8 {
        self.pass_masks.get(triangle).copied().unwrap_or(pass_mask::SURFACE)
    }

    /// Rows above and below a band whose samples it needs: for what hides its lines, or for the
    /// neighbours of its pixels.
    pub fn margin_rows(&self) -> u32 {
        self.line_margin_rows().max(u32::from(self.is_adaptive))
    }

    /// True if some pixels may be drawn from coverage points.
    pub fn has_mixed(&self) -> bool {
        self.is_adaptive && self.is_shaded()
    }

    /// True if a face that is drawn from coverage points, or from samples beside them, may be shaded in each quarter of a
    /// pixel.
    pub fn has_quarters(&self) -> bool {
        let is_any = |surface: &SurfacePass<'_>| surface.materials.iter().any(ShadedMaterial::is_quartered);
        self.has_mixed() && self.surface.as_ref().is_some_and(is_any)
    }

    /// True if any sample gets a colour.
    pub fn is_shaded(&self) -> bool {
        self.surface.as_ref().is_some_and(|surface| surface.is_shaded) || self.hull.is_some()
    }
}

/// Numbers of a pixel's samples that lie closest to its sides, of 4 samples and of 16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutermostSamples {
    /// The leftmost.
    pub left: usize,
    /// The rightmost.
    pub right: usize,
    /// The topmost.
    pub top: usize,
    /// The lowest.
    pub bottom: usize,
}

impl OutermostSamples {
    /// Those of 4 samples.
    pub const OF_FOUR: Self = Self { left: 2, right: 1, top: 0, bottom: 3 };
    /// Those of 16 samples.
    pub const OF_SIXTEEN: Self = Self { left: 12, right: 13, top: 15, bottom: 14 };

    /// Those of 4 samples or of 16. Adaptive plans have no other numbers.
    pub fn of(samples: u32) -> Self {
        debug_assert!(matches!(samples, 4 | 16), "{samples} samples");
        if samples == 4 { Self::OF_FOUR } else { Self::OF_SIXTEEN }
    }
}

/// Sample positions inside a pixel, in 1/256 pixel from its upper left corner: the standard
/// patterns of Direct3D 11 and Vulkan.
///
/// No two samples share a row or a column. Their mean is the pixel's centre. All coordinates have
/// the same remainder modulo 16. With 16 samples it is 8, because as many rows and columns have no
/// symmetric places in sixteenths otherwise.
pub const fn sample_offsets(samples: u32) -> &'static [[i32; 2]] {
    const fn scaled<const N: usize>(mut sixteenths: [[i32; 2]; N], shift: i32) -> [[i32; 2]; N] {
        let mut s = 0;
        while s < N {
            sixteenths[s] = [16 * sixteenths[s][0] + shift, 16 * sixteenths[s][1] + shift];
            s += 1;
        }
        sixteenths
    }
    const ONE: [[i32; 2]; 1] = scaled([[8, 8]], 0);
    const FOUR: [[i32; 2]; 4] = scaled([[6, 2], [14, 6], [2, 10], [10, 14]], 0);
    const EIGHT: [[i32; 2]; 8] = scaled([[9, 5], [7, 11], [13, 9], [5, 3], [3, 13], [1, 7], [11, 15], [15, 1]], 0);
    const SIXTEEN: [[i32; 2]; 16] = scaled(
        [
            [9, 9],
            [7, 5],
            [5, 10],
            [12, 7],
            [3, 6],
            [10, 13],
            [13, 11],
            [11, 3],
            [6, 14],
            [8, 1],
            [4, 2],
            [2, 12],
            [0, 8],
            [15, 4],
            [14, 15],
            [1, 0],
        ],
        8,
    );
    match samples {
        1 => &ONE,
        4 => &FOUR,
        8 => &EIGHT,
        _ => &SIXTEEN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outermost_samples_are_closest_to_the_sides() {
        for samples in [4, 16] {
            let (offsets, outermost) = (sample_offsets(samples), OutermostSamples::of(samples));
            let at_most = |k: usize, s: usize| offsets.iter().all(|at| offsets[s][k] <= at[k]);
            let at_least = |k: usize, s: usize| offsets.iter().all(|at| offsets[s][k] >= at[k]);
            assert!(at_most(0, outermost.left) && at_least(0, outermost.right), "{samples}");
            assert!(at_most(1, outermost.top) && at_least(1, outermost.bottom), "{samples}");
        }
    }

    #[test]
    fn samples_are_spread_evenly() {
        for samples in [1, 4, 8, 16] {
            let offsets = sample_offsets(samples);
            assert_eq!(offsets.len(), samples as usize);
            for k in 0..2 {
                let mut cells: Vec<_> = offsets.iter().map(|at| at[k] * samples as i32 / 256).collect();
                cells.sort_unstable();
                assert_eq!(cells, (0..samples as i32).collect::<Vec<_>>(), "one in each row and column");
                assert_eq!(offsets.iter().map(|at| at[k]).sum::<i32>(), 128 * samples as i32);
                assert!(offsets.iter().all(|at| at[k] & 15 == offsets[0][0] & 15));
            }
        }
    }
}
