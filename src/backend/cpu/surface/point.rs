//! The colour of one point of the surface: stage 3's formulas. Twin of `shaders/surface/point.wgsl`.

use super::barycentric::{Barycentrics, corners};
use super::debug;
use super::light::{Light, light, light_on_blend, lit};
use super::normal::{bumped, normal};
use super::texture::{Uv, blend, sample};
use super::wire::{Place, edge_mask, fwidth_cover, wire_cover};
use crate::backend::cpu::Stages;
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::backend::cpu::geometry::visibility::area;
use crate::backend::cpu::vector::{facing, turned_to_viewer};
use crate::plan::{ShadedMaterial, SurfacePass, TEXTURE_NONE, flags, slots};

/// What the common looks do without, textures aside.
const RICH: u32 = flags::DERIVATIVE_NORMALS
    | flags::VERTEX_COLORS
    | flags::DEBUG
    | flags::WIRE_LIT
    | (flags::WIRES & !flags::WIRE_FWIDTH);

/// What changes from point to point of a triangle in a common look.
const VARYING: u32 = flags::VERTEX_NORMALS | flags::WIRE_FWIDTH;

/// What decides by barycentrics rather than blends, textures aside: there both back-ends need the same bits.
const DECIDING: u32 = flags::VERTEX_COLORS | flags::WIRE_THRESHOLD | flags::DEBUG;

/// What of its material a point shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Show {
    /// Whether its fill.
    pub fill: bool,
    /// How much of its wires, 0 to 1.
    pub wires: f32,
}

impl Show {
    /// All of it.
    pub const ALL: Self = Self { fill: true, wires: 1.0 };
}

/// Shades points of surface triangles.
pub struct PointShader<'a> {
    stages: &'a Stages<'a>,
    /// Flat colours do not change over a triangle: the last one is kept.
    flat: Option<(u32, [f32; 4])>,
    /// What is shown; the same for all points of a triangle.
    pub show: Show,
}

impl<'a> PointShader<'a> {
    /// One for a band.
    pub fn new(stages: &'a Stages<'a>) -> Self {
        Self { stages, flat: None, show: Show::ALL }
    }

    /// The colour of triangle `id` where it is known to be the same all over, and is the one that was shaded last.
    #[inline(always)]
    pub fn flat(&self, id: u32) -> Option<[f32; 4]> {
        self.flat.filter(|(last, _)| *last == id).map(|(_, color)| color)
    }

    /// Premultiplied linear RGBA of surface triangle `id` at a point, in 1/256 px from the picture's centre.
    pub fn color(&mut self, surface: &SurfacePass<'_>, id: u32, at: [f32; 2]) -> [f32; 4] {
        let look = surface.material(id as usize);
        let is_textured =
            !surface.textures.images.is_empty() && look.textures.iter().any(|used| used.texture != TEXTURE_NONE);
        if look.flags & RICH != 0 || is_textured {
            return self.rich(surface, look, id, at, is_textured);
        }
        if look.flags & VARYING != 0 {
            return self.common(surface, look, id, at);
        }
        let base = self.with_alpha(look, look.base_color);
        let mut light = Light::NONE;
        if look.flags & flags::FACE_NORMALS != 0 {
            let normal = turned_to_viewer(surface.face_normals[id as usize], self.is_front(id, at));
            light = self.light(surface, look.metallic, look.roughness, normal);
        }
        let color = premultiplied(lit(base, light), look.emissive);
        self.flat = Some((id, color));
        color
    }

    /// One base colour, smooth or with a wire by fwidth.
    fn common(&self, surface: &SurfacePass<'_>, look: &ShadedMaterial, id: u32, at: [f32; 2]) -> [f32; 4] {
        let b = Barycentrics::new(&corners(self.stages, id, at));
        let base = self.with_alpha(look, look.base_color);
        let mut light = Light::NONE;
        if look.flags & flags::LIT != 0 {
            let projection = &self.stages.plan.projection;
            light = match (&surface.vertex_normals, surface.face_normals.get(id as usize)) {
                (Some(normals), _) if look.flags & flags::VERTEX_NORMALS != 0 => {
                    let corners = normals.triangles[id as usize].map(|i| normals.values[i as usize]);
                    let normal = facing(blend(corners, b.value), b.front);
                    light_on_blend(&surface.lights, projection, look.metallic, look.roughness, normal)
                }
                (_, face) => {
                    let normal = face.map_or(projection.to_viewer, |normal| turned_to_viewer(*normal, b.front));
                    self.light(surface, look.metallic, look.roughness, normal)
                }
            };
        }
        let color = premultiplied(lit(base, light), look.emissive);
        if look.flags & flags::WIRE_FWIDTH == 0 || self.show.wires == 0.0 {
            return color;
        }
        over(self.show.wires * fwidth_cover(edge_mask(surface, id), look, &b), look.wire_color, color)
    }

    /// Every look there is.
    #[inline(never)]
    fn rich(
        &self,
        surface: &SurfacePass<'_>,
        look: &ShadedMaterial,
        id: u32,
        at: [f32; 2],
        is_textured: bool,
    ) -> [f32; 4] {
        let c = corners(self.stages, id, at);
        let is_deciding = is_textured || look.flags & DECIDING != 0;
        let b = if is_deciding { Barycentrics::exact(&c) } else { Barycentrics::new(&c) };
        let place = Place { stages: self.stages, id, at, b };
        let has_wire = look.flags & flags::WIRES != 0 && self.show.wires > 0.0;
        let cover = if has_wire { self.show.wires * wire_cover(surface, look, &place) } else { 0.0 };
        if look.flags & flags::DEBUG != 0 && !self.show.fill {
            return look.wire_color.map(|v| cover * v);
        }
        if look.flags & flags::DEBUG != 0 {
            return over(cover, look.wire_color, debug::color(surface, look, &place, &c));
        }
        let uv = surface.uvs.as_ref().filter(|_| is_textured).map(|uvs| Uv::new(uvs, id, &place.b));
        let texture = |slot: usize| match &uv {
            Some(uv) if look.textures[slot].texture != TEXTURE_NONE => {
                sample(&surface.textures, &look.textures[slot], uv)
            }
            _ => [1.0; 4],
        };
        let base = self.with_alpha(look, base_color(surface, look, &place, texture(slots::BASE)));
        if base[3] == 0.0 && cover == 0.0 {
            return [0.0; 4];
        }
        let mut light = Light::NONE;
        if look.flags & flags::LIT != 0 {
            let [_, roughness, metallic, _] = texture(slots::METALLIC_ROUGHNESS);
            let mut normal = normal(surface, look, &place);
            if let Some(uv) = uv.as_ref().filter(|_| look.textures[slots::NORMAL].texture != TEXTURE_NONE) {
                normal = bumped(surface, look, &place, uv, normal);
            }
            let own = |flag: u32, textured: f32| if look.flags & flag != 0 { 1.0 } else { textured };
            let metallic = look.metallic * own(flags::OWN_METALLIC, metallic);
            let roughness = look.roughness * own(flags::OWN_ROUGHNESS, roughness);
            light = self.light(surface, metallic, roughness, normal);
        }
        let [r, g, b, _] = texture(slots::EMISSIVE);
        let emissive = [look.emissive[0] * r, look.emissive[1] * g, look.emissive[2] * b];
        if look.flags & flags::WIRE_LIT != 0 {
            return lit_wire(cover, look.wire_color, base, light, emissive);
        }
        over(cover, look.wire_color, premultiplied(lit(base, light), emissive))
    }

    /// What the material makes of alpha.
    fn with_alpha(&self, look: &ShadedMaterial, mut base: [f32; 4]) -> [f32; 4] {
        // Barycentrics round to a little below 0 and above 1, and so does alpha that they blend.
        base[3] = if base[3] > 0.0 { base[3].min(1.0) } else { 0.0 };
        let is_cut = look.flags & flags::MASK != 0 && base[3] < look.alpha_cutoff;
        if is_cut || !self.show.fill || look.flags & flags::FILL == 0 {
            return [0.0; 4];
        }
        if look.flags & flags::BLEND == 0 {
            base[3] = 1.0;
        }
        base[3] *= look.opacity;
        base
    }

    /// What light makes of a colour at a point with this normal.
    #[inline(always)]
    pub fn light(&self, surface: &SurfacePass<'_>, metallic: f32, roughness: f32, normal: [f32; 3]) -> Light {
        light(&surface.lights, &self.stages.plan.projection, metallic, roughness, normal)
    }

    fn is_front(&self, id: u32, at: [f32; 2]) -> bool {
        let vertices = self.stages.screen_triangle(id);
        if vertices.iter().any(ScreenVertex::is_outside) {
            return Barycentrics::new(&corners(self.stages, id, at)).front;
        }
        area(&vertices) < 0
    }
}

/// Base colour with straight alpha.
fn base_color(surface: &SurfacePass<'_>, look: &ShadedMaterial, place: &Place<'_>, texel: [f32; 4]) -> [f32; 4] {
    let tint = match &surface.colors {
        Some(colors) if look.flags & flags::VERTEX_COLORS != 0 => {
            blend(colors.triangles[place.id as usize].map(|i| colors.values[i as usize]), place.b.value)
        }
        _ => [1.0; 4],
    };
    std::array::from_fn(|k| look.base_color[k] * tint[k] * texel[k])
}

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
