//! Stage shade, per point: the colour of a point of the surface. Twin of
//! `shaders/surface/point.wgsl`.

use super::barycentric::{Barycentrics, corners};
use super::debug;
use super::light::{Light, light, light_lanes, lit};
use super::normal::{normal, normal_mapped};
use super::texture::{Uv, blend, sample};
use super::wire::{Place, edge_mask, fwidth_cover, wire_cover};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::transform::{ScreenVertex, quick_recip};
use crate::backend::cpu::geometry::visibility::area;
use crate::backend::cpu::vector::{facing, turned_to_viewer};
use crate::plan::{Projection, ShadedMaterial, SurfacePass, TEXTURE_NONE, flags, slots};

/// Flags that the common materials do not have, textures aside.
const GENERAL: u32 = flags::DERIVATIVE_NORMALS
    | flags::VERTEX_COLORS
    | flags::DEBUG
    | flags::WIRE_LIT
    | (flags::WIRES & !flags::WIRE_FWIDTH);

/// Flags by which the colour of a common material varies over a triangle.
const VARYING: u32 = flags::VERTEX_NORMALS | flags::WIRE_FWIDTH;

/// Flags by which barycentrics decide rather than blend, textures aside: both back-ends need the
/// same bits there.
const DECIDING: u32 = flags::VERTEX_COLORS | flags::WIRE_THRESHOLD | flags::DEBUG;

/// Parts of a material that a point shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Show {
    /// True if the fill is shown.
    pub fill: bool,
    /// Opacity of the wires, 0 to 1.
    pub wires: f32,
}

impl Show {
    /// All of it.
    pub const ALL: Self = Self { fill: true, wires: 1.0 };
}

/// Shades points of surface triangles.
pub struct PointShader<'a> {
    context: &'a RasterContext<'a>,
    /// Flat colours do not change over a triangle: the last one is kept.
    flat: Option<(u32, [f32; 4])>,
    /// Shown parts of the material; the same for all points of a triangle.
    pub show: Show,
}

impl<'a> PointShader<'a> {
    /// One for a band.
    pub fn new(context: &'a RasterContext<'a>) -> Self {
        Self { context, flat: None, show: Show::ALL }
    }

    /// The colour of triangle `id` where it is known to be the same all over, and is the one that
    /// was shaded last.
    #[inline(always)]
    pub fn flat(&self, id: u32) -> Option<[f32; 4]> {
        self.flat.filter(|(last, _)| *last == id).map(|(_, color)| color)
    }

    /// Premultiplied linear RGBA of surface triangle `id` at a point, in 1/256 px from the
    /// picture's centre.
    pub fn color(&mut self, surface: &SurfacePass<'_>, id: u32, at: [f32; 2]) -> [f32; 4] {
        let material = surface.material(id as usize);
        let is_textured = is_textured(surface, material);
        if material.flags & GENERAL != 0 || is_textured {
            return self.general(surface, material, id, at, is_textured);
        }
        if material.flags & VARYING != 0 {
            return self.common(surface, material, id, at);
        }
        let mut normal = [[0.0]; 3];
        if material.flags & flags::FACE_NORMALS != 0 {
            let is_front = self.is_front(id, at);
            normal = turned_to_viewer(surface.face_normals[id as usize], is_front).map(|v| [v]);
        }
        let [r, g, b, a] = flat_colors(surface, material, &self.context.plan.projection, self.show, &normal);
        let color = [r[0], g[0], b[0], a[0]];
        self.flat = Some((id, color));
        color
    }

    /// One base colour, smooth or with a wire by fwidth.
    fn common(&self, surface: &SurfacePass<'_>, material: &ShadedMaterial, id: u32, at: [f32; 2]) -> [f32; 4] {
        let b = Barycentrics::new(&corners(self.context, id, at));
        let base = with_alpha(material, material.base_color, self.show);
        let mut light = Light::NONE;
        if material.flags & flags::LIT != 0 {
            let projection = &self.context.plan.projection;
            light = match (&surface.vertex_normals, surface.face_normals.get(id as usize)) {
                (Some(normals), _) if material.flags & flags::VERTEX_NORMALS != 0 => {
                    let corners = normals.triangles[id as usize].map(|i| normals.values[i as usize]);
                    let normal = facing(blend(corners, b.value), b.front);
                    let normal = normal.map(|v| [v]);
                    let (metallic, roughness) = (material.metallic, material.roughness);
                    let [gain, gloss] =
                        light_lanes(|w| 1.0 / w, &surface.lights, projection, metallic, roughness, &normal);
                    Light { gain: gain[0], gloss: gloss[0] }
                }
                (_, face) => {
                    let normal = face.map_or(projection.to_viewer, |normal| turned_to_viewer(*normal, b.front));
                    self.light(surface, material.metallic, material.roughness, normal)
                }
            };
        }
        let color = premultiplied(lit(base, light), material.emissive);
        if material.flags & flags::WIRE_FWIDTH == 0 || self.show.wires == 0.0 {
            return color;
        }
        over(self.show.wires * fwidth_cover(edge_mask(surface, id), material, &b), material.wire_color, color)
    }

    /// Every material there is.
    #[inline(never)]
    fn general(
        &self,
        surface: &SurfacePass<'_>,
        material: &ShadedMaterial,
        id: u32,
        at: [f32; 2],
        is_textured: bool,
    ) -> [f32; 4] {
        let c = corners(self.context, id, at);
        let is_deciding = is_textured || material.flags & DECIDING != 0;
        let b = if is_deciding { Barycentrics::exact(&c) } else { Barycentrics::new(&c) };
        let place = Place { context: self.context, id, at, b };
        let has_wire = material.flags & flags::WIRES != 0 && self.show.wires > 0.0;
        let cover = if has_wire { self.show.wires * wire_cover(surface, material, &place) } else { 0.0 };
        if material.flags & flags::DEBUG != 0 && !self.show.fill {
            return material.wire_color.map(|v| cover * v);
        }
        if material.flags & flags::DEBUG != 0 {
            return over(cover, material.wire_color, debug::color(surface, material, &place, &c));
        }
        let uv = surface.uvs.as_ref().filter(|_| is_textured).map(|uvs| Uv::new(uvs, id, &place.b));
        let texture = |slot: usize| match &uv {
            Some(uv) if material.textures[slot].texture != TEXTURE_NONE => {
                sample(&surface.textures, &material.textures[slot], uv)
            }
            _ => [1.0; 4],
        };
        let base = with_alpha(material, base_color(surface, material, &place, texture(slots::BASE)), self.show);
        if base[3] == 0.0 && cover == 0.0 {
            return [0.0; 4];
        }
        let mut light = Light::NONE;
        if material.flags & flags::LIT != 0 {
            let [_, roughness, metallic, _] = texture(slots::METALLIC_ROUGHNESS);
            let mut normal = normal(surface, material, &place);
            if let Some(uv) = uv.as_ref().filter(|_| material.textures[slots::NORMAL].texture != TEXTURE_NONE) {
                normal = normal_mapped(surface, material, &place, uv, normal);
            }
            let own = |flag: u32, textured: f32| if material.flags & flag != 0 { 1.0 } else { textured };
            let metallic = material.metallic * own(flags::OWN_METALLIC, metallic);
            let roughness = material.roughness * own(flags::OWN_ROUGHNESS, roughness);
            light = self.light(surface, metallic, roughness, normal);
        }
        let [r, g, b, _] = texture(slots::EMISSIVE);
        let emissive = [material.emissive[0] * r, material.emissive[1] * g, material.emissive[2] * b];
        if material.flags & flags::WIRE_LIT != 0 {
            return lit_wire(cover, material.wire_color, base, light, emissive);
        }
        over(cover, material.wire_color, premultiplied(lit(base, light), emissive))
    }

    /// Light at a point with this normal.
    #[inline(always)]
    pub fn light(&self, surface: &SurfacePass<'_>, metallic: f32, roughness: f32, normal: [f32; 3]) -> Light {
        light(&surface.lights, &self.context.plan.projection, metallic, roughness, normal)
    }

    fn is_front(&self, id: u32, at: [f32; 2]) -> bool {
        let vertices = self.context.screen_triangle(id);
        if vertices.iter().any(ScreenVertex::is_outside) {
            return Barycentrics::new(&corners(self.context, id, at)).front;
        }
        area(&vertices) < 0
    }
}

fn is_textured(surface: &SurfacePass<'_>, material: &ShadedMaterial) -> bool {
    !surface.textures.images.is_empty() && material.textures.iter().any(|used| used.texture != TEXTURE_NONE)
}

/// True if a material's colour is the same all over a triangle.
pub fn is_flat(surface: &SurfacePass<'_>, material: &ShadedMaterial) -> bool {
    material.flags & (GENERAL | VARYING) == 0 && !is_textured(surface, material)
}

/// Premultiplied linear RGBA of triangles of one material ([`is_flat`]), by their normals on the
/// viewer's side.
#[inline(always)]
pub fn flat_colors<const N: usize>(
    surface: &SurfacePass<'_>,
    material: &ShadedMaterial,
    projection: &Projection,
    show: Show,
    normals: &[[f32; N]; 3],
) -> [[f32; N]; 4] {
    let base = with_alpha(material, material.base_color, show);
    let mut light = [[Light::NONE.gain; N], [Light::NONE.gloss; N]];
    if material.flags & flags::FACE_NORMALS != 0 {
        light = light_lanes(quick_recip, &surface.lights, projection, material.metallic, material.roughness, normals);
    }
    // As `lit` and `premultiplied`, channel by channel.
    let mut colors = [[0.0; N], [0.0; N], [0.0; N], [base[3]; N]];
    for k in 0..3 {
        for l in 0..N {
            let lit = (base[k] * light[0][l] + light[1][l]).clamp(0.0, 1.0);
            colors[k][l] = (lit + material.emissive[k]) * base[3];
        }
    }
    colors
}

/// The base colour with the material's cutoff, blending and opacity applied to alpha.
fn with_alpha(material: &ShadedMaterial, mut base: [f32; 4], show: Show) -> [f32; 4] {
    // Barycentrics round to a little below 0 and above 1, and so does alpha that they blend.
    base[3] = if base[3] > 0.0 { base[3].min(1.0) } else { 0.0 };
    let is_cut = material.flags & flags::MASK != 0 && base[3] < material.alpha_cutoff;
    if is_cut || !show.fill || material.flags & flags::FILL == 0 {
        return [0.0; 4];
    }
    if material.flags & flags::BLEND == 0 {
        base[3] = 1.0;
    }
    base[3] *= material.opacity;
    base
}

/// Base colour with straight alpha.
fn base_color(surface: &SurfacePass<'_>, material: &ShadedMaterial, place: &Place<'_>, texel: [f32; 4]) -> [f32; 4] {
    let tint = match &surface.colors {
        Some(colors) if material.flags & flags::VERTEX_COLORS != 0 => {
            blend(colors.triangles[place.id as usize].map(|i| colors.values[i as usize]), place.b.value)
        }
        _ => [1.0; 4],
    };
    std::array::from_fn(|k| material.base_color[k] * tint[k] * texel[k])
}

#[inline(always)]
fn premultiplied(straight: [f32; 4], emissive: [f32; 3]) -> [f32; 4] {
    let alpha = straight[3];
    let [r, g, b] = [0, 1, 2].map(|k| (straight[k] + emissive[k]) * alpha);
    [r, g, b, alpha]
}

/// The wire as paint: over the base colour, under the light.
fn lit_wire(cover: f32, wire: [f32; 4], base: [f32; 4], light: Light, emissive: [f32; 3]) -> [f32; 4] {
    let [r, g, b, alpha] = base;
    let painted = over(cover, wire, [r * alpha, g * alpha, b * alpha, alpha]);
    let left = alpha * (1.0 - cover * wire[3]);
    let [r, g, b, alpha] = light.on_premultiplied(painted);
    [r + emissive[0] * left, g + emissive[1] * left, b + emissive[2] * left, alpha]
}

fn over(cover: f32, top: [f32; 4], under: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|k| cover * top[k] + under[k] * (1.0 - cover * top[3]))
}
