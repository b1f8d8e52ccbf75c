// The last step for mixed pixels (stage mixed), which are drawn again from 64 or 256 points because different
// colours meet there. Each triangle visible at some of the points is a part (sometimes one in each quarter of the
// pixel). mixed_shade.wgsl has computed the parts' colours, already weighted by their shares of the points. This
// kernel adds them up, in the CPU's order, and writes the pixel's colour. No twin: on the CPU,
// src/render/backend/cpu/mixed/color.rs adds up the colours as it computes them.
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
