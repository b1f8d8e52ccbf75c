// The clipping of triangles that reach behind the near plane or far outside the picture (stage visibility), one
// triangle per thread. What is left of a triangle is a fan of up to six triangles. This kernel appends them to the
// work list, and visibility_tile.wgsl draws them from there. Twin of src/render/backend/cpu/geometry/clip.rs.
//
// Uses: common.wgsl (homogeneous, WORKGROUP), one_job.wgsl (batch), geometry/corners.wgsl (Corners,
// is_outside, screen_triangle, triangles), geometry/culling.wgsl (passes_culling),
// geometry/planes.wgsl (intersect, is_moderate, plane_distance, snap_clipped),
// geometry/triangle.wgsl (area_of, pixel_bounds, setup_of), geometry/work.wgsl (append_work_item),
// peeling/rounds.wgsl (is_peeling_done).

@group(1) @binding(0) var<storage, read> positions: array<f32>;

@compute @workgroup_size(WORKGROUP)
fn clip(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count || is_peeling_done() {
        return;
    }
    let t = batch.first + i;
    if !is_outside(screen_triangle(t)) {
        return;
    }
    corners[0] = homogeneous_corner(triangles[3u * t]);
    corners[1] = homogeneous_corner(triangles[3u * t + 1u]);
    corners[2] = homogeneous_corner(triangles[3u * t + 2u]);
    if !is_moderate(corners[0]) || !is_moderate(corners[1]) || !is_moderate(corners[2]) {
        return;
    }
    // Half of the array holds the polygon, the other half takes what a plane leaves of it.
    var len = 3u;
    for (var plane = 0u; plane < 5u; plane++) {
        len = cut(plane, len, CORNERS_MAX * (plane & 1u));
    }
    let first = snap_clipped(corners[CORNERS_MAX]);
    var before = snap_clipped(corners[CORNERS_MAX + 1u]);
    for (var k = 2u; k < len; k++) {
        let next = snap_clipped(corners[CORNERS_MAX + k]);
        draw_piece(Corners(first, before, next), t);
        before = next;
    }
}

// A triangle cut by five planes has at most eight corners.
const CORNERS_MAX: u32 = 8u;

var<private> corners: array<vec4<f32>, 2u * CORNERS_MAX>;

// Cuts the polygon at `base` by a plane; returns how many corners are left.
fn cut(plane: u32, len: u32, base: u32) -> u32 {
    let to = CORNERS_MAX - base;
    var left = 0u;
    if len == 0u {
        return 0u;
    }
    var a = corners[base];
    var d_a = plane_distance(plane, a);
    for (var i = 1u; i <= len; i++) {
        let b = corners[base + select(i, 0u, i == len)];
        let d_b = plane_distance(plane, b);
        if d_a >= 0.0 && left < CORNERS_MAX {
            corners[to + left] = a;
            left++;
        }
        if (d_a >= 0.0) != (d_b >= 0.0) && left < CORNERS_MAX {
            // Always from the inside to the outside: the neighbour across the edge gets the same
            // point, bit for bit.
            let from_a = d_a >= 0.0;
            corners[to + left] = intersect(select(b, a, from_a), select(a, b, from_a), max(d_a, d_b), min(d_a, d_b));
            left++;
        }
        a = b;
        d_a = d_b;
    }
    return left;
}

fn draw_piece(v: Corners, t: u32) {
    let bounds = pixel_bounds(vec3(v.a.x, v.b.x, v.c.x), vec3(v.a.y, v.b.y, v.c.y));
    let area = area_of(v.a, v.b, v.c);
    if bounds.x <= bounds.z && bounds.y <= bounds.w && passes_culling(t, area) {
        append_work_item(setup_of(v.a, v.b, v.c, area), bounds.zw - bounds.xy, t);
    }
}

fn homogeneous_corner(v: u32) -> vec4<f32> {
    return homogeneous(vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]));
}
