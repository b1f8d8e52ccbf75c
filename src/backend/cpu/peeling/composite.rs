//! Stage 3b, a sample: the layers over its surface, nearest first, and the surface under them. Twin of `shaders/peeling/composite.wgsl`.
//!
//! Depth peeling (Everitt 2001, "Interactive order-independent transparency"), for each sample by itself: a round finds the
//! greatest word (depth, lowest id) below the last round's, all words above the visibility buffer's.

use crate::backend::cpu::Stages;
use crate::backend::cpu::bands::bins::TriangleBin;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand, for_samples};
use crate::backend::cpu::isa::dispatch;
use crate::backend::cpu::peeling::emit_layer::peel;
use crate::backend::cpu::peeling::state::LayerBand;
use crate::backend::cpu::surface::point::Show;
use crate::backend::cpu::surface::shade::Shader;
use crate::plan::{PeelingPass, pass_mask};

/// Shades the band: its layers, and the surface under them.
pub fn draw(
    stages: &Stages<'_>,
    pass: &PeelingPass,
    bins: (&[TriangleBin], usize),
    base: &SampleBand,
    layers: &mut LayerBand,
    colors: &mut [[f32; 4]],
) {
    layers.begin(base);
    let floor = (!pass.behind_surface).then_some(base);
    for layer in 0..pass.count_max {
        layers.begin_round(floor);
        peel(stages.isa, stages, bins, layers);
        let show = Show { fill: !pass.wires_only, wires: if layer == 0 { 1.0 } else { pass.fade } };
        let mut is_open = false;
        lay(stages.isa, stages, show, floor, layers, &mut is_open);
        if !is_open || stages.deadline.check().is_err() {
            break;
        }
    }
    under(stages.isa, stages, base, layers, colors);
}

/// Leaves layer number `layer` in `found`, unshaded: id [`NOTHING`] where a sample has none.
pub fn find(
    stages: &Stages<'_>,
    pass: &PeelingPass,
    bins: (&[TriangleBin], usize),
    base: &SampleBand,
    layers: &mut LayerBand,
    layer: u32,
) -> Vec<u64> {
    layers.begin(base);
    let floor = (!pass.behind_surface).then_some(base);
    let mut words = vec![0; layers.found.depth.len()];
    for _ in 0..=layer {
        layers.begin_round(floor);
        peel(stages.isa, stages, bins, layers);
        let (rows, stride) = (layers.found.rows as usize, layers.found.stride);
        for (at, word) in words.iter_mut().take(rows * stride).enumerate() {
            let y = layers.found.first_row + (at / stride) as i32;
            let in_base = base.index(0, y, 0) + at % stride;
            *word = if layers.take(floor, at, in_base).is_some() { layers.found.word(at) } else { 0 };
        }
    }
    words
}

dispatch! {
    /// Shades the layer that was found and lays it under those before it; says whether there may be another.
    pub fn lay(
        stages: &Stages<'_>,
        show: Show,
        floor: Option<&SampleBand>,
        layers: &mut LayerBand,
        is_open: &mut bool,
    ) = lay_kernel
}

dispatch! {
    /// Shades the surface, lays it under the layers, and averages each pixel's samples.
    pub fn under(stages: &Stages<'_>, base: &SampleBand, layers: &LayerBand, colors: &mut [[f32; 4]]) = under_kernel
}

#[inline(always)]
fn lay_kernel(stages: &Stages<'_>, show: Show, floor: Option<&SampleBand>, layers: &mut LayerBand, is_open: &mut bool) {
    for_samples!(layers.found.samples, lay_sampled(stages, show, floor, layers, is_open));
}

#[inline(always)]
fn lay_sampled<const S: usize>(
    stages: &Stages<'_>,
    show: Show,
    floor: Option<&SampleBand>,
    layers: &mut LayerBand,
    is_open: &mut bool,
) {
    let hull = stages.plan.hull.as_ref().filter(|_| stages.plan.has_peeled_hull());
    let triangles = stages.plan.triangles.len() as u32;
    let mut shader = Shader::new(stages);
    for y in layers.found.shown[0]..layers.found.shown[1] {
        for x in 0..layers.found.size_px[0] {
            let first = layers.found.index(x as i32, y as i32, 0);
            let in_base = floor.map_or(0, |base| base.index(x as i32, y as i32, 0));
            let mut ids = [NOTHING; S];
            let mut any = false;
            for s in 0..S {
                let at = first + s;
                let Some(id) = layers.take(floor, at, in_base + s) else { continue };
                any = true;
                let Some(hull) = hull else {
                    ids[s] = id;
                    continue;
                };
                let bit = 1 << (hull.material(id as usize) % 32);
                if id < triangles || layers.materials[at] & bit == 0 {
                    ids[s] = id;
                }
                layers.materials[at] |= bit;
            }
            if !any {
                continue;
            }
            shader.groups(ids, [x, y], |_| show, |same, color| layers.lay(first, same, color));
            for s in 0..S {
                *is_open |= layers.previous.depth[first + s] > 0.0;
            }
        }
    }
}

#[inline(always)]
fn under_kernel(stages: &Stages<'_>, base: &SampleBand, layers: &LayerBand, colors: &mut [[f32; 4]]) {
    for_samples!(base.samples, under_sampled(stages, base, layers, colors));
}

#[inline(always)]
fn under_sampled<const S: usize>(stages: &Stages<'_>, base: &SampleBand, layers: &LayerBand, colors: &mut [[f32; 4]]) {
    let plan = stages.plan;
    let wires_only = plan.peeling().is_some_and(|pass| pass.wires_only);
    let show = |id: u32| match wires_only && plan.pass_mask(id as usize) & pass_mask::LAYER != 0 {
        true => Show { fill: true, wires: 0.0 },
        false => Show::ALL,
    };
    let mut shader = Shader::new(stages);
    let share = 1.0 / S as f32;
    let mut colors = colors.iter_mut();
    for y in base.shown[0]..base.shown[1] {
        for x in 0..base.size_px[0] {
            let Some(out) = colors.next() else { return };
            let [in_base, first] = [base, &layers.found].map(|band| band.index(x as i32, y as i32, 0));
            let mut ids = [NOTHING; S];
            for s in 0..S {
                ids[s] = base.ids[in_base + s];
                let over = layers.colors[first + s];
                for k in 0..4 {
                    out[k] += share * over[k];
                }
            }
            shader.groups(ids, [x, y], show, |same, color| {
                let rest = |s: usize| if same[s] { 1.0 - layers.colors[first + s][3] } else { 0.0 };
                let weight = share * (0..S).map(rest).sum::<f32>();
                for k in 0..4 {
                    out[k] += weight * color[k];
                }
            });
        }
    }
}
