//! Stage 3, a pixel: the colour of each triangle that is seen there. Twin of `shaders/shade.wgsl`.
//!
//! Samples of a pixel that see the same triangle are shaded once, at their mean position, and weigh their share. The
//! light is a headlight over the viewer's shoulder: Lambert plus the GGX lobe, with a sky that is brighter than the ground.

use super::Stages;
use super::samples::{NOTHING, SampleBand};
use super::transform::{ScreenVertex, homogeneous, hull_position};
use super::visibility::area;
use crate::plan::{Lights, MaterialLook, SurfacePass, flags, sample_offsets};

/// Shades every pixel of the band into `colors` (premultiplied linear RGBA, row by row, nothing behind it).
#[inline(always)]
pub fn shade(stages: &Stages<'_>, band: &SampleBand, colors: &mut [[f32; 4]]) {
    let width = band.size_px[0];
    let mut shader = Shader::new(stages);
    for row in 0..band.rows {
        let y = band.first_row + row;
        let line = &mut colors[(row * width) as usize..][..width as usize];
        for (x, color) in (0_u32..).zip(line) {
            *color = shader.pixel(band, x, y);
        }
    }
}

/// What one point of the surface looks like.
struct Shader<'a> {
    stages: &'a Stages<'a>,
    /// Flat colours do not change over a triangle: the last one is kept.
    flat: Option<(u32, [f32; 4])>,
}

impl<'a> Shader<'a> {
    fn new(stages: &'a Stages<'a>) -> Self {
        Self { stages, flat: None }
    }

    #[inline(always)]
    fn pixel(&mut self, band: &SampleBand, x: u32, y: u32) -> [f32; 4] {
        let first = band.ids[band.index(x, y, 0)];
        if band.samples == 1 {
            return self.group(first, x, y, [8, 8], 1);
        }
        let mut ids = [first; 4];
        for s in 1..4 {
            ids[s] = band.ids[band.index(x, y, s as u32)];
        }
        if ids == [first; 4] {
            return self.group(first, x, y, [32, 32], 4);
        }
        self.mixed_pixel(ids, x, y)
    }

    fn mixed_pixel(&mut self, ids: [u32; 4], x: u32, y: u32) -> [f32; 4] {
        let offsets = sample_offsets(4);
        let mut sum = [0.0; 4];
        for s in 0..4 {
            // Each triangle is shaded at the first of its samples; the others are done with.
            if ids[..s].contains(&ids[s]) {
                continue;
            }
            let (mut offset, mut count) = ([0, 0], 0);
            for (id, at) in ids.iter().zip(offsets) {
                if *id == ids[s] {
                    offset = [offset[0] + at[0], offset[1] + at[1]];
                    count += 1;
                }
            }
            let color = self.group(ids[s], x, y, offset, count);
            let weight = count as f32 * 0.25;
            for k in 0..4 {
                sum[k] += weight * color[k];
            }
        }
        sum
    }

    /// The colour of triangle `id` at the mean of `count` samples whose offsets in 1/16 px add up to `offset_sum`.
    #[inline(always)]
    fn group(&mut self, id: u32, x: u32, y: u32, offset_sum: [i32; 2], count: i32) -> [f32; 4] {
        if id == NOTHING {
            return [0.0; 4];
        }
        if let Some((last, color)) = self.flat
            && last == id
        {
            return color;
        }
        let plan = self.stages.plan;
        let scale = 16.0 * [1.0, 0.5, 1.0 / 3.0, 0.25][count as usize - 1];
        let corner = [x as i32 * 256 - plan.width_px as i32 * 128, y as i32 * 256 - plan.height_px as i32 * 128];
        let at = [corner[0] as f32 + offset_sum[0] as f32 * scale, corner[1] as f32 + offset_sum[1] as f32 * scale];
        self.point(id, at)
    }

    fn point(&mut self, id: u32, at: [f32; 2]) -> [f32; 4] {
        let triangles = self.stages.plan.triangles.len() as u32;
        match (&self.stages.plan.surface, &self.stages.plan.hull) {
            (Some(surface), _) if id < triangles => self.surface_point(surface, id as usize, at),
            (_, Some(hull)) => hull.colors[0],
            _ => [0.0; 4],
        }
    }

    fn surface_point(&mut self, surface: &SurfacePass<'_>, id: usize, at: [f32; 2]) -> [f32; 4] {
        let material = surface.material(id);
        let flat = material.flags & (flags::VERTEX_NORMALS | flags::WIRES) == 0;
        let bary = || Barycentrics::new(&corners(self.stages, id as u32, at));
        let up = self.stages.plan.projection.screen_up;
        let lit = if material.flags & flags::FACE_NORMALS != 0 {
            let normal = facing(surface.face_normals[id], self.is_front(id as u32, at));
            light(&surface.lights, material, up, normal)
        } else if let Some(normals) =
            surface.vertex_normals.as_ref().filter(|_| material.flags & flags::VERTEX_NORMALS != 0)
        {
            let b = bary();
            let normal = interpolate(&normals.values, normals.triangles[id], b.value);
            light(&surface.lights, material, up, facing(normal, b.front))
        } else {
            material.base_color
        };
        let color = if material.flags & flags::WIRES != 0 {
            over(wire_factor(surface, material, id, &bary()), material.wire_color, lit)
        } else {
            lit
        };
        if flat {
            self.flat = Some((id as u32, color));
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

/// A corner relative to the shaded point: homogeneous (x, y, w), and the factor that its barycentric takes besides.
#[derive(Clone, Copy)]
struct Corner {
    x: f32,
    y: f32,
    w: f32,
    weight: f32,
}

/// The corners of a triangle seen from point `at`. Snapped corners where there are some; where one is behind the eye,
/// the homogeneous ones, which stay right there.
fn corners(stages: &Stages<'_>, id: u32, at: [f32; 2]) -> [Corner; 3] {
    let vertices = stages.screen_triangle(id);
    if vertices.iter().any(ScreenVertex::is_outside) {
        return stages.positions_of(id).map(|(position, _)| {
            let [x, y, _, w] = homogeneous(&stages.plan.projection, position);
            Corner { x: x - at[0] * w, y: y - at[1] * w, w, weight: 1.0 }
        });
    }
    vertices.map(|v| Corner { x: v.x as f32 - at[0], y: v.y as f32 - at[1], w: 1.0, weight: v.inv_w })
}

/// Perspective-correct barycentrics at a point and how fast they change on screen.
struct Barycentrics {
    value: [f32; 3],
    /// `|db/dx| + |db/dy|` a pixel.
    fwidth: [f32; 3],
    front: bool,
}

impl Barycentrics {
    /// `b_i` is proportional to `u_i = weight_i * (corner_j x corner_k)`, the area opposite the corner; linear in the
    /// point, so that its derivatives are exact.
    fn new(c: &[Corner; 3]) -> Self {
        let (mut u, mut ux, mut uy) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for i in 0..3 {
            let (j, k) = (&c[(i + 1) % 3], &c[(i + 2) % 3]);
            u[i] = c[i].weight * (j.x * k.y - k.x * j.y);
            ux[i] = c[i].weight * (k.w * j.y - j.w * k.y);
            uy[i] = c[i].weight * (j.w * k.x - k.w * j.x);
        }
        let sum = |v: &[f32; 3]| (v[0] + v[1]) + v[2];
        let total = sum(&u);
        let inverse = 1.0 / total;
        let (total_x, total_y) = (sum(&ux), sum(&uy));
        let value = u.map(|v| v * inverse);
        let fwidth = std::array::from_fn(|i| {
            let dx = (ux[i] - value[i] * total_x) * inverse;
            let dy = (uy[i] - value[i] * total_y) * inverse;
            256.0 * (dx.abs() + dy.abs())
        });
        Self { value, fwidth, front: total < 0.0 }
    }
}

fn interpolate(values: &[[f32; 3]], corners: [u32; 3], b: [f32; 3]) -> [f32; 3] {
    let [n0, n1, n2] = corners.map(|i| values[i as usize]);
    std::array::from_fn(|k| (b[0] * n0[k] + b[1] * n1[k]) + b[2] * n2[k])
}

/// The unit normal on the viewer's side.
fn facing(n: [f32; 3], front: bool) -> [f32; 3] {
    let length_squared = dot(n, n);
    let scale = if length_squared > 1e-20 { 1.0 / length_squared.sqrt() } else { 0.0 };
    let scale = if front { scale } else { -scale };
    n.map(|v| v * scale)
}

/// Light on a surface with unit normal `n`: straight alpha in, premultiplied out.
fn light(lights: &Lights, s: &MaterialLook, up: [f32; 3], n: [f32; 3]) -> [f32; 4] {
    let base = s.base_color;
    let alpha_squared = (s.roughness * s.roughness).max(0.0025) * (s.roughness * s.roughness).max(0.0025);
    let ambient = lights.ambient * (0.7 + 0.3 * dot(n, up));
    let (mut diffuse, mut shine) = (0.0, 0.0);
    for lamp in &lights.lamps {
        let n_light = dot(n, lamp.to_light).max(0.0);
        let n_half = dot(n, lamp.halfway).max(0.0);
        let light_half = dot(lamp.to_light, lamp.halfway);
        let lobe = n_half * n_half * (alpha_squared - 1.0) + 1.0;
        let gloss = alpha_squared / (lobe * lobe * (light_half * light_half).max(0.1) * (4.0 * s.roughness + 2.0));
        let direct = lamp.strength * n_light;
        diffuse += direct;
        shine += direct * gloss;
    }
    let mut out = base;
    for k in 0..3 {
        let specular = 0.04 + s.metallic * (base[k] - 0.04);
        let reflected = base[k] * (1.0 - s.metallic) * diffuse + specular * shine;
        out[k] = (base[k] * ambient + reflected).clamp(0.0, 1.0) * base[3];
    }
    out
}

/// 1 on the wire, 0 away from it.
fn wire_factor(surface: &SurfacePass<'_>, wire: &MaterialLook, id: usize, b: &Barycentrics) -> f32 {
    let mask = surface.edge_masks.get(id).copied().unwrap_or(0b111);
    let mut away = 1.0_f32;
    let (thickness, smoothing) = (wire.wire_thickness, wire.wire_smoothing);
    for i in 0..3 {
        // Coordinate i vanishes on the edge opposite corner i, which runs from corner i + 1 to i + 2.
        if mask >> ((i + 1) % 3) & 1 == 1 {
            let d = b.fwidth[i];
            away = away.min(smoothstep(thickness * d, (thickness + smoothing) * d, b.value[i]));
        }
    }
    1.0 - away
}

fn smoothstep(from: f32, to: f32, v: f32) -> f32 {
    if to <= from {
        return if v < from { 0.0 } else { 1.0 };
    }
    let t = ((v - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn over(cover: f32, top: [f32; 4], under: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|k| cover * top[k] + under[k] * (1.0 - cover * top[3]))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}

impl Stages<'_> {
    /// Unit-box corners of a triangle of the surface or the hull, and their vertex indices.
    pub(super) fn positions_of(&self, id: u32) -> [([f32; 3], u32); 3] {
        let (triangle, is_hull) = self.triangle(id);
        triangle.map(|v| {
            let position = self.plan.positions[v as usize];
            match &self.plan.hull {
                Some(hull) if is_hull => (hull_position(hull, position, v as usize), v),
                _ => (position, v),
            }
        })
    }
}
