//! Texture lookups at shaded points, filtered over the part of the texture that a pixel covers unless the texture
//! asks for the nearest texel (stage shade). They are computed for `N` points side by side. Twin of
//! `shaders/surface/texture.wgsl`.
//!
//! Both back-ends compute the same bits. A different last bit could be plain to see: it may decide whether a
//! cut-out texture leaves a point of a face visible, or which of two texels is the nearest.

#[cfg(target_arch = "x86_64")]
mod avx2;

use super::barycentric::Barycentrics;
use crate::backend::cpu::geometry::transform::{quick_recip, quick_rsqrt};
use crate::backend::cpu::isa::Isa;
use crate::plan::{CornerValues, SurfacePass, Texture, TextureUse, Textures, samplers};

/// Largest coordinate: beyond it f32 has too few fractional bits.
pub const UV_MAX: f32 = 1_048_576.0;

/// Texture coordinates at `N` points, and how they change a pixel to the right and a pixel down:
/// `[component][lane]`.
#[derive(Clone, Copy)]
pub struct Uv<const N: usize> {
    /// At the points.
    pub at: [[f32; N]; 2],
    d: [[[f32; N]; 2]; 2],
}

impl<const N: usize> Uv<N> {
    /// The coordinates of triangles with these corners at these barycentrics.
    #[inline(always)]
    pub fn new(corners: &[[[f32; N]; 2]; 3], b: &Barycentrics<N>) -> Self {
        let [right, down] = b.derivatives();
        Self { at: blend(corners, &b.value), d: [blend(corners, &right), blend(corners, &down)] }
    }

    /// The same for points that stand for a part of a pixel, with this share of its width.
    #[inline(always)]
    pub fn narrowed(self, share: f32) -> Self {
        Self { d: self.d.map(|step| step.map(|lanes| lanes.map(|v| share * v))), ..self }
    }
}

/// Values at the corners of triangles: `[corner][component][lane]`.
#[inline(always)]
pub fn of_corners<const K: usize, const N: usize>(
    values: &CornerValues<'_, [f32; K]>,
    ids: &[u32; N],
) -> [[[f32; N]; K]; 3] {
    listed_at_corners(&values.values, &values.triangles, ids)
}

/// The texture coordinates at the corners of triangles that a use of a texture wants.
#[inline(always)]
pub fn uv_corners<const N: usize>(
    surface: &SurfacePass<'_>,
    uvs: &CornerValues<'_, [f32; 2]>,
    used: &TextureUse,
    ids: &[u32; N],
) -> [[[f32; N]; 2]; 3] {
    match &surface.second_uvs[..] {
        second if used.sampler & samplers::SECOND_UVS != 0 => listed_at_corners(second, &uvs.triangles, ids),
        _ => of_corners(uvs, ids),
    }
}

#[inline(always)]
fn listed_at_corners<const K: usize, const N: usize>(
    values: &[[f32; K]],
    triangles: &[[u32; 3]],
    ids: &[u32; N],
) -> [[[f32; N]; K]; 3] {
    let mut corners = [[[0.0; N]; K]; 3];
    for l in 0..N {
        let indices = triangles[ids[l] as usize];
        for (corner, i) in corners.iter_mut().zip(indices) {
            let value = values[i as usize];
            for k in 0..K {
                corner[k][l] = value[k];
            }
        }
    }
    corners
}

/// `w0 p0 + w1 p1 + w2 p2`, component by component and lane by lane.
#[inline(always)]
pub fn blend<const K: usize, const N: usize>([p, q, r]: &[[[f32; N]; K]; 3], w: &[[f32; N]; 3]) -> [[f32; N]; K] {
    let mut out = [[0.0; N]; K];
    for k in 0..K {
        for l in 0..N {
            out[k][l] = (w[0][l] * p[k][l] + w[1][l] * q[k][l]) + w[2][l] * r[k][l];
        }
    }
    out
}

/// Linear RGBA of a texture: one place, trilinear, or the mean of places along the pixel's footprint, each in one
/// level; white where there is no texture ([`TEXTURE_NONE`](crate::plan::TEXTURE_NONE)). Up to `taps_max` places are looked at.
#[inline(always)]
pub fn sample<const N: usize>(
    isa: Isa,
    textures: &Textures,
    used: &TextureUse,
    taps_max: u32,
    uv: &Uv<N>,
) -> [[f32; N]; 4] {
    let mut out = [[1.0; N]; 4];
    let Some(image) = textures.images.get(used.texture as usize) else {
        return out;
    };
    let texels = &image.texels[..];
    let size = [image.width as f32, image.height as f32];
    let mut at = [[0.0; 2]; N];
    let mut footprints = [Footprint { taps: 1, lod: 0.0, axis: [0.0; 2], magnification: 1.0 }; N];
    for l in 0..N {
        let (mut right, mut down) = ([0.0; 2], [0.0; 2]);
        for k in 0..2 {
            let [a, b, c] = used.transform[k];
            at[l][k] = bounded((a * uv.at[0][l] + b * uv.at[1][l]) + c);
            right[k] = (a * uv.d[0][0][l] + b * uv.d[0][1][l]) * size[k];
            down[k] = (a * uv.d[1][0][l] + b * uv.d[1][1][l]) * size[k];
        }
        footprints[l] = Footprint::of(image, used.sampler, taps_max, right, down);
    }
    for l in 0..N {
        let texel = averaged(isa, texels, image, footprints[l], at[l], used.sampler);
        for k in 0..4 {
            out[k][l] = texel[k];
        }
    }
    out
}

/// The part of a texture that a pixel covers, as it is looked at.
#[derive(Clone, Copy)]
struct Footprint {
    /// Places that are looked at, side by side along the axis.
    taps: u32,
    /// Level of the footprint: its places lie in the two levels around it.
    lod: f32,
    /// The footprint's longer axis from end to end, in texture coordinates.
    axis: [f32; 2],
    /// Pixels per texel of the finest level, at least 1: for cut-out textures.
    magnification: f32,
}

impl Footprint {
    /// The footprint of a pixel whose step to the right, and down, is so many texels: the ellipse into which the
    /// two steps turn a circle. docs/rasterizer.md, "Textures", has the formulas.
    ///
    /// Selections instead of branches, so that a vector holds several.
    #[inline(always)]
    fn of(image: &Texture, sampler: u32, taps_max: u32, right: [f32; 2], down: [f32; 2]) -> Self {
        let square = |v: [f32; 2]| v[0] * v[0] + v[1] * v[1];
        let (across, along) = (square(right), square(down));
        let is_small = across + along < 2.25;
        // Infinite sums and NaN are not.
        let is_measured = across + along < 1e12;
        let is_one = (sampler & (samplers::NEAREST | samplers::TRILINEAR) != 0) | is_small | !is_measured;
        let [a, c] = [0, 1].map(|k| right[k] * right[k] + down[k] * down[k]);
        let b = right[0] * right[1] + down[0] * down[1];
        let half = 0.5 * (a - c);
        let root_square = half * half + b * b;
        let root = root_square * quick_rsqrt(root_square.max(1e-30));
        let long_square = 0.5 * (a + c) + root;
        let inverse = quick_rsqrt(long_square);
        let long = long_square * inverse;
        let short = ((right[0] * down[1] - right[1] * down[0]).abs() * inverse).max(1.0);
        let taps = (long * quick_recip(short) + 0.5).min(taps_max as f32) as u32;
        let is_one = is_one | (taps < 2);
        let step = long * quick_recip(taps as f32);
        let direction = if half >= 0.0 { [half + root, b] } else { [b, root - half] };
        let scale = long * quick_rsqrt(square(direction).max(1e-30));
        let axis = [
            (direction[0] * scale) * quick_recip(image.width as f32),
            (direction[1] * scale) * quick_recip(image.height as f32),
        ];
        let size_square = if is_one { across.max(along) } else { (step * step).max(short * short) };
        let lod = half_log2(size_square).min(image.levels as f32 - 1.0).max(image.first_level as f32);
        // Over all directions of a border, the mean square of a pixel's extent across it is half of both squares.
        let finest = (1_u32 << image.first_level.min(31)) as f32;
        let magnification = if (sampler & samplers::CUT_OUT != 0) & is_measured {
            finest * quick_rsqrt((0.5 * (across + along)).max(1e-30))
        } else {
            1.0
        };
        Self { taps: if is_one { 1 } else { taps }, lod, axis, magnification: magnification.max(1.0) }
    }
}

/// A level of an image.
#[derive(Clone, Copy)]
struct Level {
    /// Its first texel.
    first: u32,
    /// Columns and rows.
    size: [i32; 2],
}

impl Level {
    #[inline(always)]
    fn of(image: &Texture, level: u32) -> Self {
        let size = |level: u32| [image.width, image.height].map(|side| (side >> level).max(1));
        let level = level.min(image.levels.max(1) - 1);
        let before = |level: u32| size(level)[0] * size(level)[1];
        let first = (image.first_level..level).map(before).sum::<u32>();
        Self { first, size: size(level).map(|side| side as i32) }
    }

    /// The level that follows, or this one if it is the last.
    #[inline(always)]
    fn next(self) -> Self {
        if self.size == [1, 1] {
            return self;
        }
        let first = self.first + (self.size[0] * self.size[1]) as u32;
        Self { first, size: self.size.map(|side| (side >> 1).max(1)) }
    }
}

#[inline(always)]
#[allow(unsafe_code)]
fn averaged(
    isa: Isa,
    texels: &[[u16; 4]],
    image: &Texture,
    footprint: Footprint,
    at: [f32; 2],
    sampler: u32,
) -> [f32; 4] {
    let Footprint { taps, lod, axis, magnification } = footprint;
    let is_cut_out = sampler & samplers::CUT_OUT != 0;
    if sampler & samplers::NEAREST != 0 {
        let level = (lod + 0.5) as u32;
        let color = nearest(texels, Level::of(image, level), at, sampler);
        if !is_cut_out {
            return color;
        }
        let [r, g, b, distance] = color;
        // Texels of the finest level are drawn whole or not at all.
        let is_whole = level <= image.first_level;
        return if is_whole { [r, g, b, f32::from(distance >= 0.0)] } else { cut_out(color, 1.0) };
    }
    let share_of_next = lod - (lod as u32) as f32;
    let level = Level::of(image, lod as u32);
    let next = (share_of_next > 0.0).then(|| level.next());
    if taps < 2 {
        let color = trilinear(isa, texels, (level, next.map(|next| (next, share_of_next))), at, sampler);
        return if is_cut_out { cut_out(color, magnification) } else { color };
    }
    let places = Places { at, axis, taps, levels: [level, next.unwrap_or(level)], share_of_next };
    #[cfg(target_arch = "x86_64")]
    if isa.has_avx2() && !is_cut_out {
        // SAFETY: the processor has AVX2 and F16C, as `isa` says.
        return unsafe { avx2::mean(texels, &places, sampler) };
    }
    mean_plainly(&places, |place, level| {
        let color = trilinear(isa, texels, (level, None), place, sampler);
        if is_cut_out { cut_out(color, magnification) } else { color }
    })
}

/// Two or more places of a footprint, side by side along its axis.
struct Places {
    /// In their middle.
    at: [f32; 2],
    axis: [f32; 2],
    taps: u32,
    /// Each place is looked at in one of the two.
    levels: [Level; 2],
    /// The share of places that are looked at in the second level.
    share_of_next: f32,
}

impl Places {
    /// The places, each with the number of its level. Those of the second level are spread over the axis.
    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = ([f32; 2], usize)> {
        let &Self { at, axis, taps, share_of_next, .. } = self;
        let share = quick_recip(taps as f32);
        let of_next = (taps as f32 * share_of_next) as u32;
        let mut part = taps / 2;
        (0..taps).map(move |tap| {
            let along = (tap as f32 + 0.5) * share - 0.5;
            part += of_next;
            let is_next = part >= taps;
            part -= if is_next { taps } else { 0 };
            ([at[0] + axis[0] * along, at[1] + axis[1] * along], usize::from(is_next))
        })
    }
}

/// The mean of the colours at places.
#[inline(always)]
fn mean_plainly(places: &Places, mut color_at: impl FnMut([f32; 2], Level) -> [f32; 4]) -> [f32; 4] {
    let mut sum = [0.0; 4];
    for (place, level) in places.iter() {
        let color = color_at(place, places.levels[level]);
        for k in 0..4 {
            sum[k] += color[k];
        }
    }
    sum.map(|v| v * quick_recip(places.taps as f32))
}

/// A colour of a cut-out texture: alpha is the share of the pixel that is drawn.
#[inline(always)]
fn cut_out([r, g, b, distance]: [f32; 4], magnification: f32) -> [f32; 4] {
    [r, g, b, (distance * magnification + 0.5).clamp(0.0, 1.0)]
}

/// A place in a level, mixed with the next by its share.
#[inline(always)]
#[allow(unsafe_code)]
fn trilinear(
    isa: Isa,
    texels: &[[u16; 4]],
    levels: (Level, Option<(Level, f32)>),
    at: [f32; 2],
    sampler: u32,
) -> [f32; 4] {
    #[cfg(target_arch = "x86_64")]
    if isa.has_avx2() {
        // SAFETY: the processor has AVX2 and F16C, as `isa` says.
        return unsafe { avx2::trilinear(texels, levels, at, sampler) };
    }
    let _ = isa;
    trilinear_plainly(texels, levels, at, sampler)
}

#[inline(always)]
fn trilinear_plainly(
    texels: &[[u16; 4]],
    (level, next): (Level, Option<(Level, f32)>),
    at: [f32; 2],
    sampler: u32,
) -> [f32; 4] {
    let color = bilinear(texels, level, at, sampler);
    match next {
        Some((next, share)) => mix(color, bilinear(texels, next, at, sampler), share),
        None => color,
    }
}

/// Clamps a coordinate to the range with fractional bits; NaN and infinity are 0.
#[inline(always)]
fn bounded(v: f32) -> f32 {
    if v.abs() <= 1e30 { v.clamp(-UV_MAX, UV_MAX) } else { 0.0 }
}

/// Half the binary logarithm, to 1e-4: exact at powers of two, a polynomial in between.
#[inline(always)]
fn half_log2(v: f32) -> f32 {
    let bits = if v < 1e30 { v.max(1e-30) } else { 1e30 }.to_bits();
    let t = f32::from_bits(bits & 0x007F_FFFF | 0x3F80_0000) - 1.0;
    let bend = 0.43807 + t * (t * 0.0803 - 0.23669);
    0.5 * (((bits >> 23) as i32 - 127) as f32 + (t + (t * (1.0 - t)) * bend))
}

#[inline(always)]
fn bilinear(texels: &[[u16; 4]], Level { first, size }: Level, at: [f32; 2], sampler: u32) -> [f32; 4] {
    let (mut low, mut high, mut share) = ([0; 2], [0; 2], [0.0; 2]);
    for k in 0..2 {
        let wrap = sampler >> (samplers::DOWN_SHIFT * k as u32) & samplers::WRAP_BITS;
        let s = wrapped(at[k], wrap) * size[k] as f32 - 0.5;
        let i = floor(s);
        share[k] = s - i as f32;
        low[k] = texel_index(i, size[k], wrap);
        high[k] = texel_index(i + 1, size[k], wrap);
    }
    let texel = |x: i32, y: i32| texel(texels, first + (y * size[0] + x) as u32);
    let upper = mix(texel(low[0], low[1]), texel(high[0], low[1]), share[0]);
    let lower = mix(texel(low[0], high[1]), texel(high[0], high[1]), share[0]);
    mix(upper, lower, share[1])
}

fn nearest(texels: &[[u16; 4]], Level { first, size }: Level, at: [f32; 2], sampler: u32) -> [f32; 4] {
    let [x, y] = [0, 1].map(|k| {
        let wrap = sampler >> (samplers::DOWN_SHIFT * k as u32) & samplers::WRAP_BITS;
        texel_index(floor(wrapped(at[k], wrap) * size[k] as f32), size[k], wrap)
    });
    texel(texels, first + (y * size[0] + x) as u32)
}

/// A coordinate in 0 to 1.
#[inline(always)]
fn wrapped(u: f32, wrap: u32) -> f32 {
    match wrap {
        samplers::REPEAT => u - floor(u) as f32,
        samplers::MIRROR => 1.0 - ((u - 2.0 * floor(0.5 * u) as f32) - 1.0).abs(),
        _ => u.clamp(0.0, 1.0),
    }
}

/// A texel that may lie one beyond the edge.
#[inline(always)]
fn texel_index(i: i32, size: i32, wrap: u32) -> i32 {
    if wrap == samplers::REPEAT {
        return if i < 0 {
            i + size
        } else if i >= size {
            i - size
        } else {
            i
        };
    }
    // The mirror's first texel beyond the edge is the last before it.
    i.min(size - 1).max(0)
}

#[inline(always)]
fn texel(texels: &[[u16; 4]], index: u32) -> [f32; 4] {
    texels.get(index as usize).map_or([1.0; 4], |texel| texel.map(half_to_f32))
}

/// Exact for finite halves: the bits moved into place, and the exponents' difference multiplied in.
#[inline(always)]
fn half_to_f32(half: u16) -> f32 {
    let size = f32::from_bits(u32::from(half & 0x7FFF) << 13) * f32::from_bits((112 + 127) << 23);
    f32::from_bits(size.to_bits() | u32::from(half & 0x8000) << 16)
}

#[inline(always)]
fn mix(a: [f32; 4], b: [f32; 4], share: f32) -> [f32; 4] {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * share)
}

/// For |v| < 2^31; the standard one is a call where the baseline's instructions have none.
#[inline(always)]
pub fn floor(v: f32) -> i32 {
    let i = v as i32;
    if i as f32 > v { i - 1 } else { i }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_exact() {
        for (half, want) in [(0, 0.0), (0x3C00, 1.0), (0x3555, 0.333_251_95), (0x7BFF, 65504.0), (1, 5.960_464_5e-8)] {
            assert_eq!(half_to_f32(half), want);
            assert_eq!(half_to_f32(half | 0x8000), -want);
        }
    }

    #[test]
    fn places_of_two_levels_take_turns() {
        let levels = [8, 4].map(|side| Level { first: 0, size: [side; 2] });
        for taps in 2..=8 {
            for sixteenths in 0..16 {
                let share_of_next = sixteenths as f32 / 16.0;
                let places = Places { at: [0.5; 2], axis: [1.0, 0.0], taps, levels, share_of_next };
                let of_next = taps * sixteenths / 16;
                let coarse: Vec<u32> = (0..).zip(places.iter()).filter(|(_, (_, i))| *i == 1).map(|(n, _)| n).collect();
                assert_eq!(coarse.len() as u32, of_next, "{taps} places, {share_of_next}");
                for pair in coarse.windows(2) {
                    let steps = pair[1] - pair[0];
                    assert!(steps == taps / of_next || steps == taps.div_ceil(of_next), "{taps} places: {coarse:?}");
                }
                let middle = places.iter().map(|([u, _], _)| u).sum::<f32>() / taps as f32;
                assert!((middle - 0.5).abs() < 1e-5 && places.iter().all(|([u, _], _)| u > 0.0 && u < 1.0));
            }
        }
    }

    #[test]
    #[allow(unsafe_code)]
    fn each_instruction_set_finds_the_same_colors() {
        let mut state = 7_u32;
        let mut random = || {
            // xorshift32
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state
        };
        // Finite halves; the second level lies behind the first, and a third one beyond the end.
        let texels: Vec<[u16; 4]> =
            (0..12 * 7 + 6 * 3).map(|_| [0; 4].map(|_: u16| random() as u16 & 0xFBFF)).collect();
        let levels = [(0, [12, 7]), (84, [6, 3]), (102, [3, 1])].map(|(first, size)| Level { first, size });
        let mut varied = 0;
        for case in 0..20_000 {
            let [u, v] =
                [0; 2].map(|_| (random() as i32 as f32 * 2.0_f32.powi(-30 + case % 22)).clamp(-UV_MAX, UV_MAX));
            let at = [[u, v], [0.0, -0.0], [1.0, v], [u, -1.0]][if case % 9 < 3 { case as usize % 9 + 1 } else { 0 }];
            let sampler = (random() % 3) | ((random() % 3) << samplers::DOWN_SHIFT);
            let share = random() as f32 * 2.0_f32.powi(-32);
            let first = random() as usize % 2;
            let pair = (levels[first], (case % 5 > 0).then(|| (levels[first + 1], share)));
            let want = trilinear_plainly(&texels, pair, at, sampler);
            // Beyond the last texel all is white.
            varied += usize::from(want[0] != want[1]);
            #[cfg(target_arch = "x86_64")]
            if Isa::detect().has_avx2() {
                let (axis, taps) = ([0.3 * v, share], 2 + case as u32 % 7);
                let places = Places { at, axis, taps, levels: [pair.0, levels[first + 1]], share_of_next: share };
                let want = mean_plainly(&places, |at, level| bilinear(&texels, level, at, sampler));
                // SAFETY: the processor has AVX2 and F16C, as was asked.
                let got = unsafe { avx2::mean(&texels, &places, sampler) };
                assert_eq!(got.map(f32::to_bits), want.map(f32::to_bits), "{at:?}, {axis:?}, {taps}, {sampler}");
            }
            for isa in Isa::available() {
                let got = trilinear(isa, &texels, pair, at, sampler);
                assert_eq!(got.map(f32::to_bits), want.map(f32::to_bits), "{isa:?}, {at:?}, {sampler}");
            }
        }
        assert!(varied > 15_000, "{varied}");
    }

    #[test]
    fn logarithms_are_close_and_without_steps() {
        let mut last = half_log2(1e-6);
        for i in 1..20_000 {
            let v = 1e-6 * libm::exp2f(i as f32 * 0.003);
            let log = half_log2(v);
            assert!((log - 0.5 * libm::log2f(v)).abs() < 2e-4, "{v}: {log}");
            assert!(log >= last && log - last < 0.003, "a step at {v}");
            last = log;
        }
        assert_eq!([half_log2(f32::NAN), half_log2(f32::INFINITY)], [half_log2(1e30); 2]);
    }

    #[test]
    fn coordinates_wrap_as_the_names_say() {
        for (u, repeat, mirror, clamp) in
            [(0.25, 0.25, 0.25, 0.25), (1.25, 0.25, 0.75, 1.0), (-0.25, 0.75, 0.25, 0.0), (-1.25, 0.75, 0.75, 0.0)]
        {
            assert_eq!([0, 1, 2].map(|wrap| wrapped(u, wrap)), [repeat, mirror, clamp], "{u}");
        }
        assert_eq!([0, 1, 2].map(|wrap| texel_index(-1, 4, wrap)), [3, 0, 0]);
        assert_eq!([0, 1, 2].map(|wrap| texel_index(4, 4, wrap)), [0, 3, 3]);
        assert_eq!([f32::NAN, f32::INFINITY, 1e30, -1e7].map(bounded), [0.0, 0.0, UV_MAX, -UV_MAX]);
    }
}
