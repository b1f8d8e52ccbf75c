// The colour of each part of a mixed pixel (stage mixed). Mixed pixels are drawn again, from 64 or 256 points
// each, because different colours meet there. A part is a triangle that is visible at some of the points; its
// colour is weighted by its share of the points. mixed_parts.wgsl has found the parts, and mixed_sum.wgsl adds
// their colours up. Twin of src/render/backend/cpu/surface/waiting.rs.
//
// Uses: common.wgsl (WORKGROUP), mixed/lattice.wgsl (Share), mixed/place.wgsl (OVERFLOW, part_at,
// PART_COUNT), mixed/share_color.wgsl (share_color).

@group(1) @binding(22) var<storage, read> mixed: array<u32>;
// The parts become colours.
@group(1) @binding(31) var<storage, read_write> lists: array<vec4<u32>>;

@compute @workgroup_size(WORKGROUP)
fn mixed_shade(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    // Without room for all parts some are not written, and the picture is drawn once more.
    let count = select(mixed[PART_COUNT], 0u, mixed[OVERFLOW] != 0u);
    let threads = groups.x * groups.y * WORKGROUP;
    for (var i = gid.x + gid.y * groups.x * WORKGROUP; i < count; i += threads) {
        let part = lists[part_at(i)];
        let share = Share(bitcast<f32>(part.z), bitcast<vec2<f32>>(lists[part_at(i) + 1u].xy));
        lists[part_at(i)] = bitcast<vec4<u32>>(share_color(part.x, part.y, share, bitcast<f32>(part.w)));
    }
}
