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
    points: [Point; LANES],
    len: usize,
}

/// A point of a triangle, for which a pixel is shaded.
#[derive(Clone, Copy, Default)]
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

impl<'a> Waiting<'a> {
    /// None yet.
    pub fn new(context: &'a RasterContext<'a>, surface: &'a SurfacePass<'a>) -> Self {
        Self { context, surface, material: 0, points: [Point::default(); LANES], len: 0 }
    }

    /// Adds a point. Shades those that wait if there are eight, or if its material is another.
    #[inline(always)]
    pub fn push(&mut self, point: Point, row: &mut [[f32; 4]]) {
        let material = self.surface.triangle_materials.get(point.id as usize).map_or(0, |&material| material);
        if self.len == LANES || material != self.material {
            self.shade(row);
            self.material = material;
        }
        self.points[self.len % LANES] = point;
        self.len += 1;
    }

    /// Shades the points that wait, and adds their shares to the pixels of their row, in the order in
    /// which they came.
    #[inline(always)]
    pub fn shade(&mut self, row: &mut [[f32; 4]]) {
        if self.len > 0 {
            shade_points(self.context.isa, self.context, self.surface, &self.points[..self.len.min(LANES)], row);
            self.len = 0;
        }
    }
}

dispatch! {
    /// Shades up to eight points of triangles of one material, and adds their shares to pixels.
    pub fn shade_points(context: &RasterContext<'_>, surface: &SurfacePass<'_>, points: &[Point], row: &mut [[f32; 4]]) = shade_kernel
}

#[inline(always)]
fn shade_kernel(context: &RasterContext<'_>, surface: &SurfacePass<'_>, points: &[Point], row: &mut [[f32; 4]]) {
    let Some(first) = points.first() else { return };
    let (mut ids, mut at, mut open) = ([first.id; LANES], first.at.map(|v| [v; LANES]), [1.0; LANES]);
    for (l, point) in points.iter().enumerate().take(LANES) {
        (ids[l], open[l]) = (point.id, point.open);
        (at[0][l], at[1][l]) = (point.at[0], point.at[1]);
    }
    let material = surface.material(first.id as usize);
    let colors = Points { context, surface, material, show: Show::ALL }.colors(&ids, &at, &open);
    for (l, point) in points.iter().enumerate().take(LANES) {
        if let Some(pixel) = row.get_mut(point.pixel as usize) {
            for k in 0..4 {
                pixel[k] += point.weight * colors[k][l];
            }
        }
    }
}
