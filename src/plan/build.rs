//! Spec and mesh to plan: what each look needs, and what it does not.

use super::{DrawPlan, Faces, FwidthWire, HullOffset, HullPass, LinePass, Normals, Projection, Skip, SurfacePass};
use crate::limits::{Budget, LimitExceeded};
use crate::mesh::{Mesh, normals};
use crate::plan::wires;
use crate::scene::camera::{Border, Camera};
use crate::scene::color::Rgba;
use crate::scene::{Cull, Outline, OutlineUnit, Shading, Spec, Surface, Wire, WireMethod};

/// Surfaces for which neither the request nor the file names a colour: `#c8ccd2`, a calm light grey.
const DEFAULT_COLOR: [u8; 4] = [0xc8, 0xcc, 0xd2, 0xff];

/// Width of an outline in pixels where the request does not say.
const OUTLINE_PX: f32 = 3.0;

/// Thickness of an outline where the request does not say, as a share of the mesh's longest side: 0.03 for a model of
/// side 2.
const OUTLINE_OBJECT_SHARE: f32 = 0.015;

/// Decides what is drawn.
pub fn build<'a>(mesh: &'a Mesh, spec: &Spec, budget: &mut Budget) -> Result<DrawPlan<'a>, LimitExceeded> {
    let size_px = [spec.image.width_px, spec.image.height_px];
    let pixels = u64::from(size_px[0]) * u64::from(size_px[1]);
    budget.spend("the picture", pixels, 4)?;
    budget.spend("vertices on screen", mesh.positions.len() as u64, 32)?;
    // Up to eight 4-byte entries in the lists of what each part of the picture has to draw.
    budget.spend("lists of triangles", mesh.triangles.len() as u64, 32)?;
    let is_smooth = spec.surface.is_some_and(|surface| surface.shading == Shading::Smooth);
    if spec.outline.is_some() || (is_smooth && mesh.normals.is_empty()) {
        // Sums in f64, then the unit normals in f32.
        budget.spend("vertex normals", mesh.positions.len() as u64, 36)?;
    }

    let offset = spec.outline.map(|outline| hull_offset(mesh, &outline));
    let camera = Camera::place(&spec.camera, mesh, size_px, border(spec, offset));
    let mut skips = Vec::new();
    let lines = exact_wire(spec).map(|wire| wires::pass(mesh, wire, spec, budget)).transpose()?;
    let surface = spec.surface.as_ref().map(|s| surface_pass(mesh, s, spec, &camera, &mut skips));
    let hull = spec.outline.zip(offset).map(|(outline, offset)| hull_pass(mesh, &outline, offset, surface.as_ref()));
    note_skips(mesh, spec, &camera, lines.as_ref(), &mut skips);
    Ok(DrawPlan {
        width_px: size_px[0],
        height_px: size_px[1],
        samples: spec.image.samples,
        positions: &mesh.positions,
        triangles: &mesh.triangles,
        projection: projection(&camera, size_px),
        surface,
        hull,
        lines,
        background: spec.image.background.premultiplied(),
        skips,
    })
}

fn projection(camera: &Camera, size_px: [u32; 2]) -> Projection {
    let [x, y, z, w] = camera.rows(size_px);
    let [right, up, back] = camera.axes.map(|axis| axis.as_vec3().to_array());
    // In an orthographic view W is 1 and nothing is behind the eye.
    let near_w = if w[3] == 1.0 && w[..3] == [0.0; 3] { 0.5 } else { camera.near as f32 };
    let clip = !camera.contains_mesh;
    Projection { x, y, z, w, near_w, clip, to_viewer: back, screen_up: up, screen_right: right }
}

fn border(spec: &Spec, offset: Option<HullOffset>) -> Border {
    let mut border = Border::default();
    match offset {
        Some(HullOffset::Object(grow)) => border.grow = f64::from(grow),
        Some(HullOffset::Px(px)) => border.px = f64::from(px),
        None => {}
    }
    if let Some(wire) = exact_wire(spec) {
        border.px = border.px.max(f64::from(0.5 * (wire.thickness + wire.smoothing)));
    }
    border
}

fn exact_wire(spec: &Spec) -> Option<&Wire> {
    spec.wire.as_ref().filter(|wire| wire.method == WireMethod::Exact)
}

fn hull_offset(mesh: &Mesh, outline: &Outline) -> HullOffset {
    match outline.unit {
        OutlineUnit::Px => HullOffset::Px(outline.thickness.unwrap_or(OUTLINE_PX)),
        OutlineUnit::Object => {
            let [low, high] = mesh.bounds;
            let side = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
            let thickness = outline.thickness.map(|t| (f64::from(t) / mesh.to_file.scale) as f32);
            // A hull thicker than the guard band is wide shows nothing but itself.
            HullOffset::Object(thickness.unwrap_or(OUTLINE_OBJECT_SHARE * side).min(16.0))
        }
    }
}

fn surface_pass<'a>(
    mesh: &'a Mesh,
    surface: &Surface,
    spec: &Spec,
    camera: &Camera,
    skips: &mut Vec<Skip>,
) -> SurfacePass<'a> {
    let normals = match surface.shading {
        Shading::Unlit => {
            skips.push(Skip { what: "normals", why: "an unlit surface takes no light" });
            Normals::None
        }
        Shading::Flat => {
            skips.push(Skip { what: "vertex normals", why: "flat shading reads face normals" });
            Normals::Face(&mesh.face_normals)
        }
        Shading::Smooth => {
            let (values, triangles) = normals::smooth(mesh);
            Normals::Vertex { values, triangles }
        }
    };
    let material_colors = material_colors(mesh, surface);
    let several = material_colors.len() > 1;
    if !several {
        skips.push(Skip { what: "material indices", why: "every triangle has the same colour" });
    }
    let [right, up, back] = camera.axes;
    // Over the viewer's left shoulder: straight ahead would leave every shape without a lit side.
    let to_light = (back - 0.5 * right + 0.7 * up).normalize();
    let halfway = (to_light + back).normalize();
    SurfacePass {
        faces: match surface.cull {
            Cull::None => Faces::Both,
            Cull::Back => Faces::Front,
            Cull::Front => Faces::Back,
        },
        normals,
        material_colors,
        triangle_materials: if several { &mesh.triangle_materials } else { &[] },
        metallic: surface.metallic,
        roughness: surface.roughness,
        intensity: spec.light.intensity,
        ambient: spec.light.ambient,
        to_light: to_light.as_vec3().to_array(),
        halfway: halfway.as_vec3().to_array(),
        fwidth: spec.wire.as_ref().filter(|wire| wire.method == WireMethod::Fwidth).map(|w| fwidth_wire(mesh, w)),
    }
}

fn material_colors(mesh: &Mesh, surface: &Surface) -> Vec<[f32; 4]> {
    let default = Rgba::from_srgb8(DEFAULT_COLOR).0;
    let color = |slot: Option<[f32; 4]>| {
        let [r, g, b, _] = surface.color.map_or(slot.unwrap_or(default), |c| c.0);
        // Opaque: transparent surfaces are not in this version.
        [r, g, b, 1.0]
    };
    let mut colors: Vec<_> = mesh.materials.iter().map(|slot| color(slot.base_color)).collect();
    if colors.iter().all(|c| *c == colors[0]) {
        colors.truncate(1);
    }
    if colors.is_empty() {
        colors.push(color(None));
    }
    colors
}

fn fwidth_wire<'a>(mesh: &'a Mesh, wire: &Wire) -> FwidthWire<'a> {
    FwidthWire {
        color: wires::color(wire),
        thickness: wire.thickness,
        smoothing: wire.smoothing,
        edge_masks: if wires::draws_every_edge(mesh, wire) { &[] } else { &mesh.edge_masks },
    }
}

fn hull_pass<'a>(
    mesh: &'a Mesh,
    outline: &Outline,
    offset: HullOffset,
    surface: Option<&SurfacePass<'a>>,
) -> HullPass<'a> {
    // The file's normals may split at hard edges, where a hull that followed them would tear: always the welded ones.
    let welded = match surface.map(|s| &s.normals) {
        Some(Normals::Vertex { values, .. }) if mesh.normals.is_empty() => values.clone(),
        _ => normals::angle_weighted(mesh).into(),
    };
    HullPass { color: outline.color.premultiplied(), normals: welded, offset }
}

fn note_skips(mesh: &Mesh, spec: &Spec, camera: &Camera, lines: Option<&LinePass>, skips: &mut Vec<Skip>) {
    if spec.surface.is_none() {
        skips.push(Skip { what: "surface", why: "the look has no filled surface: nothing is shaded" });
    }
    if spec.surface.is_none() && spec.outline.is_none() {
        skips.push(Skip { what: "visibility", why: "no surface and no hull: no depth is needed" });
    }
    if spec.outline.is_none() {
        skips.push(Skip { what: "hull", why: "the look has no outline" });
    }
    if lines.is_none() {
        skips.push(Skip { what: "adjacency", why: "no line asks which triangles are neighbours" });
    }
    if lines.is_some_and(|lines| lines.skip_back_edges) {
        skips.push(Skip { what: "edges that look away", why: "the surface is closed: they are hidden" });
    }
    if camera.contains_mesh {
        skips.push(Skip { what: "clipping", why: "the whole mesh lies between the eye and the picture's guard band" });
    }
    if !mesh.uvs.is_empty() {
        skips.push(Skip { what: "texture coordinates", why: "nothing samples a texture" });
    }
    if !mesh.colors.is_empty() {
        skips.push(Skip { what: "vertex colours", why: "the look does not show them" });
    }
}
