//! The look of a face: the numbers that decide its colour, such as its material and its normals, as far as they are
//! known without shading it (stage mixed). Where faces meet that look different, pixels are drawn a second time, from
//! more points, unless colours go on over a shared corner.
//!
//! Looks are only compared with each other. They consist of numbers that are equal on both back-ends to the bit.
//! Shaded colours would not do, because their last bits may differ.

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::NOTHING;
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::backend::cpu::geometry::visibility::area;
use crate::backend::cpu::vector::turned_to_viewer;
use crate::plan::{ShadedMaterial, SurfacePass, TEXTURE_NONE, flags};

/// Flags of materials whose colour does not go on smoothly where faces share a corner.
const BROKEN: u32 = flags::DERIVATIVE_NORMALS | flags::DEBUG | flags::WIRES | flags::BY_ANGLE;

/// Largest difference of two values, squared, over their sum, up to which faces look alike: normals that
/// differ by about 14 degrees, or colours by about 25/255.
pub const ALIKE: f32 = 1.0 / 48.0;

/// The same up to which they differ slightly: normals by about 50 degrees.
pub const SLIGHT: f32 = 1.0 / 4.0;

/// Added to normals, so that all values are above 0.
pub const NORMAL_SHIFT: f32 = 1.5;

/// Factor of the normals of metals that mirror sharply: those that differ by about a degree look alike.
pub const MIRROR_SCALE: f32 = 256.0;

/// The highest bits of a key: what its other bits say.
pub mod kinds {
    /// Index of the material of faces that differ by their normals alone.
    pub const BY_NORMAL: u32 = 1 << 30;
    /// Nothing: triangles of the outline that differ by their colours alone.
    pub const BY_COLOR: u32 = 2 << 30;
    /// Id of a face that is like no other.
    pub const UNIQUE: u32 = 3 << 30;
}

/// Place of the lowest bit of a key that says its kind.
const KIND_SHIFT: u32 = 30;

/// Flags of materials whose colour depends on more than a normal.
const MANY_COLORED: u32 = flags::DERIVATIVE_NORMALS
    | flags::VERTEX_COLORS
    | flags::DEBUG
    | flags::WIRES
    | flags::BY_ANGLE
    | flags::MASK
    | flags::BLEND;

/// A step of colours from one face to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// They go on: the faces are the same, look alike, or are linked.
    None,
    /// They break off, though not by much.
    Slight,
    /// They break off.
    Hard,
}

/// Ranges of what decides colours, of one face or of several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Smallest values: of normals, or of colours.
    pub low: [f32; 3],
    /// Largest values.
    pub high: [f32; 3],
    /// Smallest and largest key. Faces with different keys never look alike.
    pub keys: [u32; 2],
}

impl Look {
    /// The look of no face at all.
    pub const NOTHING: Self = Self { low: [0.0; 3], high: [0.0; 3], keys: [kinds::UNIQUE | NOTHING; 2] };

    /// A look of one value.
    #[inline(always)]
    fn of_one(v: [f32; 3], key: u32) -> Self {
        Self { low: v, high: v, keys: [key; 2] }
    }

    /// The look of a face, or of the outline's triangle, or of nothing.
    #[inline(always)]
    pub fn of(context: &RasterContext<'_>, id: u32) -> Self {
        if id == NOTHING {
            return Self::NOTHING;
        }
        let unique = || Self::of_one([0.0; 3], kinds::UNIQUE | id);
        if context.is_hull(id) {
            let color = context.plan.hull.as_ref().map(|hull| hull.color(id as usize));
            return color.map_or_else(unique, |[r, g, b, _]| Self::of_one([r, g, b], kinds::BY_COLOR));
        }
        let corners = context.screen_triangle(id);
        let surface = context.plan.surface.as_ref().filter(|surface| surface.is_shaded);
        let Some(surface) = surface.filter(|_| !corners.iter().any(ScreenVertex::is_outside)) else { return unique() };
        let material = surface.material(id as usize);
        if material.flags & MANY_COLORED != 0 || is_textured(material) {
            return unique();
        }
        let key = kinds::BY_NORMAL | surface.triangle_materials.get(id as usize).copied().unwrap_or(0);
        let shifted = |n: [f32; 3]| normal_values(material, n, area(&corners) < 0);
        if material.flags & flags::LIT == 0 {
            return Self::of_one([0.0; 3], key);
        }
        if material.flags & flags::VERTEX_NORMALS == 0 {
            return Self::of_one(shifted(face_normal(surface, id)), key);
        }
        let Some([a, b, c]) = corner_normals(surface, id) else { return unique() };
        let of_corner = |n: [f32; 3]| Self::of_one(shifted(n), key);
        of_corner(a).and(&of_corner(b)).and(&of_corner(c))
    }

    /// True for faces that only their normal tells from others of their material, the same at all corners.
    #[inline(always)]
    pub fn is_of_one_normal(&self) -> bool {
        self.keys[0] >> KIND_SHIFT == kinds::BY_NORMAL >> KIND_SHIFT && self.low == self.high
    }

    /// The look of these faces and those.
    #[inline(always)]
    fn and(&self, other: &Self) -> Self {
        let mut all = *self;
        for k in 0..3 {
            all.low[k] = if other.low[k] < all.low[k] { other.low[k] } else { all.low[k] };
            all.high[k] = if other.high[k] > all.high[k] { other.high[k] } else { all.high[k] };
        }
        all.keys = [all.keys[0].min(other.keys[0]), all.keys[1].max(other.keys[1])];
        all
    }

    /// The step from the colours of these faces to those of others.
    #[inline(always)]
    pub fn step_to(&self, other: &Self) -> Step {
        let all = self.and(other);
        if all.keys[0] != all.keys[1] {
            return Step::Hard;
        }
        let (mut is_like, mut is_near) = (true, true);
        for k in 0..3 {
            let (difference, sum) = (all.high[k] - all.low[k], all.high[k] + all.low[k]);
            is_like &= difference * difference <= ALIKE * sum;
            is_near &= difference * difference <= SLIGHT * sum;
        }
        match (is_like, is_near) {
            (true, _) => Step::None,
            (false, true) => Step::Slight,
            (false, false) => Step::Hard,
        }
    }
}

/// The step between two faces of which all but the normal goes on from one to the other; a hard one between others.
#[inline(always)]
pub fn step_of_linked(context: &RasterContext<'_>, a: u32, b: u32) -> Step {
    let surface = context.plan.surface.as_ref().filter(|_| are_linked(context, a, b));
    let Some(surface) = surface else { return Step::Hard };
    if surface.material(a as usize).flags & flags::FACE_NORMALS == 0 {
        return Step::None;
    }
    let front = area(&context.screen_triangle(a)) < 0;
    let of = |id: u32| Look::of_one(normal_values(surface.material(a as usize), face_normal(surface, id), front), 0);
    of(a).step_to(&of(b))
}

/// The values of a normal.
#[inline(always)]
fn normal_values(material: &ShadedMaterial, normal: [f32; 3], front: bool) -> [f32; 3] {
    let scale = if material.mirrors_sharply() { MIRROR_SCALE } else { 1.0 };
    let mut values = turned_to_viewer(normal, front);
    for k in 0..3 {
        values[k] = scale * (values[k] + NORMAL_SHIFT);
    }
    values
}

#[inline(always)]
fn is_textured(material: &ShadedMaterial) -> bool {
    material.textures.iter().any(|used| used.texture != TEXTURE_NONE)
}

#[inline(always)]
fn face_normal(surface: &SurfacePass<'_>, id: u32) -> [f32; 3] {
    surface.face_normals.get(id as usize).copied().unwrap_or_default()
}

#[inline(always)]
fn corner_normals(surface: &SurfacePass<'_>, id: u32) -> Option<[[f32; 3]; 3]> {
    let normals = surface.vertex_normals.as_ref()?;
    let [a, b, c] = *normals.triangles.get(id as usize)?;
    let of = |i: u32| normals.values.get(i as usize).copied();
    Some([of(a)?, of(b)?, of(c)?])
}

/// True if two ids are the same, or faces whose colours go on from one to the other but for their face normals: they
/// show the same side, and share a corner with all that is interpolated between corners.
#[inline(always)]
fn are_linked(context: &RasterContext<'_>, a: u32, b: u32) -> bool {
    if a == b {
        return true;
    }
    let surface = context.plan.surface.as_ref().filter(|surface| surface.is_shaded);
    let (Some(surface), false) = (surface, context.is_hull(a) | context.is_hull(b)) else { return false };
    let material_of = |id: u32| surface.triangle_materials.get(id as usize).copied().unwrap_or(0);
    let material = surface.material(a as usize);
    if material_of(a) != material_of(b) || material.flags & BROKEN != 0 {
        return false;
    }
    let [at_a, at_b] = [a, b].map(|id| context.screen_triangle(id));
    if at_a.iter().chain(&at_b).any(ScreenVertex::is_outside) || (area(&at_a) < 0) != (area(&at_b) < 0) {
        return false;
    }
    let has = |flag: u32| material.flags & flag != 0;
    let normals = surface.vertex_normals.as_ref().filter(|_| has(flags::VERTEX_NORMALS)).map(|v| &v.triangles[..]);
    let uvs = surface.uvs.as_ref().filter(|_| is_textured(material)).map(|v| &v.triangles[..]);
    let colors = surface.colors.as_ref().filter(|_| has(flags::VERTEX_COLORS)).map(|v| &v.triangles[..]);
    let shared = [Some(&context.plan.triangles[..]), normals, uvs, colors].map(|list| shared_corners(list, a, b));
    shared.into_iter().fold(ALL_CORNERS, |all, shared| all & shared) != 0
}

/// Bits of all pairs of corners of two triangles.
const ALL_CORNERS: u32 = (1 << 9) - 1;

/// A bit for each pair of corners of two triangles that have the same index; all where there is no list.
#[inline(always)]
fn shared_corners(list: Option<&[[u32; 3]]>, a: u32, b: u32) -> u32 {
    let Some(list) = list else { return ALL_CORNERS };
    let (Some(a), Some(b)) = (list.get(a as usize), list.get(b as usize)) else { return 0 };
    let mut shared = 0;
    for i in 0..3 {
        for j in 0..3 {
            shared |= u32::from(a[i] == b[j]) << (3 * i + j);
        }
    }
    shared
}
