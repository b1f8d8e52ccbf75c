//! [`Layers`] in the making: those of a style, of the document, or of one of its materials.

use super::error::{RequestError, RequestFault};
use crate::request::table::words::Style;
use crate::spec::color::Rgba;
use crate::spec::{
    Cull, DebugView, FlatNormals, Hidden, Layers, Outline, OutlineMethod, OutlineUnit, Shading, Surface, Wire,
    WireEdges, WireMethod,
};

/// Largest thickness of a wire that is no width in pixels but a multiple of what its method measures in.
pub const MULTIPLE_MAX: f32 = 10.0;

/// Largest outline in pixels: wider than any picture's border needs, and far from overflowing fixed point.
pub const OUTLINE_PX_MAX: f32 = 100.0;

/// Layers whose dependent defaults are still open.
#[derive(Clone, Debug)]
pub struct Look {
    surface: Option<Surface>,
    wire: Option<WireDraft>,
    outline: Option<Outline>,
    /// What becomes of hidden edges where nobody says: a style's business.
    hidden: Hidden,
}

#[derive(Clone, Copy, Debug)]
struct WireDraft {
    wire: Wire,
    /// None: 0 for exact lines, 1 for the others.
    smoothing: Option<f32>,
    /// Whether the request names the method.
    has_method: bool,
}

impl Look {
    /// A style's layers.
    pub fn new(style: Style) -> Self {
        let surface = |shading| Some(Surface { shading, ..SURFACE });
        let white = Some(Surface { shading: Shading::Unlit, color: Some(Rgba::WHITE), ..SURFACE });
        let hidden = if style == Style::Wireframe { Hidden::Fade } else { Hidden::Hide };
        let (surface, has_wire, outline) = match style {
            Style::Flat | Style::Topology => (surface(Shading::Flat), false, None),
            Style::Smooth => (surface(Shading::Smooth), false, None),
            Style::Unlit => (surface(Shading::Unlit), false, None),
            Style::Wire => (surface(Shading::Flat), true, None),
            Style::Wireframe => (None, true, None),
            Style::Outline => (surface(Shading::Smooth), false, Some(OUTLINE)),
            Style::HiddenLine => (white, true, None),
        };
        let mut look = Self { surface, wire: None, outline, hidden };
        look.turn_wire(has_wire);
        look
    }

    /// The surface layer, turned on by being spoken of.
    pub fn surface(&mut self) -> &mut Surface {
        self.surface.get_or_insert(SURFACE)
    }

    /// The wire layer, turned on by being spoken of.
    pub fn wire(&mut self) -> &mut Wire {
        &mut self.wire_draft().wire
    }

    /// The wire's smoothing, which otherwise depends on its method.
    pub fn set_smoothing(&mut self, smoothing: f32) {
        self.wire_draft().smoothing = Some(smoothing);
    }

    /// The wire's method, which is then no longer open.
    pub fn set_method(&mut self, method: WireMethod) {
        let draft = self.wire_draft();
        (draft.wire.method, draft.has_method) = (method, true);
    }

    /// Whether there is a wire, and nobody said how it is drawn.
    pub fn has_open_wire(&self) -> bool {
        self.wire.is_some_and(|draft| !draft.has_method && draft.smoothing.is_none())
    }

    /// The outline layer, turned on by being spoken of.
    pub fn outline(&mut self) -> &mut Outline {
        self.outline.get_or_insert(OUTLINE)
    }

    /// Turns the surface on or off.
    pub fn turn_surface(&mut self, on: bool) {
        self.surface = on.then(|| *self.surface());
    }

    /// Turns the wire on or off.
    pub fn turn_wire(&mut self, on: bool) {
        self.wire = on.then(|| *self.wire_draft());
    }

    /// Turns the outline on or off.
    pub fn turn_outline(&mut self, on: bool) {
        self.outline = on.then(|| *self.outline());
    }

    /// Settles what depends on several keys. `prefix` stands before the keys of a material.
    pub fn finish(&self, prefix: &str) -> Result<Layers, RequestError> {
        let too_thick = |key: &str, given: f32, allowed: String| {
            Err(RequestError::new(RequestFault::OutOfRange, &format!("{prefix}{key}"), given, allowed))
        };
        let wire = self.wire.map(|WireDraft { wire, smoothing, .. }| {
            let default = if wire.method == WireMethod::Exact { 0.0 } else { 1.0 };
            Wire { smoothing: smoothing.unwrap_or(default), ..wire }
        });
        if let Some(Wire { method, thickness, .. }) = wire
            && method != WireMethod::Exact
            && thickness > MULTIPLE_MAX
        {
            let allowed = format!("a number from 0 to {MULTIPLE_MAX} where `{prefix}wire.method` is not exact");
            return too_thick("wire.thickness", thickness, allowed);
        }
        if let Some(Outline { unit: OutlineUnit::Px, thickness: Some(thickness), .. }) = self.outline
            && thickness > OUTLINE_PX_MAX
        {
            let allowed = format!("a number from 0 to {OUTLINE_PX_MAX} where `{prefix}outline.unit` is px");
            return too_thick("outline.thickness", thickness, allowed);
        }
        Ok(Layers { surface: self.surface, wire, outline: self.outline })
    }

    fn wire_draft(&mut self) -> &mut WireDraft {
        let wire = Wire { hidden: self.hidden, ..WIRE };
        self.wire.get_or_insert(WireDraft { wire, smoothing: None, has_method: false })
    }
}

const SURFACE: Surface = Surface {
    shading: Shading::Flat,
    normals: FlatNormals::Face,
    color: None,
    metallic: None,
    roughness: None,
    emissive: None,
    opacity: 1.0,
    textures: true,
    debug: DebugView::None,
    cull: Cull::None,
};

const WIRE: Wire = Wire {
    method: WireMethod::Exact,
    color: Rgba::BLACK,
    thickness: 1.0,
    smoothing: 0.0,
    opacity: 1.0,
    lit: false,
    edges: WireEdges::Triangles,
    feature_angle_deg: 30.0,
    hidden: Hidden::Hide,
};

const OUTLINE: Outline =
    Outline { method: OutlineMethod::Hull, color: Rgba::BLACK, thickness: None, unit: OutlineUnit::Object };
