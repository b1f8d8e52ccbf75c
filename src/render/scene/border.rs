//! The space that outlines, lines and points take around a mesh. Where the camera is fitted to the
//! mesh, it is fitted to this space, too, so that the picture does not cut them off. The reach of the
//! ground's shadow is added apart: it does not make the picture wider, but the camera's depth range has
//! room for it.

use super::camera::Border;
use super::ground::ground_distance;
use super::material_groups::MaterialGroups;
use crate::mesh::{LineOrPoint, Mesh};
use crate::spec::{Outline, OutlineMethod, OutlineUnit, Spec, WireMethod};

/// Width of a line primitive that is drawn with a surface, pixels.
pub const LINE_PX: f64 = 1.5;

/// A point's diameter in multiples of a line's width, where both are drawn as lines.
pub fn point_width(spec: &Spec) -> f32 {
    spec.points.size_px / LINE_PX as f32
}

/// Default width of an outline in pixels.
const OUTLINE_PX: f32 = 3.0;

/// Default thickness of an outline as a share of the mesh's longest side: 0.03 for a model of side
/// 2.
const OUTLINE_OBJECT_SHARE: f32 = 0.015;

/// Largest thickness in units of the box. An outline thicker than the guard band is wide shows
/// nothing but itself.
const OUTLINE_OBJECT_MAX: f32 = 16.0;

/// The distance that an outline reaches from its silhouette edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thickness {
    /// In units of the box, as seen at each point's depth.
    Object(f32),
    /// On screen, in pixels.
    Px(f32),
}

/// The room that the widest outline, the widest line and the points need.
pub fn border(mesh: &Mesh, groups: &MaterialGroups<'_>, spec: &Spec) -> Border {
    let has_points = mesh.lines_and_points.iter().any(LineOrPoint::is_point);
    let widest_px = if has_points { LINE_PX.max(f64::from(spec.points.size_px)) } else { 2.0 * LINE_PX };
    let mut border =
        Border { px: if mesh.lines_and_points.is_empty() { 0.0 } else { 0.5 * widest_px }, ..Border::default() };
    if groups.has_ground() {
        border.around = ground_distance(mesh);
    }
    for style in &groups.styles {
        // Points without a fill are drawn as lines are, but wider.
        let has_dots = style.surface.is_none() && has_points;
        let dots = if has_dots { point_width(spec) } else { 1.0 };
        if let Some(outline) = &style.outline {
            // The inner half of a contour lies on the surface.
            let share = if outline.method == OutlineMethod::Contour { 0.5 * f64::from(dots) } else { 1.0 };
            match outline_thickness(mesh, outline) {
                Thickness::Object(grow) => border.grow = border.grow.max(share * f64::from(grow)),
                Thickness::Px(px) => border.px = border.px.max(share * f64::from(px)),
            }
        }
        if let Some(wire) = style.wire.filter(|wire| wire.method == WireMethod::Exact) {
            border.px = border.px.max(f64::from(0.5 * (dots * wire.thickness.largest() + wire.smoothing)));
        }
    }
    if let Some(topology) = &spec.topology {
        border.px = border.px.max(f64::from(1.25 * topology.thickness));
    }
    border
}

/// The requested thickness of an outline, or the default for its unit.
pub fn outline_thickness(mesh: &Mesh, outline: &Outline) -> Thickness {
    match outline.unit {
        OutlineUnit::Px => Thickness::Px(outline.thickness.unwrap_or(OUTLINE_PX)),
        OutlineUnit::Object => {
            let [low, high] = mesh.bounds;
            let side = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
            let requested = outline.thickness.map(|t| (f64::from(t) / mesh.to_file.scale) as f32);
            Thickness::Object(requested.unwrap_or(OUTLINE_OBJECT_SHARE * side).min(OUTLINE_OBJECT_MAX))
        }
    }
}
