//! Cut-outs: faces with a texture whose alpha mask makes parts of them invisible, such as a card
//! with a leaf on it. This module finds which of these faces, and which of their sides, show no
//! texel at all. In a picture that shows the mask, such a side counts as absent for outlines
//! (`silhouettes`), and the camera is not fitted to such a face (`framing`).
//!
//! The result depends on the mesh alone and is found once for it, from the texels of its images. It
//! is conservative: a face or a side counts as visible unless certainly nothing of it shows.

mod pyramid;

use std::sync::Arc;

use self::pyramid::Pyramid;
use super::PlanError;
use crate::limits::{Budget, Deadline};
use crate::mesh::material::{AlphaMode, ImageContent, TextureRef};
use crate::mesh::{MaterialSlot, Mesh};
use crate::scene::MaterialGroups;
use crate::spec::{DebugView, Layers, Surface};
use crate::texture::decode;

/// Squares of pyramids that are looked at for one mesh. On further faces something shows.
const LOOKS_MAX: u64 = 1 << 27;

/// Faces between two looks at the deadline.
const CHECK_EVERY: usize = 1 << 12;

/// Bit of a face that shows something; those below are of its sides, corner i to i + 1.
const FACE: u8 = 8;

/// All of it.
const ALL: u8 = 15;

/// Visible parts of the faces with cut-out textures.
#[derive(Debug, Default)]
pub struct CutOuts {
    /// By face, the bits of what shows; empty where all does.
    shown: Vec<u8>,
}

impl CutOuts {
    /// Those of a mesh.
    pub fn of(mesh: &Mesh, budget: &mut Budget, deadline: &Deadline) -> Result<Self, PlanError> {
        let mut shown = Vec::new();
        let mut looks = 0;
        for (material, slot) in mesh.materials.iter().enumerate() {
            let Some((texture, cutoff)) = cut_out(mesh, slot) else { continue };
            let Some(pyramid) = pyramid_of(mesh, texture, cutoff, budget, deadline)? else { continue };
            if shown.is_empty() {
                budget.spend("cut-out faces", mesh.triangles.len() as u64, 1)?;
                shown = vec![ALL; mesh.triangles.len()];
            }
            for (face, bits) in shown.iter_mut().enumerate() {
                if face.is_multiple_of(CHECK_EVERY) {
                    deadline.check()?;
                }
                if mesh.triangle_materials[face] == material as u32 && looks <= LOOKS_MAX {
                    *bits = shown_of(mesh, face, texture, &pyramid, &mut looks);
                }
            }
        }
        Ok(Self { shown })
    }

    /// True if a face shows nothing.
    pub fn is_absent(&self, face: usize) -> bool {
        self.shown.get(face).is_some_and(|bits| bits & FACE == 0)
    }

    /// True if nothing shows at the side between two corners of a face.
    pub fn is_free(&self, mesh: &Mesh, face: usize, [a, b]: [u32; 2]) -> bool {
        let Some(&bits) = self.shown.get(face).filter(|bits| **bits != ALL) else { return false };
        let corners = mesh.triangles[face];
        let is_side = |&k: &usize| [[a, b], [b, a]].contains(&[corners[k], corners[(k + 1) % 3]]);
        (0..3).find(is_side).is_some_and(|k| bits & (1 << k) == 0)
    }

    /// Memory that it takes, bytes.
    pub fn bytes(&self) -> usize {
        self.shown.len()
    }
}

/// The texture of a material with a mask, and the least alpha of its texels that is drawn.
fn cut_out<'m>(mesh: &Mesh, slot: &'m MaterialSlot) -> Option<(&'m TextureRef, f32)> {
    let (AlphaMode::Mask(cutoff), Some(texture)) = (slot.alpha, &slot.base_texture) else { return None };
    // Vertex colours only make it less.
    let alpha = slot.base_color.map_or(1.0, |color| color[3]);
    let is_placed = !mesh.uvs.is_empty() && mesh.attribute_triangles.len() == mesh.triangles.len();
    // A little less, because alpha is rounded to half floats.
    (is_placed && cutoff > 0.0).then_some((texture, 0.998 * cutoff / alpha))
}

/// The pyramid of a texture; None where its image cannot be read, and so is not drawn either.
fn pyramid_of(
    mesh: &Mesh,
    texture: &TextureRef,
    cutoff: f32,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<Option<Pyramid>, PlanError> {
    let source = mesh.images.get(texture.image as usize);
    let Some((source, ImageContent::Encoded(bytes))) = source.map(|source| (source, &source.content)) else {
        return Ok(None);
    };
    deadline.check()?;
    let Ok(header) = decode::header(&source.name, bytes) else { return Ok(None) };
    budget.spend("decoding a cut-out texture", header.decoding_bytes, 1)?;
    pyramid::spend(budget, header.width, header.height)?;
    match decode::decode(&source.name, bytes, &header) {
        Ok(pixels) => Ok(Some(Pyramid::new(&pixels, cutoff, deadline)?)),
        Err(_) => Ok(None),
    }
}

/// The bits of what shows of a face.
fn shown_of(mesh: &Mesh, face: usize, texture: &TextureRef, pyramid: &Pyramid, looks: &mut u64) -> u8 {
    let corners = mesh.attribute_triangles[face].map(|v| {
        let [u, v] = mesh.uvs[v as usize].map(f64::from);
        texture.transform.map(|[a, b, c]| f64::from(a) * u + f64::from(b) * v + f64::from(c))
    });
    let mut meets = |corners| pyramid.meets(corners, texture.wrap, looks);
    if !meets(corners) {
        return 0;
    }
    let side = |k: usize| [corners[k], corners[(k + 1) % 3], corners[(k + 1) % 3]];
    (0..3).filter(|&k| meets(side(k))).fold(FACE, |bits, k| bits | 1 << k)
}

/// Visible parts of a mesh's faces, and the materials for which they count in a picture.
pub type MaskedFaces = (Arc<CutOuts>, Vec<bool>);

/// True if a style shows the mask of a file's material.
fn shows_mask(layers: &Layers, slot: &MaterialSlot) -> bool {
    let shows = |surface: Surface| surface.color.is_none() && surface.textures && surface.debug == DebugView::None;
    matches!(slot.alpha, AlphaMode::Mask(_)) && slot.base_texture.is_some() && layers.surface.is_some_and(shows)
}

/// By material, whether its cut-outs count in this picture; empty where none do.
pub fn masked(mesh: &Mesh, groups: &MaterialGroups<'_>) -> Vec<bool> {
    let pairs = groups.by_material.iter().zip(&mesh.materials);
    let masked: Vec<bool> = pairs.map(|(layers, slot)| shows_mask(layers, slot)).collect();
    if masked.contains(&true) { masked } else { Vec::new() }
}
