//! The colours of points of the surface, from material, textures, light and wires (stage shade).
//! One point is shaded at a time for `shade`, eight for `waiting`. Twin of
//! `shaders/surface/point.wgsl`.

use super::barycentric::{Barycentrics, Corners};
use super::debug;
use super::light::{Light, LightLanes, light_lanes, lit_lanes, unlit_lanes};
use super::normal::{angle_shares, face_normals, normal_mapped, normals, to_viewer};
use super::occlusion_texture::apply_occlusion_texture;
use super::texture::{Uv, blend, of_corners, sample, uv_corners};
use super::wire::{ShadedPoints, edge_mask, fwidth_covers, wire_covers};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::transform::{ScreenVertex, quick_recip};
use crate::backend::cpu::geometry::visibility::area;
use crate::backend::cpu::vector::facing;
use crate::plan::{Projection, ShadedMaterial, SurfacePass, TEXTURE_NONE, flags, samplers, slots};

/// Flags that the common materials do not have, textures aside.
const GENERAL: u32 = flags::DERIVATIVE_NORMALS
    | flags::BY_ANGLE
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

/// Shades points of surface triangles one by one.
pub struct PointShader<'a> {
    context: &'a RasterContext<'a>,
    /// Flat colours do not change over a triangle: the last one is kept.
    flat: Option<(u32, [f32; 4])>,
    /// Shown parts of the material; the same for all points of a triangle.
    pub show: Show,
    /// Share of the light that reaches the next point, 0 to 1.
    pub open: f32,
}

impl<'a> PointShader<'a> {
    /// One for a band.
    pub fn new(context: &'a RasterContext<'a>) -> Self {
        Self { context, flat: None, show: Show::ALL, open: 1.0 }
    }

    /// The colour of triangle `id` where it is known to be the same all over, and is the one that
    /// was shaded last.
    #[inline(always)]
    pub fn flat(&self, id: u32) -> Option<[f32; 4]> {
        self.flat.filter(|(last, _)| *last == id).map(|(_, color)| color)
    }

    /// Premultiplied linear RGBA of surface triangle `id` at a point, in 1/256 px from the
    /// picture's centre.
    #[inline(never)]
    pub fn color(&mut self, surface: &SurfacePass<'_>, id: u32, at: [f32; 2]) -> [f32; 4] {
        let material = surface.material(id as usize);
        let points = Points { context: self.context, surface, material, show: self.show };
        let color = points.colors(&[id], &at.map(|v| [v]), &[self.open]).map(|[v]| v);
        if is_flat(surface, material) && self.context.occlusion.is_none() {
            self.flat = Some((id, color));
        }
        color
    }
}

/// Points of triangles of one material, to be shaded.
pub struct Points<'a> {
    /// Everything that is drawn.
    pub context: &'a RasterContext<'a>,
    /// The triangles' pass.
    pub surface: &'a SurfacePass<'a>,
    /// Their material.
    pub material: &'a ShadedMaterial,
    /// Shown parts of it.
    pub show: Show,
}

impl Points<'_> {
    /// Premultiplied linear RGBA of `N` points: of triangles `ids` at `at`, columns, then rows, in
    /// 1/256 px from the picture's centre. The share `open` of the light reaches them.
    #[inline(always)]
    pub fn colors<const N: usize>(&self, ids: &[u32; N], at: &[[f32; N]; 2], open: &[f32; N]) -> [[f32; N]; 4] {
        let is_textured = is_textured(self.surface, self.material);
        if self.material.flags & flags::DEBUG != 0 {
            return self.debug_colors(ids, at);
        }
        if self.material.flags & GENERAL != 0 || is_textured {
            return self.general(ids, at, open, is_textured);
        }
        if self.material.flags & VARYING != 0 {
            return self.common(ids, at, open);
        }
        let mut normals = [[0.0; N]; 3];
        if self.material.flags & flags::FACE_NORMALS != 0 {
            normals = face_normals(self.surface, ids, &self.are_front(ids, at));
        }
        flat_colors(self.surface, self.material, &self.context.plan.projection, self.show, (&normals, open))
    }

    /// One base colour, smooth or with a wire by fwidth.
    #[inline(always)]
    fn common<const N: usize>(&self, ids: &[u32; N], at: &[[f32; N]; 2], open: &[f32; N]) -> [[f32; N]; 4] {
        let Self { context, surface, material, show } = self;
        let b = Barycentrics::new(&Corners::new(context, ids, at));
        let color = match &surface.vertex_normals {
            Some(normals) if material.flags & flags::VERTEX_NORMALS != 0 => {
                self.smooth(&b, &of_corners(normals, ids), open)
            }
            _ => self.even(ids, &b.front, open),
        };
        if material.flags & flags::WIRE_FWIDTH == 0 || show.wires == 0.0 {
            return color;
        }
        let masks = ids.map(|id| edge_mask(surface, id));
        let covers = fwidth_covers(&masks, material, &b).map(|cover| show.wires * cover);
        over(&covers, material.wire_color, &color)
    }

    /// One base colour under light by the normals of the triangles' corners.
    #[inline(always)]
    pub fn smooth<const N: usize>(
        &self,
        b: &Barycentrics<N>,
        normals: &[[[f32; N]; 3]; 3],
        open: &[f32; N],
    ) -> [[f32; N]; 4] {
        let Self { context, surface, material, show } = self;
        let normal = facing(&blend(normals, &b.value), &b.front);
        let (metallic, roughness) = ([material.metallic; N], [material.roughness; N]);
        let projection = &context.plan.projection;
        let light = light_lanes(|w| 1.0 / w, &surface.lights, projection, &metallic, &roughness, &normal);
        let base = with_alpha(material, material.base_color, *show).map(|v| [v; N]);
        premultiplied(&lit_lanes(&base, &light.dimmed(open)), &material.emissive.map(|v| [v; N]))
    }

    /// One base colour, with light by the triangles' own normals or none.
    #[inline(always)]
    fn even<const N: usize>(&self, ids: &[u32; N], front: &[bool; N], open: &[f32; N]) -> [[f32; N]; 4] {
        let Self { context, surface, material, show } = self;
        let base = with_alpha(material, material.base_color, *show).map(|v| [v; N]);
        let emissive = material.emissive.map(|v| [v; N]);
        if material.flags & flags::LIT == 0 {
            return premultiplied(&unlit_lanes(&base), &emissive);
        }
        let projection = &context.plan.projection;
        let has_normals = ids.iter().all(|id| (*id as usize) < surface.face_normals.len());
        let normal = if has_normals { face_normals(surface, ids, front) } else { to_viewer(projection) };
        let (metallic, roughness) = ([material.metallic; N], [material.roughness; N]);
        let light = light_lanes(quick_recip, &surface.lights, projection, &metallic, &roughness, &normal);
        premultiplied(&lit_lanes(&base, &light.dimmed(open)), &emissive)
    }

    /// Every material there is, but for debug views.
    #[inline(always)]
    fn general<const N: usize>(
        &self,
        ids: &[u32; N],
        at: &[[f32; N]; 2],
        open: &[f32; N],
        is_textured: bool,
    ) -> [[f32; N]; 4] {
        let Self { context, surface, material, .. } = self;
        let place = self.place(ids, at, &Corners::new(context, ids, at), is_textured);
        let covers = self.wire_covers(&place);
        let texels = self.texels(&place, is_textured);
        let mut base = self.base_colors(&place, &texels[slots::BASE]);
        let mut light = LightLanes::NONE;
        if material.flags & flags::BY_ANGLE != 0 {
            let shares = angle_shares(material, &place, &normals(surface, material, &place));
            base[3] = std::array::from_fn(|l| base[3][l] * shares[l]);
        }
        if material.flags & flags::LIT != 0 {
            let mut normal = normals(surface, material, &place);
            if let (Some(uvs), true) = (&surface.uvs, is_textured && self.has_texture(slots::NORMAL)) {
                normal = normal_mapped((surface, uvs), material, &place, &texels[slots::NORMAL], &normal);
            }
            let [_, roughness, metallic, _] = &texels[slots::METALLIC_ROUGHNESS];
            let own = |flag: u32, factor: f32, textured: &[f32; N]| {
                let is_own = material.flags & flag != 0;
                textured.map(|v| factor * if is_own { 1.0 } else { v })
            };
            let metallic = own(flags::OWN_METALLIC, material.metallic, metallic);
            let roughness = own(flags::OWN_ROUGHNESS, material.roughness, roughness);
            let projection = &context.plan.projection;
            light = light_lanes(quick_recip, &surface.lights, projection, &metallic, &roughness, &normal);
            if is_textured && self.has_texture(slots::OCCLUSION_TEXTURE) {
                let red = (material.occlusion_texture_strength, &texels[slots::OCCLUSION_TEXTURE][0]);
                apply_occlusion_texture(&mut light, (&surface.lights, projection), red, &metallic, &normal);
            }
            light = light.dimmed(open);
        }
        let mut emissive = [[0.0; N]; 3];
        for k in 0..3 {
            for l in 0..N {
                emissive[k][l] = material.emissive[k] * texels[slots::EMISSIVE][k][l];
            }
        }
        let mut colors = if material.flags & flags::WIRE_LIT != 0 {
            lit_wires(&covers, material.wire_color, &base, &light, &emissive)
        } else {
            let is_lit = material.flags & flags::LIT != 0;
            let shown = if is_lit { lit_lanes(&base, &light) } else { unlit_lanes(&base) };
            over(&covers, material.wire_color, &premultiplied(&shown, &emissive))
        };
        for l in 0..N {
            let is_nothing = (base[3][l] == 0.0) & (covers[l] == 0.0);
            for k in 0..4 {
                colors[k][l] = if is_nothing { 0.0 } else { colors[k][l] };
            }
        }
        colors
    }

    /// Debug views under wires.
    #[cold]
    #[inline(never)]
    fn debug_colors<const N: usize>(&self, ids: &[u32; N], at: &[[f32; N]; 2]) -> [[f32; N]; 4] {
        let mut colors = [[0.0; N]; 4];
        for l in 0..N {
            let (ids, at) = ([ids[l]], at.map(|v| [v[l]]));
            let corners = Corners::new(self.context, &ids, &at);
            let place = self.place(&ids, &at, &corners, false);
            let cover = self.wire_covers(&place);
            let color = if self.show.fill {
                let view = debug::color(self.surface, self.material, &place, &corners);
                over(&cover, self.material.wire_color, &view.map(|v| [v])).map(|[v]| v)
            } else {
                self.material.wire_color.map(|v| cover[0] * v)
            };
            for k in 0..4 {
                colors[k][l] = color[k];
            }
        }
        colors
    }

    #[inline(always)]
    fn place<const N: usize>(
        &self,
        ids: &[u32; N],
        at: &[[f32; N]; 2],
        corners: &Corners<N>,
        is_textured: bool,
    ) -> ShadedPoints<'_, N> {
        let is_deciding = is_textured || self.material.flags & DECIDING != 0;
        let b = if is_deciding { Barycentrics::exact(corners) } else { Barycentrics::new(corners) };
        ShadedPoints { context: self.context, ids: *ids, at: *at, b }
    }

    /// Coverage of the wires times their shown opacity.
    #[inline(always)]
    fn wire_covers<const N: usize>(&self, place: &ShadedPoints<'_, N>) -> [f32; N] {
        if self.material.flags & flags::WIRES == 0 || self.show.wires <= 0.0 {
            return [0.0; N];
        }
        wire_covers(self.surface, self.material, place).map(|cover| self.show.wires * cover)
    }

    #[inline(always)]
    fn has_texture(&self, slot: usize) -> bool {
        self.material.textures[slot].texture != TEXTURE_NONE
    }

    /// Width of what a point stands for: of a pixel, or of a quarter of one.
    #[inline(always)]
    fn footprint(&self) -> f32 {
        if self.context.has_quarters && self.material.is_quartered() { 0.5 } else { 1.0 }
    }

    /// Texels by slot; white where there is no texture.
    #[inline(always)]
    fn texels<const N: usize>(&self, place: &ShadedPoints<'_, N>, is_textured: bool) -> [[[f32; N]; 4]; slots::COUNT] {
        let mut texels = [[[1.0; N]; 4]; slots::COUNT];
        let Some(uvs) = self.surface.uvs.as_ref().filter(|_| is_textured) else { return texels };
        let share = self.footprint();
        let first = Uv::new(&of_corners(uvs, &place.ids), &place.b).narrowed(share);
        for (slot, texels) in texels.iter_mut().enumerate() {
            let is_light = [slots::METALLIC_ROUGHNESS, slots::NORMAL, slots::OCCLUSION_TEXTURE].contains(&slot);
            if self.has_texture(slot) && (!is_light || self.material.flags & flags::LIT != 0) {
                let (textures, used) = (&self.surface.textures, &self.material.textures[slot]);
                let uv = if used.sampler & samplers::SECOND_UVS == 0 {
                    first
                } else {
                    Uv::new(&uv_corners(self.surface, uvs, used, &place.ids), &place.b).narrowed(share)
                };
                *texels = sample(self.context.isa, textures, used, samplers::taps_max(slot), &uv);
            }
        }
        texels
    }

    /// Base colours with straight alpha, as [`with_alpha`] leaves it.
    #[inline(always)]
    fn base_colors<const N: usize>(&self, place: &ShadedPoints<'_, N>, texels: &[[f32; N]; 4]) -> [[f32; N]; 4] {
        let tint = match &self.surface.colors {
            Some(colors) if self.material.flags & flags::VERTEX_COLORS != 0 => {
                blend(&of_corners(colors, &place.ids), &place.b.value)
            }
            _ => [[1.0; N]; 4],
        };
        let mut base = [[0.0; N]; 4];
        for l in 0..N {
            let own = |k: usize| self.material.base_color[k] * tint[k][l] * texels[k][l];
            let color = with_alpha(self.material, [own(0), own(1), own(2), own(3)], self.show);
            for k in 0..4 {
                base[k][l] = color[k];
            }
        }
        base
    }

    #[inline(always)]
    fn are_front<const N: usize>(&self, ids: &[u32; N], at: &[[f32; N]; 2]) -> [bool; N] {
        let mut front = [false; N];
        for l in 0..N {
            let vertices = self.context.screen_triangle(ids[l]);
            front[l] = if vertices.iter().any(ScreenVertex::is_outside) {
                Barycentrics::new(&Corners::new(self.context, &[ids[l]], &at.map(|v| [v[l]]))).front[0]
            } else {
                area(&vertices) < 0
            };
        }
        front
    }
}

fn is_textured(surface: &SurfacePass<'_>, material: &ShadedMaterial) -> bool {
    !surface.textures.images.is_empty() && material.textures.iter().any(|used| used.texture != TEXTURE_NONE)
}

/// True if a material has one base colour under light by the normals of the triangles' corners, and nothing else.
pub fn is_smooth(surface: &SurfacePass<'_>, material: &ShadedMaterial) -> bool {
    material.flags & (GENERAL | VARYING) == flags::VERTEX_NORMALS && !is_textured(surface, material)
}

/// True if a material's colour is the same all over a triangle.
pub fn is_flat(surface: &SurfacePass<'_>, material: &ShadedMaterial) -> bool {
    material.flags & (GENERAL | VARYING) == 0 && !is_textured(surface, material)
}

/// Premultiplied linear RGBA of triangles of one material ([`is_flat`]), by their normals on the
/// viewer's side. The share `open` of the light reaches them.
#[inline(always)]
pub fn flat_colors<const N: usize>(
    surface: &SurfacePass<'_>,
    material: &ShadedMaterial,
    projection: &Projection,
    show: Show,
    (normals, open): (&[[f32; N]; 3], &[f32; N]),
) -> [[f32; N]; 4] {
    let base = with_alpha(material, material.base_color, show).map(|v| [v; N]);
    let mut shown = unlit_lanes(&base);
    if material.flags & flags::FACE_NORMALS != 0 {
        let (metallic, roughness) = ([material.metallic; N], [material.roughness; N]);
        let light = light_lanes(quick_recip, &surface.lights, projection, &metallic, &roughness, normals);
        shown = lit_lanes(&base, &light.dimmed(open));
    }
    premultiplied(&shown, &material.emissive.map(|v| [v; N]))
}

/// The base colour with the material's cutoff, blending and opacity applied to alpha.
#[inline(always)]
fn with_alpha(material: &ShadedMaterial, mut base: [f32; 4], show: Show) -> [f32; 4] {
    // Barycentrics round to a little below 0 and above 1, and so does alpha that they blend.
    base[3] = if base[3] > 0.0 { base[3].min(1.0) } else { 0.0 };
    let is_cut = material.flags & flags::MASK != 0 && base[3] < material.alpha_cutoff;
    let is_hidden = is_cut || !show.fill || material.flags & flags::FILL == 0;
    if material.flags & flags::BLEND == 0 {
        base[3] = 1.0;
    }
    base[3] *= material.opacity;
    base.map(|v| if is_hidden { 0.0 } else { v })
}

#[inline(always)]
fn premultiplied<const N: usize>(straight: &[[f32; N]; 4], emissive: &[[f32; N]; 3]) -> [[f32; N]; 4] {
    let mut colors = *straight;
    for k in 0..3 {
        for l in 0..N {
            colors[k][l] = (straight[k][l] + emissive[k][l]) * straight[3][l];
        }
    }
    colors
}

/// Wires as paint: over the base colour, under the light.
#[inline(always)]
fn lit_wires<const N: usize>(
    covers: &[f32; N],
    wire: [f32; 4],
    base: &[[f32; N]; 4],
    light: &LightLanes<N>,
    emissive: &[[f32; N]; 3],
) -> [[f32; N]; 4] {
    let mut colors = over(covers, wire, &premultiplied(base, &[[0.0; N]; 3]));
    for l in 0..N {
        let left = base[3][l] * (1.0 - covers[l] * wire[3]);
        let light = Light { gain: light.gain[l], gloss: light.gloss[l] };
        let lit = light.on_premultiplied([colors[0][l], colors[1][l], colors[2][l], colors[3][l]]);
        for k in 0..3 {
            colors[k][l] = lit[k] + emissive[k][l] * left;
        }
    }
    colors
}

#[inline(always)]
fn over<const N: usize>(covers: &[f32; N], top: [f32; 4], under: &[[f32; N]; 4]) -> [[f32; N]; 4] {
    let mut colors = *under;
    for k in 0..4 {
        for l in 0..N {
            colors[k][l] = covers[l] * top[k] + under[k][l] * (1.0 - covers[l] * top[3]);
        }
    }
    colors
}
