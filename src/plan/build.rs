//! Spec and mesh to plan: what each look needs, and what it does not.

use super::context::PlanContext;
use super::edges::Edges;
use super::skips::{SkipKind, Skips};
use super::{DrawPlan, HullPass, PeelingPass, PlanError, Projection, Thickness, margin};
use super::{lines, outline, primitives, surface};
use crate::limits::{Budget, Deadline, LimitExceeded};
use crate::mesh::{LineOrPoint, Mesh};
use crate::plan::lines::primitives::POINT_WIDTH;
use crate::scene::camera::{Border, Camera};
use crate::scene::material_groups::MaterialGroups;
use crate::spec::{Outline, OutlineMethod, OutlineUnit, Spec, WireMethod};

/// Width of an outline in pixels where the request does not say.
const OUTLINE_PX: f32 = 3.0;

/// Thickness of an outline where the request does not say, as a share of the mesh's longest side: 0.03 for a model of
/// side 2.
const OUTLINE_OBJECT_SHARE: f32 = 0.015;

/// Bytes that a back-end takes for a vertex on screen.
pub(super) const VERTEX_BYTES: u64 = 32;

/// Bytes for a triangle: up to eight entries in the lists of what each part of the picture has to draw.
pub(super) const LISTED_BYTES: u64 = 8 * 4;

/// Bytes more where a plan has layers: a triangle may be in the visibility buffer's lists and in theirs, and each thread notes which are
/// done with.
pub(super) const LAYERED_BYTES: u64 = 32;

/// Decides what is drawn.
pub fn build<'a>(
    mesh: &'a Mesh,
    spec: &Spec,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<DrawPlan<'a>, PlanError> {
    build_keeping(mesh, spec, budget, deadline, &[])
}

/// As [`build`], but nothing in `keep` is skipped, for tests: the picture is the same to the byte.
pub fn build_keeping<'a>(
    mesh: &'a Mesh,
    spec: &Spec,
    budget: &mut Budget,
    deadline: &Deadline,
    keep: &[SkipKind],
) -> Result<DrawPlan<'a>, PlanError> {
    let mut cx = PlanContext { budget, deadline };
    let size_px = [spec.image.width_px, spec.image.height_px];
    cx.budget.spend("materials", mesh.materials.len() as u64, 272)?;
    let groups = MaterialGroups::new(mesh, spec);
    pay(mesh, size_px, &groups, cx.budget)?;
    if spec.camera.from_file && mesh.cameras.is_empty() {
        return Err(PlanError::NoCamera);
    }

    let mut skips = Skips::new(keep);
    let camera = Camera::place(&spec.camera, mesh, size_px, border(mesh, &groups, spec));
    let contour_px = |outline: &Outline| contour_px(mesh, outline, &camera, size_px);
    let mut edges = Edges::default();
    let lines =
        lines::passes(mesh, spec, &groups, (contour_px, camera.contains_mesh), &mut edges, &mut skips, &mut cx)?;
    let surface = surface::surface_pass(mesh, spec, &groups, &camera, &mut edges, &mut skips, &mut cx)?;
    let all_clipped = projection(&camera, size_px, true);
    let hides = surface.is_some() || groups.has_hull();
    let margin_px = margin::margin_px(mesh, (&all_clipped, size_px), (&lines, hides), &mut skips, deadline)?;
    let no_hull = skips.skip(SkipKind::Hull, !groups.has_hull(), "the look has no hull");
    let hull = match (no_hull, groups.has_hull()) {
        (true, _) => None,
        (false, false) => Some(HullPass::default()),
        (false, true) => {
            Some(outline::hull_pass(mesh, &groups, (&all_clipped, size_px, margin_px), &mut edges, &mut cx)?)
        }
    };
    let layers = layers_pass(&groups, hull.is_some(), &mut skips);
    let pass_masks = groups.pass_masks(mesh, surface.is_some(), layers.as_ref());
    let unclipped = skips.skip(
        SkipKind::Clipping,
        camera.contains_mesh,
        "the whole mesh lies between the eye and the picture's guard band",
    );
    Ok(DrawPlan {
        width_px: size_px[0],
        height_px: size_px[1],
        margin_px,
        samples: spec.image.samples,
        positions: &mesh.positions,
        triangles: &mesh.triangles,
        pass_masks,
        projection: projection(&camera, size_px, !unclipped),
        surface,
        peeling: layers,
        hull,
        lines,
        background: spec.image.background.premultiplied(),
        skips: skips.done,
    })
}

/// Spends what the plan and both back-ends will allocate.
fn pay(mesh: &Mesh, size_px: [u32; 2], groups: &MaterialGroups<'_>, budget: &mut Budget) -> Result<(), LimitExceeded> {
    let pixels = u64::from(size_px[0]) * u64::from(size_px[1]);
    budget.spend("the picture", pixels, 4)?;
    budget.spend("vertices on screen", mesh.positions.len() as u64, VERTEX_BYTES)?;
    // And a role.
    budget.spend("lists of triangles", mesh.triangles.len() as u64, LISTED_BYTES + 1)?;
    if groups.layers_pass().is_some() {
        // What layers need a sample is bounded: they are drawn band by band.
        budget.spend("lists of layers", mesh.triangles.len() as u64, LAYERED_BYTES)?;
    }
    let is_smooth = groups.looks.iter().any(|l| l.surface.is_some_and(|s| s.shading == crate::spec::Shading::Smooth));
    if is_smooth && mesh.normals.is_empty() {
        // Sums in f64, then the unit normals in f32.
        budget.spend("vertex normals", mesh.positions.len() as u64, 36)?;
    }
    Ok(())
}

/// The camera's rows.
pub fn projection(camera: &Camera, size_px: [u32; 2], clip: bool) -> Projection {
    let [x, y, z, w] = camera.rows(size_px);
    let [right, up, back] = camera.axes.map(|axis| axis.as_vec3().to_array());
    // In an orthographic view W is 1 and nothing is behind the eye.
    let near_w = if w[3] == 1.0 && w[..3] == [0.0; 3] { 0.5 } else { camera.near as f32 };
    Projection { x, y, z, w, near_w, clip, to_viewer: back, screen_up: up, screen_right: right }
}

/// What the widest outline and the widest line ask for.
pub(super) fn border(mesh: &Mesh, groups: &MaterialGroups<'_>, spec: &Spec) -> Border {
    let mut border = Border {
        px: if mesh.lines_and_points.is_empty() { 0.0 } else { 0.5 * primitives::POINT_PX },
        ..Border::default()
    };
    let has_points = mesh.lines_and_points.iter().any(LineOrPoint::is_point);
    for layers in &groups.looks {
        // Points that no fill draws are wider than lines.
        let has_dots = layers.surface.is_none() && has_points;
        let dots = if has_dots { POINT_WIDTH } else { 1.0 };
        if let Some(outline) = &layers.outline {
            // Half of a contour lies on the surface itself; a point has nothing but its own.
            let share = if outline.method == OutlineMethod::Contour { 0.5 * f64::from(dots) } else { 1.0 };
            match thickness(mesh, outline) {
                Thickness::Object(grow) => border.grow = border.grow.max(share * f64::from(grow)),
                Thickness::Px(px) => border.px = border.px.max(share * f64::from(px)),
            }
        }
        if let Some(wire) = layers.wire.filter(|wire| wire.method == WireMethod::Exact) {
            border.px = border.px.max(f64::from(0.5 * (dots * wire.thickness + wire.smoothing)));
        }
    }
    if let Some(topology) = &spec.topology {
        border.px = border.px.max(f64::from(1.25 * topology.thickness));
    }
    border
}

/// How far an outline reaches.
pub fn thickness(mesh: &Mesh, outline: &Outline) -> Thickness {
    match outline.unit {
        OutlineUnit::Px => Thickness::Px(outline.thickness.unwrap_or(OUTLINE_PX)),
        OutlineUnit::Object => {
            let [low, high] = mesh.bounds;
            let side = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
            let asked = outline.thickness.map(|t| (f64::from(t) / mesh.to_file.scale) as f32);
            // An outline thicker than the guard band is wide shows nothing but itself.
            Thickness::Object(asked.unwrap_or(OUTLINE_OBJECT_SHARE * side).min(16.0))
        }
    }
}

/// Width of a contour in pixels; one in object units is as wide as at the mesh's centre.
fn contour_px(mesh: &Mesh, outline: &Outline, camera: &Camera, size_px: [u32; 2]) -> f32 {
    const PX_MAX: f32 = 100.0;
    match thickness(mesh, outline) {
        Thickness::Px(px) => px.min(PX_MAX),
        Thickness::Object(units) => ((f64::from(units) * camera.px_per_unit(size_px)) as f32).min(PX_MAX),
    }
}

fn layers_pass(groups: &MaterialGroups<'_>, has_hull: bool, skips: &mut Skips<'_>) -> Option<PeelingPass> {
    let needed = groups.layers_pass();
    // Hulls are drawn in another way where there are layers.
    if skips.skip(SkipKind::Layers, needed.is_none(), "nothing shines through") || (needed.is_none() && has_hull) {
        return None;
    }
    let empty = PeelingPass { count_max: 1, behind_surface: false, wires_only: false, fade: 1.0 };
    Some(needed.unwrap_or(empty))
}
