//! Warnings about a request that does not go with its mesh: a material that the mesh does not have, lines
//! and points that no layer draws, or a camera that looks past the mesh. The picture is drawn
//! nevertheless.

use std::collections::BTreeSet;

use super::DrawPlan;
use super::primitives::{is_filled, is_line};
use crate::scene::Scene;
use crate::warning::Warning;

/// Warns of styles for materials that the mesh does not have: most likely a misspelt name.
pub fn unknown_materials(scene: &Scene<'_, '_>) -> Option<Warning> {
    const SHOWN_MAX: usize = 12;
    let quoted = |name: &str| format!("{:?}", name.chars().take(40).collect::<String>());
    let known: BTreeSet<&str> = scene.mesh.materials.iter().map(|slot| slot.name.as_str()).collect();
    let mut unknown = scene.spec.materials.iter().map(|(name, _)| name.as_str()).filter(|name| !known.contains(name));
    let first = unknown.next()?;
    let more = match unknown.count() {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    let has: Vec<String> = known.iter().take(SHOWN_MAX).map(|name| quoted(name)).collect();
    let etc = if known.len() > SHOWN_MAX { ", ..." } else { "" };
    let detail = format!("the mesh has no material {}{more}; it has {}{etc}", quoted(first), has.join(", "));
    Some(Warning { code: "material_unknown", detail })
}

/// Warns of lines and points that no part of their style draws.
pub fn undrawn_primitives(scene: &Scene<'_, '_>) -> Option<Warning> {
    let groups = &scene.groups;
    let is_undrawn = scene.mesh.lines_and_points.iter().any(|one| !is_filled(groups, one) && !is_line(groups, one));
    let detail = "lines and points are drawn with a surface, a wire or an outline, and the look has none";
    is_undrawn.then(|| Warning { code: "lines_not_drawn", detail: detail.to_owned() })
}

/// Warns of a picture that shows nothing of its mesh.
pub fn out_of_view(plan: &DrawPlan<'_>) -> Option<Warning> {
    let detail = "the camera looks past the whole mesh, and the picture is blank";
    is_out_of_view(plan).then(|| Warning { code: "mesh_out_of_view", detail: detail.to_owned() })
}

/// True if each triangle lies behind the eye or wholly beyond one side of the picture: an explicit
/// camera may look past the mesh.
///
/// If so, the picture is blank. A mesh that is missed narrowly may go unnoticed.
pub fn is_out_of_view(plan: &DrawPlan<'_>) -> bool {
    // A hull holds only triangles that may be in the picture.
    let has_hull = plan.hull.as_ref().is_some_and(|hull| !hull.triangles.is_empty());
    let p = &plan.projection;
    if has_hull || plan.triangles.is_empty() {
        return false;
    }
    let half = [plan.width_px, plan.height_px].map(|size| 128.0 * size as f32 + 256.0 * reach_px(plan));
    // As the back-ends round it: what is said to be blank is.
    let row = |row: [f32; 4], v: [f32; 3]| ((row[0] * v[0] + row[1] * v[1]) + row[2] * v[2]) + row[3];
    let distances = |v: u32| {
        let v = plan.positions[v as usize];
        let (x, y, w) = (row(p.x, v), row(p.y, v), row(p.w, v));
        [w - p.near_w, half[0] * w - x, half[0] * w + x, half[1] * w - y, half[1] * w + y]
    };
    // The first triangle that may be seen ends the search.
    plan.triangles.iter().all(|triangle| {
        let corners = triangle.map(distances);
        (0..5).any(|side| corners.iter().all(|corner| corner[side] < 0.0))
    })
}

/// An upper bound on how far lines are drawn beside the mesh.
fn reach_px(plan: &DrawPlan<'_>) -> f32 {
    plan.lines.iter().map(|lines| lines.width_px + lines.smoothing_px).fold(1.0, f32::max)
}
