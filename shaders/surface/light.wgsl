// The light on a point of the surface (stage shade): from lamps, from above and below and, for metals, from
// surroundings that they mirror. All of it is computed by formulas, without images. Twin of
// src/render/backend/cpu/surface/light.rs.
//
// For faces that have one normal, the result has the same bits as on the CPU. Such a face has one light, which may
// lie on the rounding threshold between two 8-bit values: then the smallest difference would change all its pixels.
//
// Uses: common.wgsl (dot3, quick_recip, rn, rn3, rolled_off), one_job.wgsl or gang.wgsl (frame).

// Effect of light on a base colour: base * gain + gloss, per channel.
struct Light {
    gain: f32,
    gloss: f32,
};

// A colour with straight alpha under light.
fn lit(base: vec4<f32>, light_here: Light) -> vec4<f32> {
    return vec4(rolled_off(rn3(base.xyz * light_here.gain) + light_here.gloss, 1.0), base.w);
}

// A colour as it is, clamped to 1.
fn unlit(base: vec4<f32>) -> vec4<f32> {
    return vec4(clamp(base.xyz, vec3(0.0), vec3(1.0)), base.w);
}

// Light on a surface with unit normal n.
fn light(metallic: f32, roughness: f32, n: vec3<f32>) -> Light {
    let alpha = max(rn(roughness * roughness), 0.0025);
    let alpha_squared = rn(alpha * alpha);
    let n_up = dot3(n, frame.screen_up.xyz);
    let ambient = rn(frame.ambient * (0.7 + rn(0.3 * n_up)));
    var diffuse = 0.0;
    var shine = 0.0;
    var strength = 0.0;
    for (var i = 0u; i < frame.lamp_count; i++) {
        let lamp = frame.lamps[i];
        let halfway = frame.halfways[i].xyz;
        let n_light = max(dot3(n, lamp.xyz), 0.0);
        let n_half = max(dot3(n, halfway), 0.0);
        let light_half = dot3(lamp.xyz, halfway);
        let lobe = rn(rn(n_half * n_half) * (alpha_squared - 1.0)) + 1.0;
        let spread = rn(rn(lobe * lobe) * max(rn(light_half * light_half), 0.1));
        let gloss = rn(alpha_squared * quick_recip(rn(spread * (rn(4.0 * roughness) + 2.0))));
        let direct = rn(lamp.w * n_light);
        diffuse += direct;
        shine += rn(direct * gloss);
        strength += lamp.w;
    }
    let matte = 1.0 - metallic;
    var gain = rn(matte * (ambient + diffuse)) + rn(metallic * shine);
    var gloss = rn(rn(0.04 * matte) * shine);
    if metallic > 0.0 {
        let to_viewer = frame.to_viewer.xyz;
        let n_view = dot3(n, to_viewer);
        // Schlick's rise towards grazing angles, less of it where the surface is rough.
        let grazing = 1.0 - clamp(n_view, 0.0, 1.0);
        let square = rn(grazing * grazing);
        let rise = rn(rn(rn(square * square) * grazing) * (1.0 - roughness));
        // The view's mirror image.
        let screen_right = frame.screen_right.xyz;
        let right = rn(2.0 * rn(n_view * dot3(n, screen_right))) - dot3(to_viewer, screen_right);
        let up = rn(2.0 * rn(n_view * n_up)) - dot3(to_viewer, frame.screen_up.xyz);
        let seen = rn(rn(metallic * (frame.ambient + rn(0.5 * strength))) * surroundings(right, up, roughness));
        gain += rn(seen * (1.0 - rise));
        gloss += rn(seen * rise);
    }
    return Light(gain, gloss);
}

// Brightness of the surroundings in the direction of length 1 that points so far to the right and up, on screen.
fn surroundings(right: f32, up: f32, roughness: f32) -> f32 {
    let alpha = max(rn(roughness * roughness), 0.0025);
    // Half the width of a window's soft edge, and the inverse of the whole, by one reciprocal.
    let sum = alpha + 0.7;
    let inverse = quick_recip(rn(3.6 * rn(alpha * sum)));
    let blur = rn(rn(6.48 * rn(alpha * alpha)) * inverse);
    let sharpness = min(rn(rn(sum * sum) * inverse), 25.0);
    let sky = soft_step(up, 0.0, min(sharpness, 2.0));
    var windows = 0.0;
    windows += rn(3.5 * window_share(right, up, vec4(-0.5, -0.22, 0.68, 0.86), sharpness));
    windows += rn(3.2 * window_share(right, up, vec4(0.74, 0.92, -0.35, 0.5), sharpness));
    windows += rn(3.2 * window_share(right, up, vec4(-0.92, -0.8, -0.4, 0.6), sharpness));
    // Towards the rim of the view a window has a larger solid angle than its rectangle, so blurred light gets more
    // of it.
    return (0.08 + rn(0.34 * sky)) + rn((1.0 + rn(blur * blur)) * windows);
}

// Share of a window that is seen in a direction. Its edges: left, right, lower, upper.
fn window_share(right: f32, up: f32, edges: vec4<f32>, sharpness: f32) -> f32 {
    let across = soft_step(right, edges.x, sharpness) - soft_step(right, edges.y, sharpness);
    let along = soft_step(up, edges.z, sharpness) - soft_step(up, edges.w, sharpness);
    return rn(across * along);
}

// 0 far below a soft edge, 1 far above.
fn soft_step(place: f32, edge: f32, sharpness: f32) -> f32 {
    let t = clamp(0.5 + rn((place - edge) * sharpness), 0.0, 1.0);
    return rn(rn(t * t) * (3.0 - rn(2.0 * t)));
}
