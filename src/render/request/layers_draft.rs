//! The draft of [`Layers`] (surface, wire, outline), which collects what a request says about them. It
//! begins with the layers of a style. The keys of the request change it, and those of each material
//! change a copy. Defaults that depend on other keys are settled at the end.

use super::error::{RequestError, RequestFault};
use crate::request::style::Style;
use crate::request::table::dependent::Dependent;
use crate::spec::color::Rgba;
use crate::spec::{Hidden, Layers, Outline, OutlineMethod, OutlineUnit, Shading, Surface, Wire, WireEdges, WireMethod};

/// Largest thickness of a wire whose method does not measure it in pixels.
pub const MULTIPLE_MAX: f32 = 10.0;

/// Largest outline in pixels: wider than any picture needs, and far from overflowing fixed point.
pub const OUTLINE_PX_MAX: f32 = 100.0;

/// The colour of [`Style::Xray`], a blue of films: `#1d5c96`.
const XRAY_COLOR: [u8; 4] = [0x1d, 0x5c, 0x96, 0xff];

/// Layers whose dependent defaults are still open.
#[derive(Clone, Debug)]
pub struct LayersDraft {
    /// The filled surface.
    pub surface: Option<Surface>,
    /// Lines along edges.
    pub wire: Option<WireDraft>,
    /// The line around the shape.
    pub outline: Option<Outline>,
    /// The style's treatment of hidden edges, unless the request gives one.
    hidden: Hidden,
}

/// A wire whose dependent defaults are still open.
#[derive(Clone, Copy, Debug, Default)]
pub struct WireDraft {
    /// The values that depend on no other key.
    pub line: Wire,
    /// By default exact, unless a quality target chooses.
    pub method: Dependent<WireMethod>,
    /// By default 0 for exact lines and 1 for the others.
    pub smoothing: Dependent<f32>,
    /// By default as the style has it.
    pub hidden: Dependent<Hidden>,
}

impl LayersDraft {
    /// The layers of a style.
    pub fn new(style: Style) -> Self {
        let surface = |shading| Some(Surface { shading, ..Surface::default() });
        let white = || surface(Shading::Unlit).map(|surface| Surface { color: Some(Rgba::WHITE), ..surface });
        let wire = Some(WireDraft::default());
        let (surface, wire, outline) = match style {
            Style::Flat | Style::Topology => (surface(Shading::Flat), None, None),
            Style::Auto | Style::Smooth => (surface(Shading::Smooth), None, None),
            Style::Unlit => (surface(Shading::Unlit), None, None),
            Style::Wire => (surface(Shading::Flat), wire, None),
            Style::Wireframe => (None, wire, None),
            Style::Outline => (surface(Shading::Smooth), None, Some(Outline::default())),
            Style::HiddenLine => (white(), wire, None),
            Style::Clay => (clay(), None, None),
            Style::Xray => (Some(xray()), None, None),
            Style::Technical => (surface(Shading::Smooth), Some(feature_edges()), Some(contour())),
        };
        let hidden = if style == Style::Wireframe { Hidden::Fade } else { Hidden::Hide };
        Self { surface, wire, outline, hidden }
    }

    /// True if there is a wire whose method may be chosen.
    pub fn has_open_wire(&self) -> bool {
        self.wire.is_some_and(|wire| !wire.method.is_given() && !wire.smoothing.is_given())
    }

    /// Settles defaults and limits that depend on several keys. `prefix` precedes the keys of a
    /// material.
    pub fn finish(&self, prefix: &str) -> Result<Layers, RequestError> {
        let too_thick = |key: &str, given: f32, allowed: String| {
            Err(RequestError::new(RequestFault::OutOfRange, &format!("{prefix}{key}"), given, allowed))
        };
        let wire = self.wire.map(|WireDraft { line, method, smoothing, hidden }| {
            let method = method.or(WireMethod::Exact);
            let smoothing = smoothing.or(if method == WireMethod::Exact { 0.0 } else { 1.0 });
            Wire { method, smoothing, hidden: hidden.or(self.hidden), ..line }
        });
        if let Some(Wire { method, thickness, .. }) = wire
            && method != WireMethod::Exact
            && thickness.largest() > MULTIPLE_MAX
        {
            let allowed = format!("a number from 0 to {MULTIPLE_MAX} where `{prefix}wire.method` is not exact");
            return too_thick("wire.thickness", thickness.largest(), allowed);
        }
        if let Some(Outline { unit: OutlineUnit::Px, thickness: Some(thickness), .. }) = self.outline
            && thickness > OUTLINE_PX_MAX
        {
            let allowed = format!("a number from 0 to {OUTLINE_PX_MAX} where `{prefix}outline.unit` is px");
            return too_thick("outline.thickness", thickness, allowed);
        }
        Ok(Layers { surface: self.surface, wire, outline: self.outline })
    }
}

/// The surface of [`Style::Clay`].
fn clay() -> Option<Surface> {
    let color = Some(Rgba([0.62, 0.56, 0.50, 1.0]));
    let (metallic, roughness) = (Some(0.0), Some(1.0));
    let emissive = Some(Rgba::BLACK);
    Some(Surface {
        shading: Shading::Smooth,
        color,
        metallic,
        roughness,
        emissive,
        textures: false,
        ..Surface::default()
    })
}

/// The surface of [`Style::Xray`]: one colour without light, so that the angle alone shows the form.
fn xray() -> Surface {
    let (color, emissive) = (Some(Rgba::from_srgb8(XRAY_COLOR)), Some(Rgba::BLACK));
    Surface { shading: Shading::Unlit, color, emissive, facing_opacity: 0.07, ..Surface::default() }
}

/// The lines of [`Style::Technical`]: 1 px wide, and none where the mesh only crumples.
fn feature_edges() -> WireDraft {
    let line = Wire { edges: WireEdges::Feature, min_length: 20.0, ..Wire::default() };
    WireDraft { line, ..WireDraft::default() }
}

/// The contour of [`Style::Technical`], twice as wide.
fn contour() -> Outline {
    let (method, unit) = (OutlineMethod::Contour, OutlineUnit::Px);
    Outline { method, unit, thickness: Some(2.0), ..Outline::default() }
}
