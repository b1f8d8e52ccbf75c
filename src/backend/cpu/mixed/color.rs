//! Stage mixed, per pixel: its colour by what its points see. Each triangle is shaded once, at the mean of its points, and
//! weighs its share of them.

use super::pixels::{Seen, SomePixels};
use super::shares::{Share, Shares};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::transform::recip;
use crate::backend::cpu::isa::dispatch;
use crate::backend::cpu::surface::shade::Shader;
use crate::backend::cpu::surface::waiting::{Point, Waiting};
use crate::backend::sample_partition::POINTS;

dispatch! {
    /// Finds the colours of some mixed pixels.
    pub fn color(context: &RasterContext<'_>, some: &mut SomePixels<'_>) = color_kernel
}

#[inline(always)]
fn color_kernel(context: &RasterContext<'_>, some: &mut SomePixels<'_>) {
    let plan = context.plan;
    let surface =
        plan.surface.as_ref().filter(|surface| surface.is_shaded && !context.is_plain && context.flat.is_none());
    let waiting = surface.map(|surface| Waiting::new(context, surface));
    let mut painter = Painter { context, shader: Shader::new(context), waiting };
    let mut shares = Shares::new();
    let mut row = some.first_row();
    for i in 0..some.len() {
        let pixel = some.place(i, &mut row);
        let Seen { faces, crowd_of, crowds, .. } = some.seen();
        match crowds.get(usize::from(crowd_of[i]).wrapping_sub(1)) {
            Some(crowd) => crowd.shares(&mut shares),
            None => faces[i].shares(&mut shares),
        }
        let own_z = some.samples.depth[some.samples.index(pixel[0] as i32, pixel[1] as i32, 0)];
        painter.paint(&shares, (i, pixel, own_z), some.colors_mut());
    }
    if let Some(waiting) = &mut painter.waiting {
        waiting.shade(some.colors_mut());
    }
}

struct Painter<'a> {
    context: &'a RasterContext<'a>,
    shader: Shader<'a>,
    /// None where colours are known, or points are shaded one by one.
    waiting: Option<Waiting<'a>>,
}

impl Painter<'_> {
    /// Adds to the colour of pixel number `i`, whose first sample has the depth `own_z`, what it shows.
    #[inline(always)]
    fn paint(&mut self, shares: &Shares, (i, pixel, own_z): (usize, [u32; 2], f32), colors: &mut [[f32; 4]]) {
        let plan = self.context.plan;
        let size = [plan.width_px, plan.height_px];
        let mut is_of_surface = true;
        for share in shares.all() {
            is_of_surface &= !self.context.is_hull(share.id);
        }
        for Share { id, points, depth } in shares.all() {
            let count = points.count();
            let weight = count as f32 / POINTS as f32;
            if let Some(color) = self.context.flat.and_then(|flat| flat.known(*id)) {
                add(&mut colors[i], weight, color);
                continue;
            }
            let (place_sum, scale) = (points.place_sum(), recip((2 * count) as f32));
            let mut at = [0.0; 2];
            for k in 0..2 {
                at[k] = (pixel[k] as i32 * 256 - size[k] as i32 * 128) as f32 + place_sum[k] as f32 * scale;
            }
            match &mut self.waiting {
                Some(waiting) if is_of_surface => {
                    let open = self.shader.open_share(pixel, *depth, own_z);
                    waiting.push(Point { id: *id, at, weight, pixel: i as u32, open }, colors);
                }
                _ => add(&mut colors[i], weight, self.shader.at_point(*id, at, pixel, [*depth, own_z])),
            }
        }
    }
}

#[inline(always)]
fn add(to: &mut [f32; 4], weight: f32, color: [f32; 4]) {
    for k in 0..4 {
        to[k] += weight * color[k];
    }
}
