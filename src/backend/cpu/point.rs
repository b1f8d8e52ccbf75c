//! The colour of one point of the surface: stage 3's formulas. Twin of `shaders/point.wgsl`.

use super::Stages;
use super::barycentric::{Barycentrics, corners};
use super::light::light;
use super::transform::ScreenVertex;
use super::visibility::area;
use super::wire::wire_factor;
use crate::plan::{SurfacePass, flags};

/// Shades points of surface triangles.
pub struct PointShader<'a> {
    stages: &'a Stages<'a>,
    /// Flat colours do not change over a triangle: the last one is kept.
    flat: Option<(u32, [f32; 4])>,
}

impl<'a> PointShader<'a> {
    /// One for a band.
    pub fn new(stages: &'a Stages<'a>) -> Self {
        Self { stages, flat: None }
    }

    /// The colour of triangle `id` where it is known to be the same all over, and is the one that was shaded last.
    #[inline(always)]
    pub fn flat(&self, id: u32) -> Option<[f32; 4]> {
        self.flat.filter(|(last, _)| *last == id).map(|(_, color)| color)
    }

    /// Premultiplied linear RGBA of surface triangle `id` at a point, in 1/256 px from the picture's centre.
    pub fn color(&mut self, surface: &SurfacePass<'_>, id: u32, at: [f32; 2]) -> [f32; 4] {
        let material = surface.material(id as usize);
        let flat = material.flags & (flags::VERTEX_NORMALS | flags::WIRES) == 0;
        let bary = || Barycentrics::new(&corners(self.stages, id, at));
        let up = self.stages.plan.projection.screen_up;
        let lit = if material.flags & flags::FACE_NORMALS != 0 {
            let normal = facing(surface.face_normals[id as usize], self.is_front(id, at));
            light(&surface.lights, material, up, normal)
        } else if let Some(normals) =
            surface.vertex_normals.as_ref().filter(|_| material.flags & flags::VERTEX_NORMALS != 0)
        {
            let b = bary();
            let normal = interpolate(&normals.values, normals.triangles[id as usize], b.value);
            light(&surface.lights, material, up, facing(normal, b.front))
        } else {
            material.base_color
        };
        let color = if material.flags & flags::WIRES != 0 {
            over(wire_factor(surface, material, id as usize, &bary()), material.wire_color, lit)
        } else {
            lit
        };
        if flat {
            self.flat = Some((id, color));
        }
        color
    }

    fn is_front(&self, id: u32, at: [f32; 2]) -> bool {
        let vertices = self.stages.screen_triangle(id);
        if vertices.iter().any(ScreenVertex::is_outside) {
            return Barycentrics::new(&corners(self.stages, id, at)).front;
        }
        area(&vertices) < 0
    }
}

/// The value between three corners.
pub fn interpolate(values: &[[f32; 3]], corners: [u32; 3], b: [f32; 3]) -> [f32; 3] {
    let [n0, n1, n2] = corners.map(|i| values[i as usize]);
    std::array::from_fn(|k| (b[0] * n0[k] + b[1] * n1[k]) + b[2] * n2[k])
}

/// The unit normal on the viewer's side.
pub fn facing(n: [f32; 3], front: bool) -> [f32; 3] {
    let length_squared = dot(n, n);
    let scale = if length_squared > 1e-20 { 1.0 / length_squared.sqrt() } else { 0.0 };
    let scale = if front { scale } else { -scale };
    n.map(|v| v * scale)
}

fn over(cover: f32, top: [f32; 4], under: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|k| cover * top[k] + under[k] * (1.0 - cover * top[3]))
}

/// Scalar product.
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}
