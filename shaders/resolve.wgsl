// Stage resolve, the last one, per pixel: the background is laid under the pixel's colour, unless the stage lines
// has done so, and the result is converted to sRGB bytes. Twin of src/render/backend/cpu/resolve.rs.
//
// Uses: common.wgsl (has, HULL, LINES, SURFACE, WORKGROUP), one_job.wgsl or gang.wgsl (batch,
// begin_job, frame), encode.wgsl (encode, rgba), over.wgsl (background_at, flip_alpha_sign,
// is_composited, over_background).

// Per pixel. A negative alpha means that lines have already blended the background into this
// colour; otherwise it is premultiplied, without background.
@group(1) @binding(9) var<storage, read> colors: array<vec4<f32>>;

@compute @workgroup_size(WORKGROUP)
fn resolve(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    begin_job(gid.z);
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    var c = background_at(i);
    if has(SURFACE | HULL | LINES) {
        c = colors[frame.pixels_at + i];
        if has(LINES) && is_composited(c) {
            c = flip_alpha_sign(c);
        } else {
            c = over_background(c, background_at(i));
        }
    }
    rgba[batch.rgba_at + i] = encode(c);
}
