//! Lines of exact width in pixels: wires, topology lines and contours along the mesh's edges, and line and
//! point primitives without a surface (`primitives`). A `LinePass` is a list of edges with a width and a
//! colour, as back-ends draw it. Distances that follow from its width, such as how far a line reaches, are
//! computed here, so that both back-ends use the same.

pub(crate) mod auto_width;
pub(crate) mod build;
pub(crate) mod fade;
pub(crate) mod picked_faces;
mod short_chains;
pub(crate) mod styles;

pub use crate::mesh::edges::Edge;
pub use build::passes;
pub use fade::LineFade;

use std::sync::Arc;

use super::{DrawPlan, Faces, SurfacePass};

/// Lines along edges, of one width and colour.
#[derive(Clone, Debug)]
pub struct LinePass {
    /// Each edge once, with two of its faces. In a pass of all edges, [`Edge::NO_FACE`] also stands
    /// for all but the first of more than two faces; in a contour those beside the widest gap are
    /// kept. Passes may share a list.
    pub edges: Arc<Vec<Edge>>,
    /// True if these are all edges of all triangles of the plan, and all triangles are opaque. Then holes in faces may
    /// tell the lines' coverage ([`DrawPlan::has_holes_under`]).
    pub is_complete: bool,
    /// True if a short visible part beside a hidden one is drawn even where a thin face that no sample sees may hide
    /// it. True where all edges of an opaque mesh are drawn: the thin face's own lines cover the place.
    /// So plans have it where a pass is complete. Tests set it alone, to compare strokes with holes.
    pub keeps_short_parts: bool,
    /// Full width, pixels.
    pub width_px: f32,
    /// Width of the soft ramp, both sides together, pixels.
    pub smoothing_px: f32,
    /// Premultiplied linear RGBA, opacity included.
    pub color: [f32; 4],
    /// Multiplies the colour, from place to place in the picture; None: by 1.
    pub fade: Option<Arc<LineFade>>,
    /// The parts of the edges that are drawn, as the visibility buffer has it.
    pub shown: Shown,
    /// The side of all faces that lies inside a closed surface, on which every edge has two faces that run
    /// along it in opposite directions. An edge is left out if all its faces show this side to the viewer.
    /// None: no edge is left out for this reason.
    pub unseen_side: Option<FaceSide>,
    /// True if only this view's silhouette edges are drawn: edges whose faces all lie on one side
    /// of them on screen.
    pub contour: bool,
    /// True if the surface's light changes the line's colour. It does not where no surface is
    /// visible.
    pub lit: bool,
    /// True if the plan's layers tint lines that lie behind them.
    pub is_tinted: bool,
}

impl LinePass {
    /// Largest number that areas around a line's end are scaled to. They fit 16 bits, and so does
    /// the difference of two.
    pub const SCALED_MAX: f32 = 16_000.0;

    /// Opaque white lines along some edges, all of one width. They have no ramps, no surface hides them, and they are
    /// neither lit nor tinted.
    pub fn new(edges: Arc<Vec<Edge>>, width_px: f32) -> LinePass {
        LinePass {
            edges,
            is_complete: false,
            keeps_short_parts: false,
            width_px,
            smoothing_px: 0.0,
            color: [1.0; 4],
            fade: None,
            shown: Shown::All,
            unseen_side: None,
            contour: false,
            lit: false,
            is_tinted: false,
        }
    }

    /// Distance from the middle of a line to the farthest pixel centre that it touches, pixels:
    /// half its width, half its ramp, and half a pixel's diagonal.
    pub fn reach_px(&self) -> f32 {
        0.5 * self.width_px + 0.5 * self.smoothing_px + std::f32::consts::FRAC_1_SQRT_2
    }

    /// A layer tints a line that it is nearer than even when moved this far down its slope, 1/256 px: three times the
    /// largest distance between a sample of a pixel that the line touches and its middle. A round surface drops to its
    /// contour by twice the slope that is seen close to it, and by up to three times that within half its radius.
    pub fn tint_reach(&self) -> f32 {
        3.0 * 256.0 * (self.reach_px() + 1.0)
    }

    /// Coverage in the middle of a line by its ramp alone, 0 to 1.
    pub fn peak(&self) -> f32 {
        if self.smoothing_px > self.width_px { self.width_px / self.smoothing_px } else { 1.0 }
    }

    /// Width of a face, pixels, from which on a sample always sees it, for a number of samples per pixel: the
    /// diameter of the largest circle without a sample (1.415, .791, .525 and .386 px), rounded up.
    pub fn unseen_width_px(samples: u32) -> f32 {
        match samples {
            1 => 1.5,
            4 => 0.8,
            8 => 0.55,
            _ => 0.4,
        }
    }

    /// Widths of lines whose coverage holes in faces may tell, pixels, for a number of samples per
    /// pixel.
    ///
    /// Around each point of a visible inset lies a disc of the face, as wide as the line. So a sample
    /// sees it. Wide lines leave few holes.
    pub fn holes_width_px(samples: u32) -> std::ops::RangeInclusive<f32> {
        Self::unseen_width_px(samples)..=8.0
    }

    /// Length of a visible part beside a hidden one, pixels, up to which a face without a sample may hide it. At
    /// most 1 px: an edge is looked at only that far beyond what its line reaches. 0 where short parts are kept.
    pub fn unseen_part_px(&self, samples: u32) -> f32 {
        if self.keeps_short_parts { 0.0 } else { Self::unseen_width_px(samples).min(1.0) }
    }

    /// Number of a pixel's samples that may show something farther than such a part, while it is still taken for
    /// hidden. A contour often disappears close to the border of what hides it; there a sample may see past that
    /// border.
    pub fn farther_samples_max(&self, samples: u32) -> u32 {
        if self.contour { samples / 4 } else { 0 }
    }

    /// Pixels up to this far from one in which a face is hidden in part are marked: the visible part
    /// of its lines may end there.
    pub fn hidden_reach_px(&self) -> u32 {
        (0.5 * self.width_px) as u32 + 1
    }

    /// Length of the windows in which an edge's visible parts are looked for, pixels.
    ///
    /// Windows are longer for wide lines; otherwise most pixels around a window would belong to its
    /// neighbours. They are at most 24 px long, because the search for each visible part takes
    /// the whole window.
    pub fn window_px(&self) -> f32 {
        (0.5 * self.reach_px()).clamp(8.0, 24.0)
    }

    /// The exponent of the largest power of two that scales areas around the line's end to at most
    /// [`LinePass::SCALED_MAX`].
    pub fn square_exponent(&self) -> u32 {
        let outer = 0.5 * self.width_px + 0.5 * self.smoothing_px;
        (1..=13).rev().find(|&e| (outer + 1.5) * (1 << e) as f32 <= Self::SCALED_MAX).unwrap_or(1)
    }

    /// Rows above and below a band that are searched for triangles that hide the band's lines.
    pub fn margin_rows(&self) -> u32 {
        if self.shown == Shown::All { 0 } else { (self.window_px() + 2.0 * self.reach_px() + 4.0) as u32 }
    }
}

impl DrawPlan<'_> {
    /// Rows above and below a band that its lines need: 0 if no surface can hide lines.
    pub fn line_margin_rows(&self) -> u32 {
        let something_hides = self.surface.is_some() || self.hull.is_some();
        self.lines.iter().map(LinePass::margin_rows).filter(|_| something_hides).max().unwrap_or(0)
    }

    /// True if a surface may hide some line.
    pub fn hides_lines(&self) -> bool {
        let something_hides = self.surface.is_some() || self.hull.is_some();
        something_hides && self.lines.iter().any(|lines| lines.shown != Shown::All)
    }

    /// True if the parts of a pass's edges that a surface hides are drawn too, fainter.
    pub fn fades_hidden(&self, lines: &LinePass) -> bool {
        let something_hides = self.surface.is_some() || self.hull.is_some();
        something_hides && lines.shown == Shown::Faded
    }

    /// True if any pass may find the coverage of its lines by holes in faces.
    pub fn has_holes(&self) -> bool {
        self.lines.iter().any(|lines| self.has_holes_under(lines))
    }

    /// True if a pass may find the coverage of its lines by holes in faces: lines of all edges of an
    /// opaque surface that hides what lies behind it, without ramps, of the widths that the samples
    /// allow.
    pub fn has_holes_under(&self, lines: &LinePass) -> bool {
        let is_whole = |surface: &SurfacePass<'_>| surface.faces == Faces::Both;
        lines.is_complete
            && lines.shown != Shown::All
            && lines.smoothing_px == 0.0
            && LinePass::holes_width_px(self.samples).contains(&lines.width_px)
            && self.surface.as_ref().is_some_and(is_whole)
    }

    /// True if any pass finds what whole edges cover by fringes of faces.
    pub fn has_fringes(&self) -> bool {
        self.lines.iter().any(|lines| self.has_fringes_under(lines))
    }

    /// True if a pass finds what whole edges cover by fringes of faces: one that fades the hidden parts of all edges.
    pub fn has_fringes_under(&self, lines: &LinePass) -> bool {
        self.fades_hidden(lines) && self.has_holes_under(lines)
    }

    /// True if layers tint any line.
    pub fn tints_lines(&self) -> bool {
        self.lines.iter().any(|lines| self.tints(lines))
    }

    /// True if layers tint the lines of a pass.
    pub fn tints(&self, lines: &LinePass) -> bool {
        lines.is_tinted && self.peeling().is_some()
    }

    /// True if any line is lit and there is a visible surface to take the light from.
    pub fn lights_lines(&self) -> bool {
        self.surface.as_ref().is_some_and(|surface| surface.is_shaded) && self.lines.iter().any(|lines| lines.lit)
    }
}

/// A side of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaceSide {
    /// The side from which its corners run counter-clockwise.
    Front,
    /// The side from which its corners run clockwise.
    Back,
}

/// The parts of an edge that are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// All of it; the visibility buffer is not read.
    All,
    /// The parts that no surface hides.
    Visible,
    /// All of it. The parts that a surface hides are fainter ([`FADE`](crate::plan::FADE)), and lie beside the others.
    Faded,
}
