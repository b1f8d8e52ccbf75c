// Stage mixed, per mixed pixel: its colour, the sum of its parts.
//
// Uses: common.wgsl (WORKGROUP), mixed/place.wgsl (FEW, part_at, parts_at, PARTS_OF_PIXEL,
// pixel_at).

@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;
@group(1) @binding(22) var<storage, read> mixed: array<u32>;
@group(1) @binding(31) var<storage, read> lists: array<vec4<u32>>;

@compute @workgroup_size(WORKGROUP)
fn mixed_sum(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = gid.x + gid.y * groups.x * WORKGROUP;
    if number >= mixed[0] {
        return;
    }
    let range = mixed[parts_at(number)];
    let first = range / PARTS_OF_PIXEL;
    // In the order of points, as the CPU adds them.
    var sum = vec4(0.0);
    for (var i = first; i < first + range % PARTS_OF_PIXEL; i++) {
        sum += bitcast<vec4<f32>>(lists[part_at(i)]);
    }
    colors[mixed[pixel_at(number)] & ~FEW] = sum;
}
