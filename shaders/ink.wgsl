// Stage 4, a pixel: the union of the strokes that touch it, laid over what is there. Twin of src/backend/cpu/ink.rs.

// Of the surface, a pixel each, over nothing; from the first line pass on over the background and the lines so far. Then the light
// on the pass's lines, a pixel each.
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;
// Of each pixel, what stroke.wgsl says.
@group(1) @binding(12) var<storage, read_write> strokes: array<u32>;
// Of each pass.
@group(1) @binding(17) var<storage, read> line_colors: array<vec4<f32>>;

override STROKE_WORDS: u32 = 0u;

@compute @workgroup_size(64)
fn ink(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * 64u;
    if i >= batch.count {
        return;
    }
    if (batch.line_flags & FIRST_PASS) != 0u {
        colors[i] = over_background(i);
    }
    let cover = coverage(STROKE_WORDS * i);
    if cover == 0.0 {
        return;
    }
    var color = line_colors[batch.line_pass];
    if (batch.line_flags & LIT_PASS) != 0u {
        color = lit_color(color, colors[batch.count + i].xy);
    }
    colors[i] = rn4(cover * color) + rn4(colors[i] * (1.0 - rn(cover * color.w)));
}

fn over_background(i: u32) -> vec4<f32> {
    if !has(SURFACE | HULL) {
        return frame.background;
    }
    let color = colors[i];
    return color + rn4(frame.background * (1.0 - color.w));
}

// How much of a pixel the strokes at `at` cover, 0 to the lines' peak. Leaves none for the next pass.
fn coverage(at: u32) -> f32 {
    let rounds = strokes[at + 2u];
    let sum = vec2(strokes[at], rounds & 0xFFFFu);
    let all = vec2(strokes[at + 1u], rounds >> 16u);
    if (sum.x | all.x | rounds) == 0u {
        return 0.0;
    }
    var points = 0u;
    for (var w = 3u; w < STROKE_WORDS; w++) {
        points += countOneBits(strokes[at + w]);
    }
    for (var w = 0u; w < STROKE_WORDS; w++) {
        strokes[at + w] = 0u;
    }
    if points == 256u && (all.x > 256u || all.y > 0u) {
        return batch.line_peak;
    }
    var covered = wide_to_f32(sum) * (1.0 / 65536.0);
    if all.x > points || all.y > 0u {
        covered = covered * (f32(points) / wide_to_f32(all));
    }
    return min(covered, batch.line_peak);
}

// A premultiplied colour under light (A, B).
fn lit_color(c: vec4<f32>, light: vec2<f32>) -> vec4<f32> {
    return vec4(clamp(rn3(c.xyz * light.x) + rn(light.y * c.w), vec3(0.0), vec3(c.w)), c.w);
}
