// Light without images. Twin of src/backend/cpu/light.rs.

// Light on a surface with unit normal n: straight alpha in, premultiplied out.
fn light(m: u32, n: vec3<f32>) -> vec4<f32> {
    let base = materials[m].base_color;
    let roughness = materials[m].roughness;
    let alpha = max(roughness * roughness, 0.0025);
    let alpha_squared = alpha * alpha;
    let ambient = frame.ambient * (0.7 + 0.3 * dot(n, frame.screen_up.xyz));
    var diffuse = 0.0;
    var shine = 0.0;
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
    }
    let metallic = materials[m].metallic;
    let specular = 0.04 + metallic * (base.xyz - 0.04);
    let reflected = base.xyz * (1.0 - metallic) * diffuse + specular * shine;
    return vec4(clamp(base.xyz * ambient + reflected, vec3(0.0), vec3(1.0)) * base.w, base.w);
}
