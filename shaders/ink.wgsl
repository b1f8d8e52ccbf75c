// Stage 4, a pixel: the union of the strokes that touch it. Twin of src/backend/cpu/ink.rs.

// Of each line pass, how much of each pixel it covers, 0 to 1.
@group(1) @binding(11) var<storage, read_write> coverages: array<u32>;
// Of each pixel: sum of areas, sum of points, points of any.
@group(1) @binding(12) var<storage, read_write> strokes: array<u32>;

@compute @workgroup_size(64)
fn ink(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * 64u;
    if i >= batch.count {
        return;
    }
    let at = 10u * i;
    let sum = strokes[at];
    let all = strokes[at + 1u];
    if (sum | all) == 0u {
        return;
    }
    var points = 0u;
    for (var w = 2u; w < 10u; w++) {
        points += countOneBits(strokes[at + w]);
    }
    var coverage = f32(sum) * (1.0 / 65536.0);
    if points == 256u && all > 256u {
        coverage = batch.line_peak;
    } else if all > points {
        coverage = coverage * (f32(points) / f32(all));
    }
    coverages[batch.ink_at + i] = bitcast<u32>(min(coverage, batch.line_peak));
    // For the next pass.
    for (var w = 0u; w < 10u; w++) {
        strokes[at + w] = 0u;
    }
}
