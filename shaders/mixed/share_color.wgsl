// The colour that one triangle adds to a mixed pixel (stage mixed). Mixed pixels are drawn again, from 64 or 256
// points each, because different colours meet there. The triangle is shaded at the mean position of the points at
// which it is visible, and its colour is weighted by their share of all points. Used by mixed_shade.wgsl and
// mixed_color.wgsl.
//
// Uses: common.wgsl (first_visibility_sample, has, OCCLUSION, pixel_corner, rn4, SURFACE),
// one_job.wgsl (batch, frame), mixed/lattice.wgsl (Share), occlusion/spread.wgsl (open_share),
// surface/hull.wgsl (hull_color), surface/point.wgsl (point_color, Show).

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;

// The pixel with this index in the band.
fn pixel_of(at: u32) -> vec2<i32> {
    return vec2(i32(at) % frame.width, batch.row_first + i32(at) / frame.width);
}

// The colour of a triangle at a point of a pixel, times the triangle's weight, given its depth there.
fn share_color(id: u32, at: u32, share: Share, depth: f32) -> vec4<f32> {
    if id >= frame.triangle_count {
        return rn4(share.weight * hull_color(id));
    }
    if !has(SURFACE) {
        return vec4(0.0);
    }
    let pixel = pixel_of(at);
    var show = Show(true, 1.0, 1.0);
    if has(OCCLUSION) {
        show.open = open_share(pixel, depth, bitcast<f32>(samples[first_visibility_sample(at)].y));
    }
    return rn4(share.weight * point_color(id, vec2<f32>(pixel_corner(pixel)) + share.mean, show));
}
