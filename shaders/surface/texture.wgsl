// Texture lookups (stage shade): the colour of a texture at a point of the surface, filtered over the part of the
// texture that a pixel covers, or that of the nearest texel. Twin of src/render/backend/cpu/surface/texture/mod.rs.
//
// The result has the same bits as on the CPU, because a small difference can show: alpha decides whether an alpha
// mask leaves a point out, and without filtering a point on the border of two texels gets the colour of one of
// them.
//
// Uses: common.wgsl (quick_recip, quick_rsqrt, rn, rn2, rn4), one_job.wgsl or gang.wgsl (frame),
// surface/barycentric.wgsl (Barycentrics, blend2), surface/material.wgsl (is_quartered, materials,
// SLOT_BASE, SLOT_EMISSIVE), surface/point.wgsl (corner_triangles).

@group(1) @binding(18) var<storage, read> uvs: array<vec2<f32>>;
// Four items an image, as `TextureEntry` in src/render/backend/gpu/params.rs has them; then texels, two halves a word.
@group(1) @binding(20) var<storage, read> texels: array<vec2<u32>>;

// Items of the texels' buffer per image, in front of the texels.
const IMAGE_VECTORS: u32 = 4u;

// Bits of a texture use's sampler: a wrap mode across, one down, whether the nearest texel is taken,
// whether the second set of texture coordinates says where, and whether parts are cut out.
const WRAP_BITS: u32 = 3u;
const WRAP_DOWN_SHIFT: u32 = 2u;
const WRAP_REPEAT: u32 = 0u;
const WRAP_MIRROR: u32 = 1u;
const SAMPLER_NEAREST: u32 = 16u;
const SAMPLER_SECOND_UVS: u32 = 32u;
// In place of alpha, texels say how much of a pixel is drawn.
const SAMPLER_CUT_OUT: u32 = 64u;
// One place of each pixel alone, in the level of its footprint's longer side.
const SAMPLER_TRILINEAR: u32 = 128u;

// Largest coordinate: beyond it f32 has too few fractional bits.
const UV_MAX: f32 = 1048576.0;

// Places along the longer axis of a pixel's footprint that are looked at, at most, where the colours of
// a texture are seen; others only change the light.
const TAPS_MAX: u32 = 8u;

// Texture coordinates at a point, and how they change a pixel to the right and a pixel down.
struct Uv {
    at: vec2<f32>,
    dx: vec2<f32>,
    dy: vec2<f32>,
};

// Texture coordinates of a set that starts at set_at.
fn uv_of(id: u32, b: Barycentrics, set_at: u32) -> Uv {
    let first = frame.uv_triangles_at + 3u * id;
    let p = uvs[set_at + corner_triangles[first]];
    let q = uvs[set_at + corner_triangles[first + 1u]];
    let r = uvs[set_at + corner_triangles[first + 2u]];
    // Width of what a point stands for: of a pixel, or of a quarter of one.
    let share = select(1.0, 0.5, is_quartered(id));
    return Uv(blend2(b.value, p, q, r), share * blend2(b.dx, p, q, r), share * blend2(b.dy, p, q, r));
}

// A material's use of a texture.
struct Use {
    // Rows of the transform.
    u: vec3<f32>,
    v: vec3<f32>,
    texture: u32,
    sampler: u32,
};

fn use_of(m: u32, slot: u32) -> Use {
    let head = materials[m].textures[2u * slot];
    let tail = materials[m].textures[2u * slot + 1u];
    let u = bitcast<vec3<f32>>(head.xyz);
    return Use(u, vec3(bitcast<f32>(head.w), bitcast<vec2<f32>>(tail.xy)), tail.z, tail.w);
}

// Start of the set of texture coordinates that a use wants.
fn set_at(used: Use) -> u32 {
    return select(0u, frame.second_uvs_at, (used.sampler & SAMPLER_SECOND_UVS) != 0u);
}

// A difference of coordinates, as the texture sees it.
fn transformed(used: Use, d: vec2<f32>) -> vec2<f32> {
    return vec2(rn(used.u.x * d.x) + rn(used.u.y * d.y), rn(used.v.x * d.x) + rn(used.v.y * d.y));
}

struct Image {
    size: vec2<u32>,
    first_level: u32,
    levels: u32,
    first_texel: u32,
};

// Linear RGBA of a texture: one place, trilinear, or the mean of places along the pixel's footprint, each in one
// level; white where there is no texture. `first_uv` is of the first set of texture coordinates.
fn sample_texture(m: u32, slot: u32, id: u32, b: Barycentrics, first_uv: Uv) -> vec4<f32> {
    let used = use_of(m, slot);
    if used.texture >= frame.image_count {
        return vec4(1.0);
    }
    var uv = first_uv;
    if (used.sampler & SAMPLER_SECOND_UVS) != 0u {
        uv = uv_of(id, b, frame.second_uvs_at);
    }
    let words = texels[IMAGE_VECTORS * used.texture + 1u];
    let first = texels[IMAGE_VECTORS * used.texture + 2u].x + IMAGE_VECTORS * frame.image_count;
    let image = Image(texels[IMAGE_VECTORS * used.texture], words.x, words.y, first);
    let at = bounded(transformed(used, uv.at) + vec2(used.u.z, used.v.z), UV_MAX);
    let size = vec2<f32>(image.size);
    let x = rn2(transformed(used, uv.dx) * size);
    let y = rn2(transformed(used, uv.dy) * size);
    let taps_max = select(1u, TAPS_MAX, slot == SLOT_BASE || slot == SLOT_EMISSIVE);
    let footprint = footprint_of(image, used.sampler, taps_max, x, y);
    if footprint.taps < 2u {
        return place_color(image, footprint, at, used.sampler);
    }
    return mean_of_places(image, footprint, at, used.sampler);
}

// The mean of the colours at two or more places, each in one level. Those of the second level are spread
// over the axis.
fn mean_of_places(image: Image, footprint: Footprint, at: vec2<f32>, sampler: u32) -> vec4<f32> {
    let taps = footprint.taps;
    let share = quick_recip(f32(taps));
    let level = u32(footprint.lod);
    let of_next = u32(rn(f32(taps) * (footprint.lod - f32(level))));
    var sum = vec4(0.0);
    var part = taps / 2u;
    for (var tap = 0u; tap < taps; tap++) {
        let along = rn((f32(tap) + 0.5) * share) - 0.5;
        part += of_next;
        let is_next = part >= taps;
        part -= select(0u, taps, is_next);
        let color = bilinear(image, level + u32(is_next), at + rn2(footprint.axis * along), sampler);
        sum += cut_out(color, footprint.magnification, sampler);
    }
    return rn4(sum * share);
}

// The part of a texture that a pixel covers, as it is looked at.
struct Footprint {
    // Places that are looked at, side by side along the axis.
    taps: u32,
    // Level of the footprint: its places lie in the two levels around it.
    lod: f32,
    // The footprint's longer axis from end to end, in texture coordinates; 0 for one place.
    axis: vec2<f32>,
    // Pixels per texel of the finest level, at least 1: for cut-out textures.
    magnification: f32,
};

// The footprint of a pixel whose step to the right, and down, is so many texels: the ellipse into which
// the two steps turn a circle.
fn footprint_of(image: Image, sampler: u32, taps_max: u32, right: vec2<f32>, down: vec2<f32>) -> Footprint {
    let across = square_of(right);
    let along = square_of(down);
    let is_measured = across + along < 1e12;
    var magnification = 1.0;
    if (sampler & SAMPLER_CUT_OUT) != 0u && is_measured {
        // Over all directions of a border, the mean square of a pixel's extent across it is half of both squares.
        let finest = f32(1u << min(image.first_level, 31u));
        magnification = max(rn(finest * quick_rsqrt(max(rn(0.5 * (across + along)), 1e-30))), 1.0);
    }
    let one = Footprint(1u, lod_of(image, max(across, along)), vec2(0.0), magnification);
    let is_small = across + along < 2.25;
    if (sampler & (SAMPLER_NEAREST | SAMPLER_TRILINEAR)) != 0u || is_small || !is_measured {
        return one;
    }
    let diagonal = rn2(right * right) + rn2(down * down);
    let b = rn(right.x * right.y) + rn(down.x * down.y);
    let half = rn(0.5 * (diagonal.x - diagonal.y));
    let root_square = rn(half * half) + rn(b * b);
    let root = rn(root_square * quick_rsqrt(max(root_square, 1e-30)));
    let long_square = rn(0.5 * (diagonal.x + diagonal.y)) + root;
    let inverse = quick_rsqrt(long_square);
    let long = rn(long_square * inverse);
    let short = max(rn(abs(rn(right.x * down.y) - rn(right.y * down.x)) * inverse), 1.0);
    let taps = min(u32(rn(long * quick_recip(short)) + 0.5), taps_max);
    if taps < 2u {
        return one;
    }
    let step = rn(long * quick_recip(f32(taps)));
    var direction = vec2(b, root - half);
    if half >= 0.0 {
        direction = vec2(half + root, b);
    }
    let scale = rn(long * quick_rsqrt(max(square_of(direction), 1e-30)));
    let size = vec2<f32>(image.size);
    let axis = rn2(rn2(direction * scale) * vec2(quick_recip(size.x), quick_recip(size.y)));
    return Footprint(taps, lod_of(image, max(rn(step * step), rn(short * short))), axis, magnification);
}

fn square_of(v: vec2<f32>) -> f32 {
    return rn(v.x * v.x) + rn(v.y * v.y);
}

// The level at which texels are as large as so many of the first, squared.
fn lod_of(image: Image, size_square: f32) -> f32 {
    return max(min(half_log2(size_square), f32(image.levels) - 1.0), f32(image.first_level));
}

// The only place of a footprint.
fn place_color(image: Image, footprint: Footprint, at: vec2<f32>, sampler: u32) -> vec4<f32> {
    let color = filtered(image, footprint.lod, at, sampler);
    if (sampler & SAMPLER_NEAREST) == 0u {
        return cut_out(color, footprint.magnification, sampler);
    }
    // Texels of the finest level are drawn whole or not at all.
    if (sampler & SAMPLER_CUT_OUT) != 0u && u32(footprint.lod + 0.5) <= image.first_level {
        return vec4(color.xyz, select(0.0, 1.0, color.w >= 0.0));
    }
    return cut_out(color, 1.0, sampler);
}

// A colour; of a cut-out texture alpha becomes the share of the pixel that is drawn.
fn cut_out(color: vec4<f32>, magnification: f32, sampler: u32) -> vec4<f32> {
    let drawn = clamp(rn(color.w * magnification) + 0.5, 0.0, 1.0);
    return vec4(color.xyz, select(color.w, drawn, (sampler & SAMPLER_CUT_OUT) != 0u));
}

fn filtered(image: Image, lod: f32, at: vec2<f32>, sampler: u32) -> vec4<f32> {
    if (sampler & SAMPLER_NEAREST) != 0u {
        return nearest(image, u32(lod + 0.5), at, sampler);
    }
    let level = u32(lod);
    let share = lod - f32(level);
    let fine = bilinear(image, level, at, sampler);
    if share > 0.0 {
        return between(fine, bilinear(image, level + 1u, at, sampler), share);
    }
    return fine;
}

// Clamps a coordinate to the range with fractional bits; NaN and infinity are 0.
fn bounded(v: vec2<f32>, most: f32) -> vec2<f32> {
    return clamp(select(vec2(0.0), v, abs(v) <= vec2(1e30)), vec2(-most), vec2(most));
}

// Half the binary logarithm, to 1e-4: exact at powers of two, a polynomial in between.
fn half_log2(v: f32) -> f32 {
    let bits = bitcast<u32>(select(1e30, max(v, 1e-30), v < 1e30));
    let t = bitcast<f32>((bits & 0x7FFFFFu) | 0x3F800000u) - 1.0;
    let bend = 0.43807 + rn(t * (rn(t * 0.0803) - 0.23669));
    return 0.5 * (f32(i32(bits >> 23u) - 127) + (t + rn(rn(t * (1.0 - t)) * bend)));
}

fn bilinear(image: Image, level_in: u32, at: vec2<f32>, sampler: u32) -> vec4<f32> {
    let level = min(level_in, max(image.levels, 1u) - 1u);
    let size = level_size(image, level);
    let across = neighbours(at.x, size.x, sampler & WRAP_BITS);
    let down = neighbours(at.y, size.y, (sampler >> WRAP_DOWN_SHIFT) & WRAP_BITS);
    let first = i32(level_start(image, level));
    let upper_row = first + down.low * size.x;
    let lower_row = first + down.high * size.x;
    let upper = between(texel(upper_row + across.low), texel(upper_row + across.high), across.share);
    let lower = between(texel(lower_row + across.low), texel(lower_row + across.high), across.share);
    return between(upper, lower, down.share);
}

fn nearest(image: Image, level_in: u32, at: vec2<f32>, sampler: u32) -> vec4<f32> {
    let level = min(level_in, max(image.levels, 1u) - 1u);
    let size = level_size(image, level);
    let modes = vec2(sampler & WRAP_BITS, (sampler >> WRAP_DOWN_SHIFT) & WRAP_BITS);
    let x = texel_index(i32(floor(rn(wrapped(at.x, modes.x) * f32(size.x)))), size.x, modes.x);
    let y = texel_index(i32(floor(rn(wrapped(at.y, modes.y) * f32(size.y)))), size.y, modes.y);
    return texel(i32(level_start(image, level)) + y * size.x + x);
}

fn level_size(image: Image, level: u32) -> vec2<i32> {
    return vec2<i32>(max(image.size >> vec2(level), vec2(1u)));
}

fn level_start(image: Image, level: u32) -> u32 {
    var start = image.first_texel;
    for (var k = image.first_level; k < min(level, 32u); k++) {
        let size = max(image.size >> vec2(k), vec2(1u));
        start += size.x * size.y;
    }
    return start;
}

// The two texels around a coordinate, and how far it is from the first to the second.
struct Neighbours {
    low: i32,
    high: i32,
    share: f32,
};

fn neighbours(u: f32, size: i32, mode: u32) -> Neighbours {
    let s = rn(wrapped(u, mode) * f32(size)) - 0.5;
    let i = floor(s);
    return Neighbours(texel_index(i32(i), size, mode), texel_index(i32(i) + 1, size, mode), s - i);
}

// A coordinate in 0 to 1.
fn wrapped(u: f32, mode: u32) -> f32 {
    if mode == WRAP_REPEAT {
        return u - floor(u);
    }
    if mode == WRAP_MIRROR {
        return 1.0 - abs((u - 2.0 * floor(0.5 * u)) - 1.0);
    }
    return clamp(u, 0.0, 1.0);
}

// A texel that may lie one beyond the edge.
fn texel_index(i: i32, size: i32, mode: u32) -> i32 {
    if mode == WRAP_REPEAT {
        return select(select(i, i - size, i >= size), i + size, i < 0);
    }
    // The mirror's first texel beyond the edge is the last before it.
    return clamp(i, 0, size - 1);
}

fn texel(index: i32) -> vec4<f32> {
    let halves = texels[index];
    return vec4(unpack2x16float(halves.x), unpack2x16float(halves.y));
}

fn between(a: vec4<f32>, b: vec4<f32>, share: f32) -> vec4<f32> {
    return a + rn4((b - a) * share);
}
