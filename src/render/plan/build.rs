//! The making of a plan, the list of all that a back-end draws for one picture, from a scene (a
//! mesh, a request and the placed camera). Other modules of this folder make the parts of the plan.
//! They are called here in their order: triangles, colours of diagnostics, lines, the surface,
//! occlusion, samples, the margin, the ground's shadow, the outline, and transparent layers. What the
//! scene does not need is left out.

use super::context::PlanContext;
use super::peeling::{needed_pass, pass_masks, peeling_pass};
use super::prepared::Prepared;
use super::projection::Projection;
use super::skips::SkipKind;
use super::{DrawPlan, HullPass, PlanError, pass_mask};
use super::{costs, ground, heat, lines, margin, outline, primitives, surface};
use crate::limits::{Budget, Deadline};
use crate::scene::{Fill, Scene};

/// Decides what is drawn.
pub fn build<'m>(scene: &Scene<'m, '_>, budget: &mut Budget, deadline: &Deadline) -> Result<DrawPlan<'m>, PlanError> {
    build_keeping(scene, budget, deadline, &[])
}

/// As [`build`], from what earlier plans found out about the mesh. Keeps what this one finds out.
pub fn build_from<'m>(
    scene: &Scene<'m, '_>,
    prepared: &Prepared,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<DrawPlan<'m>, PlanError> {
    build_in(scene, PlanContext::new(budget, deadline, &[]).with(prepared))
}

/// As [`build`], but nothing in `keep` is skipped, for tests: the picture is the same to the byte.
pub fn build_keeping<'m>(
    scene: &Scene<'m, '_>,
    budget: &mut Budget,
    deadline: &Deadline,
    keep: &[SkipKind],
) -> Result<DrawPlan<'m>, PlanError> {
    build_in(scene, PlanContext::new(budget, deadline, keep))
}

fn build_in<'m>(scene: &Scene<'m, '_>, mut cx: PlanContext<'_>) -> Result<DrawPlan<'m>, PlanError> {
    let Scene { spec, groups, camera, .. } = scene;
    let mut geometry = primitives::geometry(scene, &mut cx)?;
    let legends = heat::paint(scene, &mut geometry, &mut cx)?;
    costs::spend_plan(scene, &geometry, cx.budget)?;

    let primitive_lines = primitives::line_passes(scene, &mut cx)?;
    let mut lines = lines::passes(scene, &mut cx)?;
    lines.extend(primitive_lines);
    let mut surface = surface::surface_pass(scene, &geometry, &mut cx)?;
    let occlusion = surface::occlusion::occlusion_pass(scene, surface.as_ref(), &mut cx);
    let clipped = Projection::new(camera, scene.size_px());
    let hides = surface.is_some() || groups.has_hull();
    let has_faces = groups.has_hull() || surface.as_ref().is_some_and(|s| s.is_shaded && groups.has_fill());
    let has_opaque = groups.fills().contains(&Fill::Opaque);
    let shown = surface::adaptive::Shown { faces: has_faces, has_opaque, layers: needed_pass(groups) };
    let (samples, is_adaptive) = surface::adaptive::samples(scene, shown, &mut cx);
    let needed_px = lines.iter().map(lines::LinePass::margin_rows).filter(|_| hides).max();
    let needed_px = needed_px.unwrap_or(0).max(u32::from(is_adaptive));
    let margin_px = margin::margin_px(scene, &geometry, needed_px, &mut cx)?;
    let is_mesh_alone = geometry.triangles.len() == scene.mesh.triangles.len();
    let ground_count = ground::add(scene, &mut geometry, &mut surface, &mut cx)?;
    let hull = if cx.skips.skip(SkipKind::Hull, !groups.has_hull(), "the look has no hull") {
        None
    } else if groups.has_hull() {
        Some(outline::hull_pass(scene, &geometry, margin_px, &mut cx)?)
    } else {
        Some(HullPass::default())
    };
    let peeling = peeling_pass(groups, hull.is_some(), &mut cx.skips);
    let pass_masks = pass_masks(groups, &geometry, ground_count, surface.is_some(), peeling.as_ref());
    // Triangles that stand for points and lines have sides that are no edges, and layers show other
    // edges than the surface.
    let of_mesh = pass_masks.iter().take(scene.mesh.triangles.len());
    let is_one_surface = is_mesh_alone && of_mesh.into_iter().all(|&mask| mask == pass_mask::SURFACE);
    // Not the ground: its shadow lies over no line that is seen from above.
    let of_layers = pass_masks.iter().rev().skip(ground_count).any(|mask| mask & pass_mask::LAYER != 0);
    let is_tinting = of_layers && peeling.is_some_and(|pass| !pass.wires_only);
    for pass in &mut lines {
        pass.is_complete &= is_one_surface;
        pass.keeps_short_parts &= is_one_surface;
        pass.is_tinted &= is_tinting;
    }
    let is_unclipped = cx.skips.skip(
        SkipKind::Clipping,
        camera.contains_mesh,
        "the whole mesh lies between the eye and the picture's guard band",
    );
    let (background, background_step) = spec.image.background.rows(spec.image.height_px);
    Ok(DrawPlan {
        width_px: spec.image.width_px,
        height_px: spec.image.height_px,
        margin_px,
        samples,
        is_adaptive,
        positions: geometry.positions,
        triangles: geometry.triangles,
        pass_masks,
        projection: Projection { clip: !is_unclipped, ..clipped },
        surface,
        occlusion,
        peeling,
        hull,
        lines,
        background,
        background_step,
        skips: cx.skips.done,
        short_chains: cx.short_chains,
        names_all_faces: !cx.has_crowded_edges,
        legends,
        warnings: cx.warnings,
        mesh: cx.prepared.map(Prepared::token),
    })
}
