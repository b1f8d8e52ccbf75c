//! Lines and points of parts without a fill: lines of exact width like those along edges, in the colour and width of the part's own
//! lines. (Where there is a fill they are drawn with it, see `plan/loose.rs`.)

use std::sync::Arc;

use super::wants::Want;
use crate::mesh::{Loose, Mesh};
use crate::plan::build::Means;
use crate::plan::loose::{LINE_PX, POINT_PX};
use crate::plan::parts::{Fill, Parts};
use crate::plan::{Edge, LinePass, PlanError};
use crate::scene::{Hidden, Layers, Outline, WireMethod};

/// How much wider than a line a point is.
pub const POINT_WIDTH: f32 = (POINT_PX / LINE_PX) as f32;

/// The widest that lines get, pixels.
const WIDTH_MAX_PX: f32 = 100.0;

/// Whether a line or a point of the file is drawn as a line, and not as a part of the surface.
pub fn is_line(parts: &Parts<'_>, one: &Loose) -> bool {
    let layers = parts.layers.get(one.material as usize);
    layers.is_some_and(|layers| layers.wire.is_some() || layers.outline.is_some()) && !is_filled(parts, one)
}

/// Whether it is a part of the surface.
pub fn is_filled(parts: &Parts<'_>, one: &Loose) -> bool {
    parts.fill(one.material as usize) != Fill::None
}

/// What draws them; `hides` says whether there is a surface, and `contour_px` how wide an outline is.
pub fn passes(
    mesh: &Mesh,
    parts: &Parts<'_>,
    contour_px: impl Fn(&Outline) -> f32,
    hides: bool,
    means: &mut Means<'_>,
) -> Result<Vec<LinePass>, PlanError> {
    let mut passes = Vec::new();
    if mesh.loose.is_empty() {
        return Ok(passes);
    }
    for (look, layers) in parts.looks.iter().enumerate() {
        for is_point in [false, true] {
            let Some(want) = want(layers, &contour_px, is_point).filter(Want::is_seen) else { continue };
            means.deadline.check()?;
            let is_of = |one: &&Loose| {
                let own = parts.look_of.get(one.material as usize).is_some_and(|&of| of as usize == look);
                own && one.is_point() == is_point && is_line(parts, one)
            };
            let count = mesh.loose.iter().filter(is_of).count() as u64;
            if count == 0 {
                continue;
            }
            means.budget.spend("drawn lines and points", count, 2 * size_of::<Edge>() as u64)?;
            let mut edges = Vec::with_capacity(count as usize);
            edges.extend(
                mesh.loose.iter().filter(is_of).map(|one| Edge::new(&mesh.positions, one.ends, [Edge::NO_FACE; 2])),
            );
            let drawn = want.passes(&Arc::from(edges), hides, None);
            // In the lists of up to four bands of the picture.
            means.budget.spend("lists of lines and points", drawn.len() as u64 * count, 16)?;
            passes.extend(drawn);
        }
    }
    Ok(passes)
}

/// The style of a part's lines, or else of its outline. An edge that begins where it ends is a dot.
fn want(layers: &Layers, contour_px: impl Fn(&Outline) -> f32, is_point: bool) -> Option<Want> {
    let share = if is_point { POINT_WIDTH } else { 1.0 };
    let style = |width_px: f32, smoothing_px, color, hidden| {
        Want::everywhere((width_px * share).min(WIDTH_MAX_PX), smoothing_px, color, hidden)
    };
    match (layers.wire, layers.outline) {
        (Some(wire), _) if wire.method == WireMethod::Exact => {
            Some(style(wire.thickness, wire.smoothing, super::color(&wire), wire.hidden))
        }
        // The others measure in multiples of a triangle's own size, and there is none.
        (Some(wire), _) => Some(style(LINE_PX as f32, 0.0, super::color(&wire), wire.hidden)),
        (None, Some(outline)) => Some(style(contour_px(&outline), 0.0, outline.color.premultiplied(), Hidden::Hide)),
        (None, None) => None,
    }
}
