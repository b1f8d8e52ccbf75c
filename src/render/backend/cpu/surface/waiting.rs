//! The points of a band (a range of pixel rows) that wait to be shaded, and their shading (stage
//! shade). When there are 32 of one material, the next point has another material, or the band ends,
//! they are shaded eight at a time and added to their pixels.

use super::barycentric::{Barycentrics, Corners};
use super::point::{Points, Show, is_smooth};
use super::texture::of_corners;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::backend::cpu::vector::part;
use crate::plan::SurfacePass;

/// Points that are shaded together, at most. The corners of so many are read in one go, so that the processor waits for
/// many of them at a time.
pub const BLOCK: usize = 32;

/// Points that wait to be shaded, of triangles of one material.
pub struct Waiting<'a> {
    context: &'a RasterContext<'a>,
    surface: &'a SurfacePass<'a>,
    /// Index of the material.
    material: u32,
    points: PointBlock,
}

/// A point of a triangle, for which a pixel is shaded.
pub struct Point {
    /// The triangle.
    pub id: u32,
    /// In 1/256 px from the picture's centre.
    pub at: [f32; 2],
    /// The triangle's share of the pixel, 0 to 1.
    pub weight: f32,
    /// Index of the pixel among the colours that are passed.
    pub pixel: u32,
    /// Share of the light that reaches it, 0 to 1.
    pub open: f32,
}

/// Up to [`BLOCK`] [`Point`]s, a list for each field. Lists hold earlier points from `len` on.
#[derive(Default)]
pub struct PointBlock {
    len: usize,
    ids: [u32; BLOCK],
    at: [[f32; BLOCK]; 2],
    weights: [f32; BLOCK],
    pixels: [u32; BLOCK],
    open: [f32; BLOCK],
}

impl<'a> Waiting<'a> {
    /// None yet.
    pub fn new(context: &'a RasterContext<'a>, surface: &'a SurfacePass<'a>) -> Self {
        Self { context, surface, material: 0, points: PointBlock::default() }
    }

    /// Adds a point. Shades those that wait if there are as many as can be, or if its material is another.
    #[inline(always)]
    pub fn push(&mut self, point: Point, colors: &mut [[f32; 4]]) {
        let material = self.surface.triangle_materials.get(point.id as usize).map_or(0, |&material| material);
        if self.points.len == BLOCK || material != self.material {
            self.shade(colors);
            self.material = material;
        }
        let l = self.points.len % BLOCK;
        let points = &mut self.points;
        points.ids[l] = point.id;
        (points.at[0][l], points.at[1][l]) = (point.at[0], point.at[1]);
        (points.weights[l], points.pixels[l], points.open[l]) = (point.weight, point.pixel, point.open);
        points.len = l + 1;
    }

    /// Shades the points that wait, and adds their shares to the colours of their pixels, in the order in
    /// which they came.
    #[inline(always)]
    pub fn shade(&mut self, colors: &mut [[f32; 4]]) {
        if self.points.len > 0 {
            shade_points(self.context.isa, self.context, self.surface, &self.points, colors);
            self.points.len = 0;
        }
    }
}

dispatch! {
    /// Shades points of triangles of one material, and adds their shares to pixels.
    pub fn shade_points(
        context: &RasterContext<'_>,
        surface: &SurfacePass<'_>,
        points: &PointBlock,
        colors: &mut [[f32; 4]],
    ) = shade_kernel
}

#[inline(always)]
fn shade_kernel(context: &RasterContext<'_>, surface: &SurfacePass<'_>, points: &PointBlock, colors: &mut [[f32; 4]]) {
    let material = surface.material(points.ids[0] as usize);
    let shader = Points { context, surface, material, show: Show::ALL };
    let groups = (0..points.len.min(BLOCK)).step_by(LANES);
    match &surface.vertex_normals {
        // The same colours as below. Fewer points would not be worth the reading.
        Some(normals) if points.len > LANES && is_smooth(surface, material) => {
            let corners = Corners::new(context, &points.ids, &points.at);
            let normals = of_corners(normals, &points.ids);
            for first in groups {
                let mut own = [[[0.0; LANES]; 3]; 3];
                for (own, all) in own.as_flattened_mut().iter_mut().zip(normals.as_flattened()) {
                    *own = part(all, first);
                }
                points.add(
                    first,
                    &shader.smooth(&Barycentrics::new(&corners.part(first)), &own, &part(&points.open, first)),
                    colors,
                );
            }
        }
        _ => {
            for first in groups {
                let at = [part(&points.at[0], first), part(&points.at[1], first)];
                points.add(first, &shader.colors(&part(&points.ids, first), &at, &part(&points.open, first)), colors);
            }
        }
    }
}

impl PointBlock {
    /// Adds the colours of points from `first` on to those of their pixels.
    #[inline(always)]
    fn add(&self, first: usize, shaded: &[[f32; LANES]; 4], colors: &mut [[f32; 4]]) {
        let (weights, pixels): ([f32; LANES], [u32; LANES]) = (part(&self.weights, first), part(&self.pixels, first));
        for l in 0..LANES.min(self.len - first) {
            if let Some(pixel) = colors.get_mut(pixels[l] as usize) {
                for k in 0..4 {
                    pixel[k] += weights[l] * shaded[k][l];
                }
            }
        }
    }
}
