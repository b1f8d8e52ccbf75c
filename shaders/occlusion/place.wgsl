// Linear depth (stage occlusion, which darkens hollows): from a value of the depth buffer to the distance from the
// far plane towards the viewer. The unit is a pixel (at the mesh's centre), as across the screen, so that
// distances can be measured in space. The CPU's counterpart is `place_of` in
// src/render/backend/cpu/occlusion/grid.rs.
//
// Uses: common.wgsl (recip, rn), one_job.wgsl or gang.wgsl (frame).

// The place of nothing: so far behind all else that no surface takes light from it.
const NOWHERE: f32 = -1e15;

// The place of a sample of depth z, pixels before the far plane.
fn place_of(z: f32) -> f32 {
    let depth = frame.occlusion_depth;
    return rn(rn(depth.x * z) * recip(rn(depth.y * z) + depth.z));
}

// True if a pixel lies in the picture.
fn is_in_picture(pixel: vec2<i32>) -> bool {
    return all(pixel >= vec2(0)) && all(pixel < vec2(frame.width, frame.height));
}
