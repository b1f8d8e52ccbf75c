//! What to draw, already decided. Back-ends only fill: they see slices and numbers, never a mesh or a scene.
//!
//! [`build()`] makes a [`DrawPlan`] from a mesh and a spec; everything that a scene does not need is left out there, and
//! each omission is written down in [`DrawPlan::skips`].

mod build;
pub(crate) mod context;
mod edges;
mod error;
mod lines;
mod margin;
mod out_of_view;
mod outline;
mod primitives;
mod quality;
mod skips;
mod sort;
mod surface;

pub use crate::texture::{Texture, TextureError, Textures};
pub use build::{build, build_keeping};
pub use error::PlanError;
pub use lines::{Edge, LinePass, Shown, Side};
pub use out_of_view::is_out_of_view;
use outline::Thickness;
pub use outline::{HullPass, HullVertex};
pub use primitives::thicken;
pub use quality::{Choice, Chosen, choose};
pub use skips::{Skip, SkipKind};
pub use surface::{
    CornerValues, Lamp, Lights, ShadedMaterial, SurfacePass, TEXTURE_NONE, TextureUse, debug_views, flags, samplers,
    slots,
};

use std::borrow::Cow;

/// Everything a back-end needs for one picture.
///
/// Screen space: x right, y down, in units of 1/256 pixel from the picture's centre. Depth is reversed: larger is nearer,
/// 0 is infinitely far or nothing.
#[derive(Debug)]
pub struct DrawPlan<'a> {
    /// Columns, at most 4096.
    pub width_px: u32,
    /// Rows, at most 4096.
    pub height_px: u32,
    /// Pixels beyond the picture, on each side, that have visibility samples too: what is there hides the middle of lines whose flanks are
    /// in the picture. Nothing else is drawn there.
    pub margin_px: u32,
    /// Visibility samples a pixel: 1, 4, 8 or 16.
    pub samples: u32,
    /// Positions in the unit box.
    pub positions: &'a [[f32; 3]],
    /// Triangles over `positions`. An id in the visibility buffer is an index here, or past them one into
    /// the hull's.
    pub triangles: &'a [[u32; 3]],
    /// What each triangle takes part in: bits of [`pass_mask`]. Empty where all are [`pass_mask::SURFACE`].
    pub pass_masks: Cow<'a, [u8]>,
    /// Unit box to screen.
    pub projection: Projection,
    /// The filled surface; None where a look has none.
    pub surface: Option<SurfacePass<'a>>,
    /// What lies over the surface and lets it shine through; None where nothing does.
    pub peeling: Option<PeelingPass>,
    /// The outline around the surface; None where a look has none.
    pub hull: Option<HullPass<'a>>,
    /// Lines of exact width, drawn over all else, in this order.
    pub lines: Vec<LinePass>,
    /// Premultiplied linear RGBA behind everything.
    pub background: [f32; 4],
    /// What this scene did not need, and why.
    pub skips: Vec<Skip>,
}

/// Row vectors: `screen = (X.p, Y.p) / W.p`, `depth = Z.p / W.p` for `p = (x, y, z, 1)`.
///
/// W is the distance in front of the eye in perspective (near plane at `near_w`) and constantly 1 in an orthographic view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// To 1/256 pixels right of the centre, times W.
    pub x: [f32; 4],
    /// To 1/256 pixels below the centre, times W.
    pub y: [f32; 4],
    /// To reversed depth, times W.
    pub z: [f32; 4],
    /// To W.
    pub w: [f32; 4],
    /// Smallest W that is drawn.
    pub near_w: f32,
    /// Whether triangles may reach behind the near plane or far outside the picture. Where the mesh's box is known to lie
    /// inside, no triangle is ever tested for clipping.
    pub clip: bool,
    /// Unit vector from the mesh towards the viewer, unit-box axes.
    pub to_viewer: [f32; 3],
    /// The picture's up direction, unit-box axes.
    pub screen_up: [f32; 3],
    /// The picture's right direction, unit-box axes.
    pub screen_right: [f32; 3],
}

/// What a triangle takes part in.
pub mod pass_mask {
    /// Drawn into the visibility buffer, if the plan has a surface.
    pub const SURFACE: u8 = 1;
    /// Drawn into the layers, if the plan has layers.
    pub const LAYER: u8 = 2;
    /// As surface or layer only where it faces the viewer, whatever [`SurfacePass::faces`](super::SurfacePass) says.
    pub const FRONT_ONLY: u8 = 8;
    /// The same for its other side.
    pub const BACK_ONLY: u8 = 16;
}

/// Which side of triangles a pass draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Faces {
    /// Both.
    Both,
    /// Counter-clockwise on screen.
    Front,
    /// Clockwise on screen.
    Back,
}

/// Transparent surfaces, peeled off sample by sample.
///
/// Layer 0 of a sample is the nearest triangle with [`pass_mask::LAYER`] (or hull triangle, see below), layer k the nearest behind
/// layer k - 1 by (depth, lowest id first), all of them in front of the visibility buffer's surface unless `behind_surface`. Each is
/// shaded as the surface is, and they lie over each other and over what the visibility buffer shows, nearest on top.
///
/// Where layers do not go on behind the surface, hull triangles are not in the visibility buffer but in the layers; one adds
/// nothing (but counts as a layer) where a nearer layer of the same sample belongs to the same material (modulo 32), because a
/// glass must not show its own outline on its far side. Where they do, everything filled is opaque, and so may the hull be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeelingPass {
    /// Layers that are looked for; what lies behind the last of them is not drawn.
    pub count_max: u32,
    /// Whether layers go on behind the surface: for wires that show through it.
    pub behind_surface: bool,
    /// Whether layers show wires alone, and the visibility buffer what has [`pass_mask::LAYER`] without its wires.
    pub wires_only: bool,
    /// What remains of wires from the second layer on, 0 to 1.
    pub fade: f32,
}

impl<'a> DrawPlan<'a> {
    /// A plan that draws nothing yet, at 1 sample a pixel, on nothing.
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
            positions,
            triangles,
            pass_masks: Cow::Borrowed(&[]),
            projection,
            surface: None,
            peeling: None,
            hull: None,
            lines: Vec::new(),
            background: [0.0; 4],
            skips: Vec::new(),
        }
    }

    /// The layers, where there are any to look for.
    pub fn peeling(&self) -> Option<&PeelingPass> {
        let has_triangles = self.surface.is_some() || self.hull.is_some();
        self.peeling.as_ref().filter(|layers| layers.count_max > 0 && has_triangles)
    }

    /// Whether the hull is drawn into the layers and not into the visibility buffer.
    pub fn has_peeled_hull(&self) -> bool {
        self.hull.is_some() && self.peeling().is_some_and(|layers| !layers.behind_surface)
    }

    /// What a triangle takes part in.
    #[inline(always)]
    pub fn pass_mask(&self, triangle: usize) -> u8 {
        self.pass_masks.get(triangle).copied().unwrap_or(pass_mask::SURFACE)
    }

    /// Whether any sample gets a colour.
    pub fn is_shaded(&self) -> bool {
        self.surface.as_ref().is_some_and(|surface| surface.is_shaded) || self.hull.is_some()
    }
}

/// Sample positions inside a pixel, in 1/256 pixel from its upper left corner: the standard patterns of Direct3D 11 and Vulkan.
///
/// No two share a row or a column, their mean is the pixel's centre, and all leave the same remainder modulo 16 (that of 16
/// samples is 8, because as many rows and columns in sixteenths have no symmetric places otherwise).
pub fn sample_offsets(samples: u32) -> &'static [[i32; 2]] {
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
