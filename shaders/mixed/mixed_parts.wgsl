// The parts of each mixed pixel (stage mixed). Mixed pixels are drawn again, from 64 or 256 points each, because
// different colours meet there. A part is a triangle that is visible at some of the points, with its share of the
// points and their mean position. (A triangle of a metal that mirrors sharply may be a part in each quarter of the
// pixel.) To find the parts, the nearest triangle at each point is chosen from the pixel's list of triangles
// (lists.wgsl). Twin of src/render/backend/cpu/mixed/color.rs and faces.rs.
//
// mixed_shade.wgsl then computes the parts' colours, and mixed_sum.wgsl adds them up.
//
// Uses: common.wgsl (CLIPPED, has, LINES, WORKGROUP), one_job.wgsl (batch), mixed/lattice.wgsl
// (depth_at_point, FEW_STEP, POINTS, PointTriangle, Share), mixed/place.wgsl (border_at,
// BORDER_WORDS, FEW, item_at, list_at, LIST_END, OVERFLOW, part_at, PART_COUNT, parts_at,
// PARTS_OF_PIXEL, pixel_at), mixed/point_sets.wgsl (add_points, clear_sets, find_digit_sets,
// find_firsts_of_sets, first_of_set, quarters_of_set, share_of_set, WHOLE), mixed/shares.wgsl
// (border_word, depth_of_share, find_firsts, first_count, firsts_before, is_first, own_points,
// seen, share_of).

@group(1) @binding(22) var<storage, read_write> mixed: array<atomic<u32>>;
// Items of lists, then parts.
@group(1) @binding(31) var<storage, read_write> lists: array<vec4<u32>>;

// Longest list. A picture in which a pixel has a longer one is drawn once more, without lists.
const LIST_MAX: u32 = 4096u;

var<workgroup> pixel_count: u32;
var<workgroup> list_length: u32;
// The pixel's first part.
var<workgroup> part_first: u32;

@compute @workgroup_size(WORKGROUP)
fn mixed_parts(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    if thread == 0u {
        pixel_count = select(atomicLoad(&mixed[0]), 0u, atomicLoad(&mixed[OVERFLOW]) != 0u);
    }
    find_digit_sets(thread);
    let count = workgroupUniformLoad(&pixel_count);
    for (var number = workgroup.x + workgroup.y * groups.x; number < count; number += groups.x * groups.y) {
        write_parts(number, thread);
        // Another pixel must not be read before all threads are done with this one.
        workgroupBarrier();
    }
}

// Writes the parts of the pixel of this number.
fn write_parts(number: u32, thread: u32) {
    let entry = atomicLoad(&mixed[pixel_at(number)]);
    let at = entry & ~FEW;
    let is_few = (entry & FEW) != 0u;
    let own = own_points(thread, is_few);
    clear_sets(thread);
    let found = see(number, own);
    if thread == 0u {
        list_length = found.length;
    }
    let length = workgroupUniformLoad(&list_length);
    // Pieces of a clipped triangle are several items, but one part.
    let has_sets = length <= WORKGROUP && !has(CLIPPED);
    if has_sets {
        add_points(found.items, own);
        workgroupBarrier();
        find_firsts_of_sets(thread, length);
        workgroupBarrier();
    } else {
        find_firsts(thread, is_few);
    }
    if thread == 0u {
        part_first = take_parts(number, first_count());
    }
    let first = workgroupUniformLoad(&part_first);
    if first != LIST_END && has_sets && thread < length {
        let depth = seen[min(first_of_set(thread, WHOLE), POINTS - 1u)].y;
        let quarters = quarters_of_set(thread);
        for (var q = quarters.x; q <= quarters.y; q++) {
            let p = first_of_set(thread, q);
            if p < POINTS {
                write_part(first, p, at, share_of_set(thread, q, is_few), depth);
            }
        }
    }
    for (var p = own.x; first != LIST_END && !has_sets && p < POINTS; p += own.y) {
        if is_first(p) {
            write_part(first, p, at, share_of(p, is_few), bitcast<u32>(depth_of_share(p, select(1u, FEW_STEP, is_few))));
        }
    }
    if has(LINES) && thread < BORDER_WORDS {
        atomicStore(&mixed[border_at(number) + thread], select(border_word(thread), 0u, is_few));
    }
}

// Writes the part of the triangle that p is the first point of, given the pixel's first part and the triangle's depth.
fn write_part(first: u32, p: u32, at: u32, share: Share, depth: u32) {
    let part = part_at(first + firsts_before(p));
    lists[part] = vec4(~seen[p].x, at, bitcast<u32>(share.weight), depth);
    lists[part + 1u] = vec4(bitcast<vec2<u32>>(share.mean), 0u, 0u);
}

// Takes room for so many parts of a pixel, and returns the first; LIST_END if there is none.
fn take_parts(number: u32, count: u32) -> u32 {
    let first = atomicAdd(&mixed[PART_COUNT], count);
    if first + count > batch.part_capacity {
        atomicStore(&mixed[OVERFLOW], 1u);
        atomicStore(&mixed[parts_at(number)], 0u);
        return LIST_END;
    }
    atomicStore(&mixed[parts_at(number)], first * PARTS_OF_PIXEL + count);
    return first;
}

// The length of a pixel's list, and the item of it that each point of a thread sees.
struct Found {
    length: u32,
    items: vec4<u32>,
};

// Finds what the points of a thread see: one of few, or four.
fn see(number: u32, own: vec2<u32>) -> Found {
    var a = vec3(0u);
    var b = a;
    var c = a;
    var d = a;
    let is_few = own.y != WORKGROUP;
    var item = atomicLoad(&mixed[list_at(number)]);
    var length = 0u;
    while item != LIST_END {
        if length == LIST_MAX {
            atomicStore(&mixed[OVERFLOW], 1u);
            break;
        }
        let values = bitcast<vec4<i32>>(lists[item_at(item)]);
        let steps = bitcast<vec4<i32>>(lists[item_at(item) + 1u]);
        let depth = lists[item_at(item) + 2u];
        let rest = lists[item_at(item) + 3u];
        let triangle = PointTriangle(
            values.xyz,
            vec3(steps.xy, -steps.x - steps.y),
            vec3(steps.zw, -steps.z - steps.w),
            vec2(values.w, bitcast<i32>(depth.w)),
            bitcast<vec3<f32>>(depth.xyz),
            bitcast<vec2<f32>>(rest.xy),
        );
        a = nearer(a, ~rest.z, depth_at_point(triangle, own.x), length);
        if !is_few {
            b = nearer(b, ~rest.z, depth_at_point(triangle, own.x + WORKGROUP), length);
            c = nearer(c, ~rest.z, depth_at_point(triangle, own.x + 2u * WORKGROUP), length);
            d = nearer(d, ~rest.z, depth_at_point(triangle, own.x + 3u * WORKGROUP), length);
        }
        item = rest.w;
        length++;
    }
    seen[own.x] = a.xy;
    if !is_few {
        seen[own.x + WORKGROUP] = b.xy;
        seen[own.x + 2u * WORKGROUP] = c.xy;
        seen[own.x + 3u * WORKGROUP] = d.xy;
    }
    return Found(length, vec4(a.z, b.z, c.z, d.z));
}

// The nearer of what a point sees so far (the complement of an id, a depth, an item) and a triangle; the one with the
// lower id where they are at one depth.
fn nearer(best: vec3<u32>, word: u32, z: f32, item: u32) -> vec3<u32> {
    let depth = bitcast<u32>(z);
    let is_nearer = depth != 0u && (depth > best.y || (depth == best.y && word > best.x));
    return select(best, vec3(word, depth, item), is_nearer);
}
