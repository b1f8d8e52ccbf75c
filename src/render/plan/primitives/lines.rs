//! Lines and points of the file whose material has no filled surface, but a wire or an outline. They
//! are drawn as lines of exact width in pixels, in the colour and width of the wire, or else of the
//! outline. A wire by another method than `exact` has no width in pixels, and is given a fixed one. A
//! point is a line of no length, which shows as a dot, wider by the factor `points.size_px` / 1.5.

use std::sync::Arc;

use super::is_line;
use crate::mesh::LineOrPoint;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::lines::styles::{LineStyle, wire_color};
use crate::plan::{Edge, LinePass, PlanError};
use crate::scene::{LINE_PX, Scene, point_width};
use crate::spec::{Hidden, Layers, WireMethod};

/// Largest width of these lines, pixels.
const WIDTH_MAX_PX: f32 = 100.0;

/// The passes that draw a mesh's lines and points as lines.
pub fn line_passes(scene: &Scene<'_, '_>, cx: &mut PlanContext<'_>) -> Result<Vec<LinePass>, PlanError> {
    let mut passes = Vec::new();
    if scene.mesh.lines_and_points.is_empty() {
        return Ok(passes);
    }
    for (kind, edges) in by_kind(scene, cx)?.into_iter().enumerate() {
        let (layers, is_point) = (&scene.groups.styles[kind / 2], kind % 2 == 1);
        let style = line_style(scene, layers, is_point).filter(LineStyle::is_seen);
        let Some(style) = style.filter(|_| !edges.is_empty()) else { continue };
        let count = edges.len() as u64;
        let pass = style.pass(&Arc::new(edges), scene.groups.hides_lines(), None);
        // Entries in the lists of up to four bands of the picture.
        cx.budget.spend("lists of lines and points", count, 16)?;
        passes.push(pass);
    }
    Ok(passes)
}

/// The lines, then the points of each style. All styles are collected in one go, because there may
/// be many.
fn by_kind(scene: &Scene<'_, '_>, cx: &mut PlanContext<'_>) -> Result<Vec<Vec<Edge>>, PlanError> {
    let Scene { mesh, groups, .. } = scene;
    let kind_of = |one: &LineOrPoint| {
        let style = *groups.style_of.get(one.material as usize)? as usize;
        (style < groups.styles.len() && is_line(groups, one)).then_some(2 * style + usize::from(one.is_point()))
    };
    let mut counts = vec![0_usize; 2 * groups.styles.len()];
    for chunk in mesh.lines_and_points.chunks(CHECK_EVERY) {
        cx.deadline.check()?;
        chunk.iter().filter_map(kind_of).for_each(|kind| counts[kind] += 1);
    }
    let count = counts.iter().sum::<usize>() as u64;
    cx.budget.spend("drawn lines and points", count, 2 * size_of::<Edge>() as u64)?;
    let mut edges: Vec<Vec<Edge>> = counts.into_iter().map(Vec::with_capacity).collect();
    for chunk in mesh.lines_and_points.chunks(CHECK_EVERY) {
        cx.deadline.check()?;
        for one in chunk {
            if let Some(kind) = kind_of(one) {
                edges[kind].push(Edge::new(&mesh.positions, one.ends, [Edge::NO_FACE; 2]));
            }
        }
    }
    Ok(edges)
}

/// The style of a material's wire, or else of its outline. An edge that begins where it ends is a
/// dot.
fn line_style(scene: &Scene<'_, '_>, layers: &Layers, is_point: bool) -> Option<LineStyle> {
    let share = if is_point { point_width(scene.spec) } else { 1.0 };
    let style = |width_px: f32, smoothing_px, color, hidden| {
        LineStyle::everywhere((width_px * share).min(WIDTH_MAX_PX), smoothing_px, color, hidden)
    };
    match (layers.wire, layers.outline) {
        (Some(wire), _) if wire.method == WireMethod::Exact => {
            Some(style(wire.thickness.largest(), wire.smoothing, wire_color(&wire), wire.hidden))
        }
        // The other methods measure in multiples of a triangle's size, and there is no triangle.
        (Some(wire), _) => Some(style(LINE_PX as f32, 0.0, wire_color(&wire), wire.hidden)),
        (None, Some(outline)) => {
            let width_px = scene.contour_width_px(&outline);
            Some(style(width_px, 0.0, outline.color.premultiplied(), Hidden::Hide))
        }
        (None, None) => None,
    }
}
