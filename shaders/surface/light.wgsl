// Stage shade, per point: light without images. Twin of src/backend/cpu/surface/light.rs.
//
// The CPU's bits: a whole flat face has one light, and that may lie on the threshold between two
// bytes.

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
        let mirrored = rn(2.0 * rn(n_view * n_up)) - dot3(to_viewer, frame.screen_up.xyz);
        let seen = rn(rn(metallic * (frame.ambient + rn(0.5 * strength))) * studio(mirrored, roughness));
        gain += rn(seen * (1.0 - rise));
        gloss += rn(seen * rise);
    }
    return Light(gain, gloss);
}

// Brightness of the studio in a direction that rises by `up` (the sine of its elevation).
fn studio(up: f32, roughness: f32) -> f32 {
    let blur = 0.2 + rn(0.8 * roughness);
    let square = rn(blur * blur);
    // 1 / blur and 1 / sum by one reciprocal.
    let sum = square + rn(4.0 * rn(up * up));
    let inverse = quick_recip(rn(blur * sum));
    // 0 below -blur, 1 above blur.
    let t = clamp(0.5 + rn(rn(0.5 * up) * rn(sum * inverse)), 0.0, 1.0);
    let sky = rn(rn(t * t) * (3.0 - rn(2.0 * t)));
    let horizon = rn(rn(0.35 * (1.0 - roughness)) * rn(rn(square * blur) * inverse));
    return (0.36 + rn(0.79 * sky)) + horizon;
}
