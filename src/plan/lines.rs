//! Lines of exact width.

use std::sync::Arc;

use super::DrawPlan;

/// Lines along edges, of one width and colour.
#[derive(Clone, Debug)]
pub struct LinePass {
    /// Each edge once. Passes may share a list.
    pub edges: Arc<[Edge]>,
    /// Full width, pixels.
    pub width_px: f32,
    /// Extra ramp, pixels.
    pub smoothing_px: f32,
    /// Premultiplied linear RGBA, opacity included.
    pub color: [f32; 4],
    /// Which parts of the edges, as the visibility buffer has it.
    pub shown: Shown,
    /// Whether an edge whose faces all look away can be left out: true for closed surfaces.
    pub skip_back_edges: bool,
    /// Whether only edges of this view's silhouette are drawn: those whose faces all lie on one side of them on screen.
    pub contour: bool,
    /// Whether the surface's light falls on the line; without a surface that is seen there is none, and the colour stays.
    pub lit: bool,
}

impl DrawPlan<'_> {
    /// Whether light has to be found for any line: one wants it, and there is a surface that has it.
    pub fn lights_lines(&self) -> bool {
        self.surface.as_ref().is_some_and(|surface| surface.is_shaded) && self.lines.iter().any(|lines| lines.lit)
    }
}

/// Which parts of an edge are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// All of it; the visibility buffer is not read.
    All,
    /// What no surface hides.
    Visible,
    /// What a surface hides.
    Hidden,
}

/// An edge and the first two faces it belongs to.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Edge {
    /// Indices into the positions.
    pub vertices: [u32; 2],
    /// Triangle indices; [`Edge::NO_FACE`] where there is no second face.
    pub faces: [u32; 2],
}

impl Edge {
    /// No triangle.
    pub const NO_FACE: u32 = u32::MAX;
}

/// Coverage in 1/1023 to ink: `-4096 log2(1 - c)`, so that the ink of lines that cross adds up as if they were independent,
/// in integers, whatever the order. Full coverage is 24 halvings.
pub fn ink_table() -> [u32; 1024] {
    std::array::from_fn(|q| match q {
        1023 => INK_FULL,
        _ => libm::round(-4096.0 * libm::log2(1.0 - q as f64 / 1023.0)) as u32,
    })
}

/// Ink of full coverage.
pub const INK_FULL: u32 = 24 * 4096;
