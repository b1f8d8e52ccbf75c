//! Whether a picture can show anything of its mesh.

use super::DrawPlan;

/// Whether each triangle lies behind the eye or wholly beyond one side of the picture: an explicit camera may look past the mesh.
///
/// Where it says so the picture is blank; a mesh that is missed by a hair may go unnoticed.
pub fn is_out_of_view(plan: &DrawPlan<'_>) -> bool {
    // Of a hull there is only what may be in the picture.
    let has_hull = plan.hull.as_ref().is_some_and(|hull| !hull.triangles.is_empty());
    let p = &plan.projection;
    if has_hull || plan.triangles.is_empty() {
        return false;
    }
    let half = [plan.width_px, plan.height_px].map(|size| 128.0 * size as f32 + 256.0 * reach_px(plan));
    let row = |row: [f32; 4], v: [f32; 3]| ((row[0] * v[0] + row[1] * v[1]) + row[2] * v[2]) + row[3];
    let distances = |v: u32| {
        let v = plan.positions[v as usize];
        let (x, y, w) = (row(p.x, v), row(p.y, v), row(p.w, v));
        [w - p.near_w, half[0] * w - x, half[0] * w + x, half[1] * w - y, half[1] * w + y]
    };
    // The first triangle that may be seen ends it.
    plan.triangles.iter().all(|triangle| {
        let corners = triangle.map(distances);
        (0..5).any(|side| corners.iter().all(|corner| corner[side] < 0.0))
    })
}

/// How far lines are drawn beside the mesh at most, and more.
fn reach_px(plan: &DrawPlan<'_>) -> f32 {
    plan.lines.iter().map(|lines| lines.width_px + lines.smoothing_px).fold(1.0, f32::max)
}
