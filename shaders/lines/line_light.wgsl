// The light on lines that are lit like the surface, per pixel (stage lines). Twin of
// src/render/backend/cpu/lines/line_light.rs.
//
// Light changes a colour by a factor and a summand. For each pixel both are the means over the samples that show
// the surface. If no sample does, they are those of the light on a face beside the line's edge.
//
// Uses: common.wgsl (first_visibility_sample, pixel_corner, sample_count, sample_offset,
// WORKGROUP), one_job.wgsl (batch, frame), surface/barycentric.wgsl (barycentrics),
// surface/light.wgsl (light), surface/material.wgsl (material_index, MATERIAL_LIT, materials),
// surface/normal.wgsl (normal).

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
// Per pixel, the surface's colour; then gain and gloss of the light on lines, one per pixel.
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;
// Per pixel, the face that lights the pass's lines, plus 1.
@group(1) @binding(11) var<storage, read_write> owners: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn line_light(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let owner = owners[i];
    if owner == 0u {
        return;
    }
    // For the next pass.
    owners[i] = 0u;
    let corner = pixel_corner(vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width));
    let samples_px = u32(sample_count());
    let in_base = first_visibility_sample(i);
    var sum = vec2(0.0);
    var count = 0.0;
    for (var s = 0u; s < samples_px; s++) {
        let word = samples[in_base + s];
        // A triangle of the surface, not of the outline mesh.
        if word.y != 0u && ~word.x < frame.triangle_count {
            sum += point_light(~word.x, vec2<f32>(corner + sample_offset(i32(s))));
            count += 1.0;
        }
    }
    if count == 0.0 {
        sum = point_light(owner - 1u, vec2<f32>(corner + 128));
        count = 1.0;
    }
    colors[batch.count + i] = vec4(sum / count, 0.0, 0.0);
}

// The light on a triangle at a point, in 1/256 px from the picture's centre, which may lie beside
// it.
fn point_light(id: u32, at: vec2<f32>) -> vec2<f32> {
    let m = material_index(id);
    if (materials[m].flags & MATERIAL_LIT) == 0u {
        return vec2(1.0, 0.0);
    }
    var b = barycentrics(id, at);
    b.value = inside(b.value);
    let here = light(materials[m].metallic, materials[m].roughness, normal(id, at, m, b));
    return vec2(here.gain, here.gloss);
}

// Barycentrics of a point of the triangle: those of one beside it do not extrapolate.
fn inside(v: vec3<f32>) -> vec3<f32> {
    // NaN, of a triangle seen edge-on, becomes 0.
    let b = select(vec3(0.0), min(v, vec3(1.0)), v > vec3(0.0));
    let sum = (b.x + b.y) + b.z;
    if sum > 0.0 {
        return b / sum;
    }
    return vec3(1.0 / 3.0);
}
