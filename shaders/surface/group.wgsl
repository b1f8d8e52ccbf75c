// Groups of a pixel's samples that show the same triangle (stage shade). A group is shaded once, at the mean
// position of its samples. With adaptive samples, a metal that mirrors sharply and has vertex normals has a group in
// each quarter of the pixel, because what it mirrors changes within the pixel. Shared by shade.wgsl, paint.wgsl
// and composite.wgsl, each of which defines triangle_of_sample(sample).
//
// Uses: common.wgsl (ADAPTIVE, has, pixel_corner, recip, rn2, sample_count, sample_offset,
// SURFACE), one_job.wgsl or gang.wgsl (frame), peeling/composite.wgsl or surface/paint.wgsl or
// surface/shade.wgsl (triangle_of_sample), surface/hull.wgsl (hull_color, NOTHING),
// surface/material.wgsl (is_quartered), surface/point.wgsl (point_color, Show).

@group(1) @binding(24) var<storage, read> pass_masks: array<u32>;

struct Group {
    id: u32,
    // Samples of the group, one bit each.
    same: u32,
    // Their number, and the sum of their offsets in 1/256 px.
    count: i32,
    offset_sum: vec2<i32>,
};

// Samples of a pixel that show a triangle, one bit each.
fn seen_samples(first: u32) -> u32 {
    var mask = 0u;
    for (var s = 0; s < sample_count(); s++) {
        mask |= select(0u, 1u, triangle_of_sample(first + u32(s)) != NOTHING) << u32(s);
    }
    return mask;
}

// The triangle that the first of the samples `left` sees, of the pixel whose first sample is given; all of its samples, or
// those in the same quarter of the pixel.
fn first_group(first: u32, left: u32) -> Group {
    var g = Group(triangle_of_sample(first + firstTrailingBit(left)), 0u, 0, vec2(0));
    let is_divided = has(ADAPTIVE) && g.id != NOTHING && is_quartered(g.id);
    let quarter = sample_offset(i32(firstTrailingBit(left))) >> vec2(7u);
    for (var s = 0; s < sample_count(); s++) {
        let is_in = !is_divided || all(sample_offset(s) >> vec2(7u) == quarter);
        if is_in && triangle_of_sample(first + u32(s)) == g.id {
            g.same |= 1u << u32(s);
            g.count++;
            g.offset_sum += sample_offset(s);
        }
    }
    return g;
}

// The only sample of a pixel.
fn single_sample_group(id: u32) -> Group {
    return Group(id, 1u, 1, sample_offset(0));
}

// The colour of a group's triangle at the mean of its samples.
fn group_color(g: Group, pixel: vec2<i32>, show: Show) -> vec4<f32> {
    if g.id == NOTHING {
        return vec4(0.0);
    }
    if g.id >= frame.triangle_count {
        return hull_color(g.id);
    }
    if !has(SURFACE) {
        return vec4(0.0);
    }
    let mean = rn2(vec2<f32>(g.offset_sum) * recip(f32(g.count)));
    return point_color(g.id, vec2<f32>(pixel_corner(pixel)) + mean, show);
}
