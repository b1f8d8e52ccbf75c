//! Lines and points of parts without a fill: lines of exact width like those along edges, in the colour and width of the part's own
//! lines. (Where there is a fill they are drawn with it, see `plan/primitives.rs`.)

use std::sync::Arc;

use crate::mesh::{LineOrPoint, Mesh};
use crate::plan::context::CHECK_EVERY;
use crate::plan::context::PlanContext;
use crate::plan::lines::styles::Want;
use crate::plan::primitives::{LINE_PX, POINT_PX};
use crate::plan::{Edge, LinePass, PlanError};
use crate::scene::material_groups::{Fill, MaterialGroups};
use crate::spec::{Hidden, Layers, Outline, WireMethod};

/// How much wider than a line a point is.
pub const POINT_WIDTH: f32 = (POINT_PX / LINE_PX) as f32;

/// The widest that lines get, pixels.
const WIDTH_MAX_PX: f32 = 100.0;

/// Whether a line or a point of the file is drawn as a line, and not as a part of the surface.
pub fn is_line(groups: &MaterialGroups<'_>, one: &LineOrPoint) -> bool {
    let layers = groups.layers.get(one.material as usize);
    layers.is_some_and(|layers| layers.wire.is_some() || layers.outline.is_some()) && !is_filled(groups, one)
}

/// Whether it is a part of the surface.
pub fn is_filled(groups: &MaterialGroups<'_>, one: &LineOrPoint) -> bool {
    groups.fill(one.material as usize) != Fill::None
}

/// What draws them; `hides` says whether there is a surface, and `contour_px` how wide an outline is.
pub fn passes(
    mesh: &Mesh,
    groups: &MaterialGroups<'_>,
    contour_px: impl Fn(&Outline) -> f32,
    hides: bool,
    cx: &mut PlanContext<'_>,
) -> Result<Vec<LinePass>, PlanError> {
    let mut passes = Vec::new();
    if mesh.lines_and_points.is_empty() {
        return Ok(passes);
    }
    for (kind, edges) in by_kind(mesh, groups, cx)?.into_iter().enumerate() {
        let (layers, is_point) = (&groups.looks[kind / 2], kind % 2 == 1);
        let want = want(layers, &contour_px, is_point).filter(Want::is_seen);
        let Some(want) = want.filter(|_| !edges.is_empty()) else { continue };
        let count = edges.len() as u64;
        let drawn = want.passes(&Arc::from(edges), hides, None);
        // In the lists of up to four bands of the picture.
        cx.budget.spend("lists of lines and points", drawn.len() as u64 * count, 16)?;
        passes.extend(drawn);
    }
    Ok(passes)
}

/// Of each look the lines, then the points. There may be many looks: all are looked for at once.
fn by_kind(mesh: &Mesh, groups: &MaterialGroups<'_>, cx: &mut PlanContext<'_>) -> Result<Vec<Vec<Edge>>, PlanError> {
    let kind_of = |one: &LineOrPoint| {
        let look = *groups.look_of.get(one.material as usize)? as usize;
        (look < groups.looks.len() && is_line(groups, one)).then_some(2 * look + usize::from(one.is_point()))
    };
    let mut counts = vec![0_usize; 2 * groups.looks.len()];
    for some in mesh.lines_and_points.chunks(CHECK_EVERY) {
        cx.deadline.check()?;
        some.iter().filter_map(kind_of).for_each(|kind| counts[kind] += 1);
    }
    let count = counts.iter().sum::<usize>() as u64;
    cx.budget.spend("drawn lines and points", count, 2 * size_of::<Edge>() as u64)?;
    let mut edges: Vec<Vec<Edge>> = counts.into_iter().map(Vec::with_capacity).collect();
    for some in mesh.lines_and_points.chunks(CHECK_EVERY) {
        cx.deadline.check()?;
        for one in some {
            if let Some(kind) = kind_of(one) {
                edges[kind].push(Edge::new(&mesh.positions, one.ends, [Edge::NO_FACE; 2]));
            }
        }
    }
    Ok(edges)
}

/// The style of a part's lines, or else of its outline. An edge that begins where it ends is a dot.
fn want(layers: &Layers, contour_px: impl Fn(&Outline) -> f32, is_point: bool) -> Option<Want> {
    let share = if is_point { POINT_WIDTH } else { 1.0 };
    let style = |width_px: f32, smoothing_px, color, hidden| {
        Want::everywhere((width_px * share).min(WIDTH_MAX_PX), smoothing_px, color, hidden)
    };
    match (layers.wire, layers.outline) {
        (Some(wire), _) if wire.method == WireMethod::Exact => {
            Some(style(wire.thickness, wire.smoothing, crate::plan::lines::build::color(&wire), wire.hidden))
        }
        // The others measure in multiples of a triangle's own size, and there is none.
        (Some(wire), _) => Some(style(LINE_PX as f32, 0.0, crate::plan::lines::build::color(&wire), wire.hidden)),
        (None, Some(outline)) => Some(style(contour_px(&outline), 0.0, outline.color.premultiplied(), Hidden::Hide)),
        (None, None) => None,
    }
}
