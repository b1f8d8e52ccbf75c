// The background behind a pixel, and the compositing of a pixel's colour over it (stages lines and resolve). The
// sign of the colour's alpha tells whether the background is already part of it. The CPU's counterpart is in
// src/render/backend/cpu/resolve.rs.
//
// Uses: common.wgsl (rn4), one_job.wgsl or gang.wgsl (batch, frame).

// True if the background is part of a pixel's colour already: then the sign of its alpha is set.
// Otherwise the colour is the surface's over nothing.
fn is_composited(color: vec4<f32>) -> bool {
    return (bitcast<u32>(color.w) >> 31u) == 1u;
}

// Sets or clears that sign.
fn flip_alpha_sign(color: vec4<f32>) -> vec4<f32> {
    return vec4(color.xyz, bitcast<f32>(bitcast<u32>(color.w) ^ 0x80000000u));
}

// The background behind pixel number i of the batch's rows. Twin of DrawPlan::background_at.
fn background_at(i: u32) -> vec4<f32> {
    let rows = f32(batch.row_first + i32(i) / frame.width) + 0.5;
    return frame.background + rn4(frame.background_step * rows);
}

fn over_background(surface: vec4<f32>, background: vec4<f32>) -> vec4<f32> {
    return surface + rn4(background * (1.0 - surface.w));
}
