// The search for colour breaks, places where the colour differs clearly (stage mixed): two samples that follow
// each other show different faces, or a face and nothing, whose colours are not alike. Samples are compared inside
// each pixel of a band of rows and of a border of one pixel around it, and across the pixel's left and upper side.
// From the breaks, mixed_pixels.wgsl finds the pixels that are drawn again from more points. Twin of find_breaks
// in src/render/backend/cpu/mixed/find/mod.rs.
//
// Uses: common.wgsl (has, sample_count, SIXTEEN_SAMPLES, WORKGROUP), one_job.wgsl (batch, frame),
// mixed/find/look.wgsl (step_between), mixed/find/seen_faces.wgsl (BREAKS_LEFT, breaks_of,
// BREAKS_OWN, BREAKS_UPPER, id_at, is_seen), mixed/place.wgsl (breaks_at, HEAD_WORDS).

@group(1) @binding(22) var<storage, read_write> mixed: array<u32>;

// Numbers of the samples closest to a pixel's sides, of 4 samples and of 16: from the lowest nibble on the leftmost,
// the rightmost, the topmost and the lowest.
const FOUR_OUTERMOST: u32 = 0x3012u;
const SIXTEEN_OUTERMOST: u32 = 0xEFDCu;

@compute @workgroup_size(WORKGROUP)
fn breaks(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    if i == 0u {
        // Nothing of the band is counted yet.
        for (var w = 0u; w < HEAD_WORDS; w++) {
            mixed[w] = 0u;
        }
    }
    let columns = frame.width + 2;
    let pixel = vec2(i32(i) % columns - 1, batch.row_first - 1 + i32(i) / columns);
    var found = 0u;
    if is_seen(pixel) {
        var before = id_at(pixel, 0);
        for (var s = 1; s < sample_count(); s++) {
            let id = id_at(pixel, s);
            found |= breaks_of(step_between(before, id), BREAKS_OWN);
            before = id;
        }
    }
    let packed = select(FOUR_OUTERMOST, SIXTEEN_OUTERMOST, has(SIXTEEN_SAMPLES));
    let outermost = vec4<i32>(vec4(packed, packed >> 4u, packed >> 8u, packed >> 12u) & vec4(15u));
    let left = id_at(pixel - vec2(1, 0), outermost.y);
    found |= breaks_of(step_between(left, id_at(pixel, outermost.x)), BREAKS_LEFT);
    let upper = id_at(pixel - vec2(0, 1), outermost.w);
    found |= breaks_of(step_between(upper, id_at(pixel, outermost.z)), BREAKS_UPPER);
    mixed[breaks_at(pixel)] = found;
}
