//! Stage shade: points of a row wait until there are eight of one material, and are shaded together.

use super::point::{Points, Show};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::plan::SurfacePass;

/// Points that wait to be shaded, of triangles of one material.
pub struct Waiting<'a> {
    context: &'a RasterContext<'a>,
    surface: &'a SurfacePass<'a>,
    /// Index of the material.
    material: u32,
    points: Points8,
}

/// A point of a triangle, for which a pixel is shaded.
pub struct Point {
    /// The triangle.
    pub id: u32,
    /// In 1/256 px from the picture's centre.
    pub at: [f32; 2],
    /// The triangle's share of the pixel, 0 to 1.
    pub weight: f32,
    /// Index of the pixel in its row.
    pub pixel: u32,
    /// Share of the light that reaches it, 0 to 1.
    pub open: f32,
}

/// Up to eight [`Point`]s, a vector for each field. Vectors hold earlier points from `len` on.
#[derive(Default)]
pub struct Points8 {
    len: usize,
    ids: [u32; LANES],
    at: [[f32; LANES]; 2],
    weights: [f32; LANES],
    pixels: [u32; LANES],
    open: [f32; LANES],
}

impl<'a> Waiting<'a> {
    /// None yet.
    pub fn new(context: &'a RasterContext<'a>, surface: &'a SurfacePass<'a>) -> Self {
        Self { context, surface, material: 0, points: Points8::default() }
    }

    /// Adds a point. Shades those that wait if there are eight, or if its material is another.
    #[inline(always)]
    pub fn push(&mut self, point: Point, row: &mut [[f32; 4]]) {
        let material = self.surface.triangle_materials.get(point.id as usize).map_or(0, |&material| material);
        if self.points.len == LANES || material != self.material {
            self.shade(row);
            self.material = material;
        }
        let l = self.points.len % LANES;
        let points = &mut self.points;
        points.ids[l] = point.id;
        (points.at[0][l], points.at[1][l]) = (point.at[0], point.at[1]);
        (points.weights[l], points.pixels[l], points.open[l]) = (point.weight, point.pixel, point.open);
        points.len = l + 1;
    }

    /// Shades the points that wait, and adds their shares to the pixels of their row, in the order in
    /// which they came.
    #[inline(always)]
    pub fn shade(&mut self, row: &mut [[f32; 4]]) {
        if self.points.len > 0 {
            shade_points(self.context.isa, self.context, self.surface, &self.points, row);
            self.points.len = 0;
        }
    }
}

dispatch! {
    /// Shades up to eight points of triangles of one material, and adds their shares to pixels.
    pub fn shade_points(context: &RasterContext<'_>, surface: &SurfacePass<'_>, points: &Points8, row: &mut [[f32; 4]]) = shade_kernel
}

#[inline(always)]
fn shade_kernel(context: &RasterContext<'_>, surface: &SurfacePass<'_>, points: &Points8, row: &mut [[f32; 4]]) {
    let Points8 { len, ids, at, weights, pixels, open } = points;
    let material = surface.material(ids[0] as usize);
    let colors = Points { context, surface, material, show: Show::ALL }.colors(ids, at, open);
    for l in 0..(*len).min(LANES) {
        if let Some(pixel) = row.get_mut(pixels[l] as usize) {
            for k in 0..4 {
                pixel[k] += weights[l] * colors[k][l];
            }
        }
    }
}
