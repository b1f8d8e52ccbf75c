// The compositing of a layer's colours, per pixel (stage peeling). Layers are what depth peeling finds of transparent
// surfaces, from front to back: in each round, for each sample, the nearest triangle behind the last round's. The
// new layer's colours go under those of the layers in front of it. Twin of
// src/render/backend/cpu/peeling/composite.rs.
//
// Uses: common.wgsl (CLIPPED, has, homogeneous, OUTSIDE, PEELED_HULL, rn4, sample_count,
// WIRES_ONLY, WORKGROUP), one_job.wgsl (batch, frame), geometry/steepness.wgsl (is_far, steepness),
// peeling/state.wgsl (ALPHA_MIN, PeelState), peeling/tints.wgsl (EDGE_ON, keeps_tints, tint_at,
// tint_depths_at, tint_steepness_at, TINTS), surface/barycentric.wgsl (corner_position, triangles,
// vertices), surface/group.wgsl (first_group, Group, group_color, seen_samples,
// single_sample_group), surface/hull.wgsl (hull_material, NOTHING), surface/point.wgsl (Show).

// The layer of this round, laid out as the visibility buffer.
@group(1) @binding(26) var<storage, read> peel_layer: array<vec2<u32>>;
@group(1) @binding(27) var<storage, read_write> peel_state: array<PeelState>;
// Per layer: 1 if there may be another behind it.
@group(1) @binding(28) var<storage, read_write> peel_rounds: array<atomic<u32>>;
// The colours that layers add to pixels, laid out as in tints.wgsl.
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;

@compute @workgroup_size(WORKGROUP)
fn composite(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    if batch.layer > 0u && atomicLoad(&peel_rounds[batch.layer - 1u]) == 0u {
        return;
    }
    let pixel = vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width);
    if batch.pass_bit == 0u {
        // A test reads the layer itself: nothing is shaded.
        for (var s = 0u; s < u32(sample_count()); s++) {
            _ = take_layer(u32(sample_count()) * i + s);
        }
        flag_pending(u32(sample_count()) * i, u32(sample_count()));
        return;
    }
    if batch.layer == 0u && keeps_tints() {
        colors[tint_depths_at(i)] = vec4(0.0);
    }
    let show = Show(!has(WIRES_ONLY), select(frame.layer_fade, 1.0, batch.layer == 0u), 1.0);
    if sample_count() == 1 {
        let group = single_sample_group(take_layer(i));
        add_group(i, i, group, group_color(group, pixel, show));
        flag_pending(i, 1u);
        return;
    }
    let first = u32(sample_count()) * i;
    for (var s = 0; s < sample_count(); s++) {
        _ = take_layer(first + u32(s));
    }
    // One iteration per triangle among the samples.
    var left = seen_samples(first);
    while left != 0u {
        let group = first_group(first, left);
        left &= ~group.same;
        add_group(i, first, group, group_color(group, pixel, show));
    }
    flag_pending(first, u32(sample_count()));
}

// The triangle of the previous layer at a sample.
fn triangle_of_sample(sample: u32) -> u32 {
    return peel_state[sample].taken;
}

// Moves the layer found at a sample to `previous`. Returns its id, or NOTHING where there is none
// or where it adds no colour.
fn take_layer(sample: u32) -> u32 {
    var so_far = PeelState(vec4(0.0), vec2(0u), 0u, 0u);
    if batch.layer > 0u {
        so_far = peel_state[sample];
    }
    let word = peel_layer[sample];
    so_far.previous = word;
    var id = select(~word.x, NOTHING, word.y == 0u);
    if has(PEELED_HULL) && id != NOTHING {
        let is_hull = id >= frame.triangle_count;
        let bit = 1u << (hull_material(id) & 31u);
        if is_hull && (so_far.materials & bit) != 0u {
            id = NOTHING;
        }
        so_far.materials |= bit;
    }
    so_far.taken = id;
    peel_state[sample] = so_far;
    return id;
}

// Composites the colour of a group under the other layers of its samples, in pixel i with this first sample.
fn add_group(i: u32, first: u32, group: Group, color: vec4<f32>) {
    let depth = bitcast<f32>(peel_state[first + firstTrailingBit(group.same)].previous.y);
    // The number of its samples, less what the layers in front hide of them.
    var seen = 0.0;
    for (var s = 0; s < sample_count(); s++) {
        if ((group.same >> u32(s)) & 1u) != 0u {
            seen += accumulate(first + u32(s), color);
        }
    }
    if keeps_tints() && group.id != NOTHING {
        add_tint(i, group.id, depth, rn4(color * (seen * (1.0 / f32(sample_count())))));
    }
}

// Adds a triangle of this layer to pixel i: the colour that it adds to the pixel's, and its depth at
// one of its samples.
fn add_tint(i: u32, id: u32, depth: f32, color: vec4<f32>) {
    if color.w <= ALPHA_MIN {
        return;
    }
    var farthest = depth;
    var steepest = steepness_of(id);
    if steepest < 0.0 {
        steepest = EDGE_ON;
    }
    var sum = color;
    let layer = min(batch.layer, TINTS - 1u);
    let before = colors[tint_depths_at(i)][layer];
    if before != 0.0 {
        farthest = min(before, farthest);
        steepest = max(colors[tint_steepness_at(i)][layer], steepest);
        sum = colors[tint_at(i, layer)] + color;
    }
    colors[tint_depths_at(i)][layer] = farthest;
    colors[tint_steepness_at(i)][layer] = steepest;
    colors[tint_at(i, layer)] = sum;
}

// The steepness of a triangle; -1 also where it reaches far.
fn steepness_of(id: u32) -> f32 {
    let a = vertices[triangles[3u * id]];
    let b = vertices[triangles[3u * id + 1u]];
    let c = vertices[triangles[3u * id + 2u]];
    var p = vec4(f32(a.x), f32(a.y), a.z, 1.0);
    var q = vec4(f32(b.x), f32(b.y), b.z, 1.0);
    var r = vec4(f32(c.x), f32(c.y), c.z, 1.0);
    if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE {
        if id >= frame.triangle_count || !has(CLIPPED) {
            return -1.0;
        }
        p = homogeneous(corner_position(id, 0u));
        q = homogeneous(corner_position(id, 1u));
        r = homogeneous(corner_position(id, 2u));
    }
    if is_far(p, q, r) {
        return -1.0;
    }
    return steepness(p, q, r);
}

// Composites a colour under a sample's other layers. Returns the share of the colour that shows.
fn accumulate(sample: u32, color: vec4<f32>) -> f32 {
    let so_far = peel_state[sample].color;
    let rest = 1.0 - so_far.w;
    let sum = so_far + rn4(rest * color);
    peel_state[sample].color = sum;
    if sum.w >= 1.0 {
        peel_state[sample].previous = vec2(0u);
    }
    return rest;
}

// Sets the round's flag if any of some samples may have another layer.
fn flag_pending(first: u32, count: u32) {
    for (var s = first; s < first + count; s++) {
        if peel_state[s].previous.y != 0u && atomicLoad(&peel_rounds[batch.layer]) == 0u {
            atomicStore(&peel_rounds[batch.layer], 1u);
        }
    }
}
