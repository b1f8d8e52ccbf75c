// The test whether a dispatch draws a triangle at all. The triangle must have an area on screen, show the wanted
// side (front, back or either), and belong to the pass that is being drawn: that of the visibility buffer or that
// of transparent layers. One byte per triangle, its pass mask, says to which of them it belongs. Used by the
// stages visibility, peeling, mixed and lines.
//
// Uses: common.wgsl (FACES_BACK, FACES_BOTH, FACES_FRONT, has, PASS_BACK_ONLY, PASS_FRONT_ONLY,
// PASS_MASKS), one_job.wgsl or gang.wgsl (batch), geometry/triangle.wgsl (is_negative, is_zero).

// One byte per triangle.
@group(1) @binding(24) var<storage, read> pass_masks: array<u32>;

// True if the batch draws triangle t of this area: pass mask and face culling.
fn passes_culling(t: u32, area: vec2<u32>) -> bool {
    if is_zero(area) {
        return false;
    }
    var faces = batch.faces;
    if has(PASS_MASKS) && batch.pass_bit != 0u {
        let mask = pass_masks[t / 4u] >> (8u * (t & 3u));
        if (mask & batch.pass_bit) == 0u {
            return false;
        }
        if (mask & (PASS_FRONT_ONLY | PASS_BACK_ONLY)) != 0u {
            faces = select(FACES_BACK, FACES_FRONT, (mask & PASS_FRONT_ONLY) != 0u);
        }
    }
    return faces == FACES_BOTH || (faces == FACES_FRONT) == is_negative(area);
}
