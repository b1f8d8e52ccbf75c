//! The light on lines that are lit like the surface, per pixel (stage lines). Twin of
//! `shaders/lines/line_light.wgsl`.
//!
//! Light changes a colour by a factor and a summand ([`Light`]), so one light per pixel does for lines of all
//! colours. It is the mean of the light at those samples that show the surface. If no sample does, as just outside a
//! silhouette, it is the light on a face beside the line's edge. Textures and darkened hollows (stage occlusion) do
//! not change the light on lines.

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::surface::barycentric::{Barycentrics, Corners};
use crate::backend::cpu::surface::light::{Light, light as light_on};
use crate::backend::cpu::surface::normal::normals;
use crate::backend::cpu::surface::wire::ShadedPoints;
use crate::plan::{SurfacePass, flags, sample_offsets};

/// The light of every pixel of the band that has an owner, the face that lights its lines, plus 1.
pub fn light_lines(context: &RasterContext<'_>, band: &SampleBand, owners: &[u32], light: &mut [Light]) {
    let Some(surface) = &context.plan.surface else { return };
    for (i, (&owner, out)) in (0_u32..).zip(owners.iter().zip(light)) {
        if owner > 0 {
            *out = pixel(context, surface, band, [i % band.size_px[0], band.shown[0] + i / band.size_px[0]], owner - 1);
        }
    }
}

fn pixel(
    context: &RasterContext<'_>,
    surface: &SurfacePass<'_>,
    band: &SampleBand,
    [x, y]: [u32; 2],
    owner: u32,
) -> Light {
    let plan = context.plan;
    let corner = [x as i32 * 256 - plan.width_px as i32 * 128, y as i32 * 256 - plan.height_px as i32 * 128];
    let (mut sum, mut count) = (Light { gain: 0.0, gloss: 0.0 }, 0.0_f32);
    for (&id, offset) in band.pixel(x as i32, y as i32).0.iter().zip(sample_offsets(band.samples)) {
        // A triangle of the surface, not of the outline mesh.
        if id < plan.triangles.len() as u32 {
            let at = [(corner[0] + offset[0]) as f32, (corner[1] + offset[1]) as f32];
            let light = point(context, surface, id, at);
            sum = Light { gain: sum.gain + light.gain, gloss: sum.gloss + light.gloss };
            count += 1.0;
        }
    }
    if count == 0.0 {
        return point(context, surface, owner, [(corner[0] + 128) as f32, (corner[1] + 128) as f32]);
    }
    Light { gain: sum.gain / count, gloss: sum.gloss / count }
}

/// The light on a triangle at a point, in 1/256 px from the picture's centre, which may lie beside
/// it.
fn point(context: &RasterContext<'_>, surface: &SurfacePass<'_>, id: u32, at: [f32; 2]) -> Light {
    let material = surface.material(id as usize);
    if material.flags & flags::LIT == 0 {
        return Light::NONE;
    }
    let (ids, at) = ([id], at.map(|v| [v]));
    let mut b = Barycentrics::new(&Corners::new(context, &ids, &at));
    b.value = inside(b.value.map(|[v]| v)).map(|v| [v]);
    let normal = normals(surface, material, &ShadedPoints { context, ids, at, b }).map(|[v]| v);
    light_on(&surface.lights, &context.plan.projection, material.metallic, material.roughness, normal)
}

/// Barycentrics of a point of the triangle: those of one beside it do not extrapolate.
fn inside(b: [f32; 3]) -> [f32; 3] {
    // NaN, of a triangle seen edge-on, becomes 0.
    let b = b.map(|v| if v > 0.0 { v.min(1.0) } else { 0.0 });
    let sum = (b[0] + b[1]) + b[2];
    if sum > 0.0 { b.map(|v| v / sum) } else { [1.0 / 3.0; 3] }
}
