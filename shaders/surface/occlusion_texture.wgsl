// The effect of an occlusion texture, which a mesh file may have (stage shade): it darkens ambient light at a
// point, and no other light. Twin of src/render/backend/cpu/surface/occlusion_texture.rs.
//
// Uses: common.wgsl (dot3, rn), one_job.wgsl or gang.wgsl (frame), surface/light.wgsl (Light).

// The light without the ambient part that the texture's red takes away.
fn with_occlusion_texture(lit_here: Light, strength: f32, red: f32, metallic: f32, n: vec3<f32>) -> Light {
    let n_up = dot3(n, frame.screen_up.xyz);
    let ambient = rn((1.0 - metallic) * rn(frame.ambient * (0.7 + rn(0.3 * n_up))));
    return Light(lit_here.gain - rn(ambient * rn(strength * (1.0 - red))), lit_here.gloss);
}
