// Light without images. Twin of src/backend/cpu/light.rs.

// What light makes of a base colour: base * gain + gloss, in each channel.
struct Light {
    gain: f32,
    gloss: f32,
};

// Light on a surface with unit normal n.
fn light(metallic: f32, roughness: f32, n: vec3<f32>) -> Light {
    let alpha = max(roughness * roughness, 0.0025);
    let alpha_squared = alpha * alpha;
    let ambient = frame.ambient * (0.7 + 0.3 * dot(n, frame.screen_up.xyz));
    var diffuse = 0.0;
    var shine = 0.0;
    var strength = 0.0;
    for (var i = 0u; i < frame.lamp_count; i++) {
        let lamp = frame.lamps[i];
        let halfway = frame.halfways[i].xyz;
        let n_light = max(dot(n, lamp.xyz), 0.0);
        let n_half = max(dot(n, halfway), 0.0);
        let light_half = dot(lamp.xyz, halfway);
        let lobe = n_half * n_half * (alpha_squared - 1.0) + 1.0;
        let gloss = alpha_squared / (lobe * lobe * max(light_half * light_half, 0.1) * (4.0 * roughness + 2.0));
        diffuse += lamp.w * n_light;
        shine += lamp.w * n_light * gloss;
        strength += lamp.w;
    }
    let matte = 1.0 - metallic;
    var gain = matte * (ambient + diffuse) + metallic * shine;
    var gloss = 0.04 * matte * shine;
    if metallic > 0.0 {
        let to_viewer = frame.to_viewer.xyz;
        let n_view = dot(n, to_viewer);
        // Schlick's rise towards grazing angles, less of it where the surface is rough.
        let grazing = 1.0 - clamp(n_view, 0.0, 1.0);
        let square = grazing * grazing;
        let rise = square * square * grazing * (1.0 - roughness);
        let mirrored = 2.0 * n_view * dot(n, frame.screen_up.xyz) - dot(to_viewer, frame.screen_up.xyz);
        let seen = metallic * (frame.ambient + 0.5 * strength) * studio(mirrored, roughness);
        gain += seen * (1.0 - rise);
        gloss += seen * rise;
    }
    return Light(gain, gloss);
}

// Brightness of the studio in a direction that rises by `up` (the sine of its elevation).
fn studio(up: f32, roughness: f32) -> f32 {
    let blur = 0.2 + 0.8 * roughness;
    let sky = ramp(-blur, blur, up);
    let band = up / blur;
    return (0.36 + (1.15 - 0.36) * sky) + 0.35 * (1.0 - roughness) / (1.0 + 4.0 * band * band);
}
