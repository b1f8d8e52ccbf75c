//! The compositing of the transparent layers of each sample, front to back, and then of the surface
//! under them (stage peeling). Twin of `shaders/peeling/composite.wgsl`.
//!
//! Layers are found by depth peeling (Everitt 2001, "Interactive order-independent transparency"),
//! for each sample by itself. [`draw`] runs the rounds. Each round finds the nearest triangle
//! behind the last round's; of equal depths, the lower triangle id counts as nearer. All layers are
//! in front of the opaque surface in the visibility buffer, unless wires show through the surface.

use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand, for_samples};
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::backend::cpu::peeling::emit_layer::peel_layer;
use crate::backend::cpu::peeling::state::PeelBand;
use crate::backend::cpu::surface::point::Show;
use crate::backend::cpu::surface::shade::Shader;
use crate::backend::cpu::surface::together::shade_band;
use crate::plan::{PeelingPass, pass_mask};

/// Shades a band: the peeled layers, and the surface under them.
pub fn draw(
    context: &RasterContext<'_>,
    pass: &PeelingPass,
    bins: (&[TriangleBin], usize),
    base: &SampleBand,
    peel: &mut PeelBand,
    colors: &mut [[f32; 4]],
) {
    peel.reset(base);
    peel.tints.begin(context.plan);
    let floor = (!pass.behind_surface).then_some(base);
    for layer in 0..pass.count_max {
        peel.begin_round(floor);
        peel.tints.begin_round(colors.len());
        peel_layer(context.isa, context, bins, peel);
        let show = Show { fill: !pass.wires_only, wires: if layer == 0 { 1.0 } else { pass.fade } };
        let mut is_open = false;
        shade_layer(context.isa, context, show, floor, peel, &mut is_open);
        if !is_open || context.deadline.check().is_err() {
            break;
        }
    }
    // A surface that shows its wires in layers alone differs from one without layers.
    let is_shaded = !pass.wires_only && !context.is_plain();
    if is_shaded {
        shade_band(context.isa, context, base, colors);
    }
    shade_surface(context.isa, context, base, peel, is_shaded, colors);
}

/// The visibility words of layer number `layer`, unshaded: 0 where a sample has none.
pub fn find_layer(
    context: &RasterContext<'_>,
    pass: &PeelingPass,
    bins: (&[TriangleBin], usize),
    base: &SampleBand,
    peel: &mut PeelBand,
    layer: u32,
) -> Vec<u64> {
    peel.reset(base);
    let floor = (!pass.behind_surface).then_some(base);
    let mut words = vec![0; peel.found.depth.len()];
    for _ in 0..=layer {
        peel.begin_round(floor);
        peel_layer(context.isa, context, bins, peel);
        let (rows, stride) = (peel.found.rows as usize, peel.found.stride);
        for (at, word) in words.iter_mut().take(rows * stride).enumerate() {
            let y = peel.found.first_row + (at / stride) as i32;
            let in_base = base.index(0, y, 0) + at % stride;
            *word = if peel.take_layer(floor, at, in_base).is_some() { peel.found.word(at) } else { 0 };
        }
    }
    words
}

dispatch! {
    /// Shades the layer that was found and composites it under those in front; sets `is_open` if
    /// there may be another.
    pub fn shade_layer(
        context: &RasterContext<'_>,
        show: Show,
        floor: Option<&SampleBand>,
        peel: &mut PeelBand,
        is_open: &mut bool,
    ) = shade_layer_kernel
}

dispatch! {
    /// Shades the surface, composites it under the layers, and averages each pixel's samples. If `is_shaded`, pixels have
    /// the colours of the surface alone already: those without layers keep them.
    pub fn shade_surface(
        context: &RasterContext<'_>,
        base: &SampleBand,
        peel: &PeelBand,
        is_shaded: bool,
        colors: &mut [[f32; 4]],
    ) = shade_surface_kernel
}

#[inline(always)]
fn shade_layer_kernel(
    context: &RasterContext<'_>,
    show: Show,
    floor: Option<&SampleBand>,
    peel: &mut PeelBand,
    is_open: &mut bool,
) {
    for_samples!(peel.found.samples, shade_layer_sampled(context, show, floor, peel, is_open));
}

#[inline(always)]
fn shade_layer_sampled<const S: usize>(
    context: &RasterContext<'_>,
    show: Show,
    floor: Option<&SampleBand>,
    peel: &mut PeelBand,
    is_open: &mut bool,
) {
    let mut shader = Shader::new(context);
    let width = peel.found.size_px[0];
    for y in peel.found.shown[0]..peel.found.shown[1] {
        for left in (0..width).step_by(LANES) {
            let right = width.min(left + LANES as u32);
            let first = peel.found.index(left as i32, y as i32, 0);
            let in_base = match floor {
                Some(base) => base.index(left as i32, y as i32, 0),
                None => 0,
            };
            // Most pixels have no layer, or no more.
            if peel.are_finished(floor, first, in_base, (right - left) as usize * S) {
                continue;
            }
            for i in 0..(right - left) as usize {
                let Some(ids) = take_layer::<S>(context, floor, peel, [first + i * S, in_base + i * S]) else {
                    continue;
                };
                let first = first + i * S;
                let pixel = (y - peel.found.shown[0]) as usize * width as usize + left as usize + i;
                let each = |same: [bool; S], color| add_group(context, peel, pixel, (first, ids, same), color);
                shader.groups((ids, None), [left + i as u32, y], |_| show, each);
                for s in 0..S {
                    *is_open |= peel.previous.depth[first + s] > 0.0;
                }
            }
        }
    }
}

/// Adds a triangle of a layer to a pixel whose first sample is given, with the layer's triangles and the samples that
/// show this one.
#[inline(always)]
fn add_group<const S: usize>(
    context: &RasterContext<'_>,
    peel: &mut PeelBand,
    pixel: usize,
    (first, ids, same): (usize, [u32; S], [bool; S]),
    color: [f32; 4],
) {
    let s = same.iter().position(|&is| is).unwrap_or(0);
    let (id, depth) = (ids[s], peel.previous.depth[first + s]);
    let seen = peel.accumulate(first, same, color);
    if peel.tints.are_kept() && id != NOTHING {
        peel.tints.add(context, pixel, (id, depth), color.map(|v| v * (seen * (1.0 / S as f32))));
    }
}

/// Takes the layer found in the pixel at these indices, among the layer's samples and the base's. Returns the triangles
/// that it shows, or None if all samples are finished.
#[inline(always)]
fn take_layer<const S: usize>(
    context: &RasterContext<'_>,
    floor: Option<&SampleBand>,
    peel: &mut PeelBand,
    [first, in_base]: [usize; 2],
) -> Option<[u32; S]> {
    let hull = context.plan.hull.as_ref().filter(|_| context.plan.has_peeled_hull());
    let triangles = context.plan.triangles.len() as u32;
    let mut ids = [NOTHING; S];
    let mut any = false;
    for s in 0..S {
        let at = first + s;
        let Some(id) = peel.take_layer(floor, at, in_base + s) else { continue };
        any = true;
        let Some(hull) = hull else {
            ids[s] = id;
            continue;
        };
        let bit = 1 << (hull.material(id as usize) % 32);
        if id < triangles || peel.materials[at] & bit == 0 {
            ids[s] = id;
        }
        peel.materials[at] |= bit;
    }
    any.then_some(ids)
}

#[inline(always)]
fn shade_surface_kernel(
    context: &RasterContext<'_>,
    base: &SampleBand,
    peel: &PeelBand,
    is_shaded: bool,
    colors: &mut [[f32; 4]],
) {
    for_samples!(base.samples, shade_surface_sampled(context, base, peel, is_shaded, colors));
}

#[inline(always)]
fn shade_surface_sampled<const S: usize>(
    context: &RasterContext<'_>,
    base: &SampleBand,
    peel: &PeelBand,
    is_shaded: bool,
    colors: &mut [[f32; 4]],
) {
    let plan = context.plan;
    let wires_only = plan.peeling().is_some_and(|pass| pass.wires_only);
    let show = |id: u32| match wires_only && plan.pass_mask(id as usize) & pass_mask::LAYER != 0 {
        true => Show { fill: true, wires: 0.0 },
        false => Show::ALL,
    };
    let mut shader = Shader::new(context);
    let share = 1.0 / S as f32;
    let mut colors = colors.iter_mut();
    for y in base.shown[0]..base.shown[1] {
        for x in 0..base.size_px[0] {
            let Some(out) = colors.next() else { return };
            if is_shaded {
                if peel.is_clear(x, y) {
                    continue;
                }
                *out = [0.0; 4];
            }
            let [in_base, first] = [base, &peel.found].map(|band| band.index(x as i32, y as i32, 0));
            let mut ids = [NOTHING; S];
            for s in 0..S {
                ids[s] = base.ids[in_base + s];
                let over = peel.colors[first + s];
                for k in 0..4 {
                    out[k] += share * over[k];
                }
            }
            let depths = base.depth.get(in_base..in_base + S);
            shader.groups((ids, depths), [x, y], show, |same, color| {
                let rest = |s: usize| if same[s] { 1.0 - peel.colors[first + s][3] } else { 0.0 };
                let weight = share * (0..S).map(rest).sum::<f32>();
                for k in 0..4 {
                    out[k] += weight * color[k];
                }
            });
        }
    }
}
