//! The translation of materials: a material of the file, and the style that the request gives it, become
//! a `ShadedMaterial`, which is the form that the shaders read.

use super::textures::TextureLoader;
use crate::mesh::material::{AlphaMode, TextureRef};
use crate::mesh::{MaterialSlot, Mesh};
use crate::plan::heat;
use crate::plan::lines::styles::wire_color;
use crate::plan::{PlanError, ShadedMaterial, TEXTURE_NONE, TextureUse, flags, slots};
use crate::spec::color::Rgba;
use crate::spec::{DebugView, FlatNormals, Layers, Shading, Surface, Wire, WireMethod};
use crate::texture::mips::Reading;

/// The colour where neither the request nor the file names one: `#c8ccd2`, a calm light grey.
const DEFAULT_COLOR: [u8; 4] = [0xc8, 0xcc, 0xd2, 0xff];

/// The roughness where neither the request nor the file names one: neither a mirror nor chalk.
const DEFAULT_ROUGHNESS: f32 = 0.6;

/// A material in its style.
pub fn shaded_material(
    mesh: &Mesh,
    slot: &MaterialSlot,
    layers: &Layers,
    textures: &mut TextureLoader<'_, '_>,
) -> Result<ShadedMaterial, PlanError> {
    let mut material = ShadedMaterial::unlit([0.0; 4]);
    material.flags = 0;
    if let Some(surface) = &layers.surface {
        material.flags = flags::FILL | shading_flags(slot, surface);
        fill(&mut material, mesh, slot, surface);
        if surface.textures && surface.debug == DebugView::None {
            sample(&mut material, mesh, slot, surface, textures)?;
        }
    }
    if let Some(wire) = layers.wire.as_ref().filter(|wire| wire.method != WireMethod::Exact) {
        wire_of(&mut material, wire);
    }
    Ok(material)
}

/// Takes textures from a material, those of these indices, which are in order. It looks as if its file did not mention
/// them.
pub fn remove_textures(material: &mut ShadedMaterial, mesh: &Mesh, indices: &[u32]) {
    for place in 0..material.textures.len() {
        if indices.binary_search(&material.textures[place].texture).is_ok() {
            remove_texture(material, mesh, place);
        }
    }
}

/// Loads all textures of a material that samples none.
pub fn load_all(slot: &MaterialSlot, textures: &mut TextureLoader<'_, '_>) -> Result<(), PlanError> {
    let all = [
        (&slot.base_texture, true),
        (&slot.metallic_roughness_texture, false),
        (&slot.normal_texture, false),
        (&slot.emissive_texture, true),
        (&slot.occlusion_texture, false),
    ];
    for (texture, is_color) in all {
        if let Some(texture) = texture {
            textures.load(texture, Reading::plain(is_color))?;
        }
    }
    Ok(())
}

fn remove_texture(material: &mut ShadedMaterial, mesh: &Mesh, place: usize) {
    material.textures[place] = TextureUse::NONE;
    match place {
        // The factor of a texture, on its own, would be a lamp.
        slots::EMISSIVE => material.emissive = [0.0; 3],
        // White, as a factor, says nothing.
        slots::BASE if mesh.colors.is_empty() && material.base_color[..3] == [1.0; 3] => {
            let [r, g, b, _] = Rgba::from_srgb8(DEFAULT_COLOR).0;
            material.base_color = [r, g, b, material.base_color[3]];
        }
        _ => {}
    }
}

fn fill(material: &mut ShadedMaterial, mesh: &Mesh, slot: &MaterialSlot, surface: &Surface) {
    // Grey would darken a base texture or vertex colours.
    let is_painted = slot.base_texture.is_some() || !mesh.colors.is_empty();
    let none = if is_painted { [1.0; 4] } else { Rgba::from_srgb8(DEFAULT_COLOR).0 };
    let file = slot.base_color.unwrap_or(none);
    material.base_color = surface.color.map_or(file, |color| color.0);
    if surface.debug == DebugView::None && surface.facing_opacity < 1.0 {
        material.facing_opacity = surface.facing_opacity;
        material.flags |= flags::BY_ANGLE;
    }
    material.opacity = if surface.debug == DebugView::None { surface.opacity } else { 1.0 };
    material.metallic = surface.metallic.or(slot.metallic).unwrap_or(0.0);
    material.roughness = surface.roughness.or(slot.roughness).unwrap_or(DEFAULT_ROUGHNESS);
    material.normal_scale = slot.normal_scale.unwrap_or(1.0);
    material.occlusion_texture_strength = slot.occlusion_texture_strength.unwrap_or(1.0);
    material.emissive = match surface.emissive {
        Some(Rgba([r, g, b, a])) => [r, g, b].map(|v| v * a),
        None => slot.emissive.unwrap_or_default(),
    };
    // A colour in the request replaces all colours of the file.
    if surface.color.is_none() && !mesh.colors.is_empty() {
        material.flags |= flags::VERTEX_COLORS;
    }
    let alpha = if surface.color.is_some() { AlphaMode::Blend } else { slot.alpha };
    material.flags |= match alpha {
        _ if surface.debug != DebugView::None => 0,
        AlphaMode::Mask(cutoff) => {
            material.alpha_cutoff = cutoff;
            flags::MASK
        }
        AlphaMode::Blend => flags::BLEND,
        AlphaMode::Opaque => 0,
    };
    if surface.metallic.is_some() {
        material.flags |= flags::OWN_METALLIC;
    }
    if surface.roughness.is_some() {
        material.flags |= flags::OWN_ROUGHNESS;
    }
    let shows_colors = surface.debug == DebugView::VertexColor && !mesh.colors.is_empty();
    if shows_colors || heat::is_heat(surface.debug) {
        material.flags |= flags::VERTEX_COLORS;
    }
}

fn shading_flags(slot: &MaterialSlot, surface: &Surface) -> u32 {
    let debug = match surface.debug {
        DebugView::None => 0,
        DebugView::Barycentric => super::debug_views::BARYCENTRIC,
        DebugView::MinBarycentric => super::debug_views::MIN_BARYCENTRIC,
        DebugView::EdgeDistance => super::debug_views::EDGE_DISTANCE,
        DebugView::Normal => super::debug_views::NORMAL,
        DebugView::Uv => super::debug_views::UV,
        DebugView::FaceOrientation => super::debug_views::FACE_ORIENTATION,
        // The plan computes the others as vertex colours.
        _ => super::debug_views::VERTEX_COLOR,
    };
    let normals = match (surface.shading, surface.normals) {
        (_, FlatNormals::Face) if surface.debug == DebugView::FaceOrientation => flags::FACE_NORMALS,
        (Shading::Flat, FlatNormals::Face) => flags::FACE_NORMALS,
        (Shading::Flat, FlatNormals::Derivative) => flags::DERIVATIVE_NORMALS,
        // An unlit material has its light painted into its colours, as its author means it.
        (Shading::Smooth, _) if slot.unlit && surface.debug == DebugView::None => 0,
        (Shading::Smooth, _) => flags::VERTEX_NORMALS,
        (Shading::Unlit, _) if surface.debug == DebugView::Normal => flags::FACE_NORMALS,
        (Shading::Unlit, _) => 0,
    };
    normals | debug << flags::DEBUG_SHIFT
}

fn sample(
    material: &mut ShadedMaterial,
    mesh: &Mesh,
    slot: &MaterialSlot,
    surface: &Surface,
    textures: &mut TextureLoader<'_, '_>,
) -> Result<(), PlanError> {
    let is_lit = material.flags & (flags::FACE_NORMALS | flags::DERIVATIVE_NORMALS | flags::VERTEX_NORMALS) != 0;
    let reads_texture = surface.metallic.is_none() || surface.roughness.is_none();
    let wanted: [(usize, bool, &Option<TextureRef>, bool); slots::COUNT] = [
        (slots::BASE, surface.color.is_none(), &slot.base_texture, true),
        (slots::METALLIC_ROUGHNESS, is_lit && reads_texture, &slot.metallic_roughness_texture, false),
        // The other kinds of normals show the faces as they are.
        (slots::NORMAL, material.flags & flags::VERTEX_NORMALS != 0, &slot.normal_texture, false),
        (slots::EMISSIVE, surface.emissive.is_none() && material.emissive != [0.0; 3], &slot.emissive_texture, true),
        (slots::OCCLUSION_TEXTURE, is_lit && material.occlusion_texture_strength > 0.0, &slot.occlusion_texture, false),
    ];
    for (place, is_needed, texture, is_color) in wanted {
        if let Some(texture) = texture.as_ref().filter(|_| is_needed) {
            let is_cut_out = place == slots::BASE && material.flags & flags::MASK != 0;
            let reading = if is_cut_out { cut_out(material, textures) } else { Reading::plain(is_color) };
            match textures.load(texture, reading)? {
                Some(texture) if reading.is_cut_out() => {
                    // Alpha is what is left of a pixel. The material's own is in the cutoff.
                    material.flags = material.flags & !flags::MASK | flags::BLEND;
                    material.base_color[3] = 1.0;
                    material.textures[place] =
                        TextureUse { sampler: texture.sampler | super::samplers::CUT_OUT, ..texture };
                }
                Some(texture) => material.textures[place] = texture,
                None => remove_texture(material, mesh, place),
            }
        }
    }
    Ok(())
}

/// The reading of a base texture whose texels below the cutoff are left out. The material's own alpha
/// multiplies theirs. Where vertices have alphas no cutoff is that of the whole texture: then points are compared with
/// it.
fn cut_out(material: &ShadedMaterial, textures: &TextureLoader<'_, '_>) -> Reading {
    if material.flags & flags::VERTEX_COLORS != 0 && textures.has_vertex_alpha() {
        return Reading::plain(true);
    }
    Reading::cut_out(material.alpha_cutoff / material.base_color[3])
}

fn wire_of(material: &mut ShadedMaterial, wire: &Wire) {
    material.wire_color = wire_color(wire);
    material.wire_thickness = wire.thickness.largest();
    material.wire_smoothing = wire.smoothing;
    material.flags |= match wire.method {
        WireMethod::Exact => 0,
        WireMethod::Fwidth => flags::WIRE_FWIDTH,
        WireMethod::FwidthMin => flags::WIRE_FWIDTH_MIN,
        WireMethod::Barycentric => flags::WIRE_BARYCENTRIC,
        WireMethod::Threshold => flags::WIRE_THRESHOLD,
    };
    if wire.lit {
        material.flags |= flags::WIRE_LIT;
    }
}

/// True if a material samples any texture.
pub fn samples(material: &ShadedMaterial) -> bool {
    material.textures.iter().any(|texture| texture.texture != TEXTURE_NONE)
}
