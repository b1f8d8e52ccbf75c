// The share of each visible triangle in a mixed pixel (stage mixed): at how many of the pixel's points it is
// visible, and the mean position of these points. Mixed pixels are drawn again, from 64 or 256 points each,
// because different colours meet there. A workgroup works on one pixel at a time. All points are gone through for
// each triangle; point_sets.wgsl is the quicker way for pixels of few triangles. Twin of
// src/render/backend/cpu/mixed/shares.rs.
//
// Uses: common.wgsl (recip, rn2, WORKGROUP), mixed/lattice.wgsl (FEW_FIRST, FEW_STEP, point_place,
// POINTS, Share), surface/material.wgsl (is_quartered).

// The triangle that each point sees, in words like those of samples; and which points are the first ones of their
// triangles, a bit each.
var<workgroup> seen: array<vec2<u32>, POINTS>;
var<workgroup> firsts: array<atomic<u32>, FIRSTS_WORDS>;

const FIRSTS_WORDS: u32 = POINTS / 32u;

// The first point of a thread, and the distance to its next.
fn own_points(thread: u32, is_few: bool) -> vec2<u32> {
    return select(vec2(thread, WORKGROUP), vec2(FEW_FIRST + FEW_STEP * thread, FEW_STEP * WORKGROUP), is_few);
}

// Finds the first point of each triangle, with all threads of the workgroup.
fn find_firsts(thread: u32, is_few: bool) {
    if thread < FIRSTS_WORDS {
        atomicStore(&firsts[thread], 0u);
    }
    workgroupBarrier();
    let own = own_points(thread, is_few);
    for (var p = own.x; p < POINTS; p += own.y) {
        if seen[p].y != 0u && is_first_of_all(p, select(1u, FEW_STEP, is_few)) {
            atomicOr(&firsts[p / 32u], 1u << (p % 32u));
        }
    }
    workgroupBarrier();
}

// True if no point before p sees its triangle. Where a triangle is shaded in each quarter of the
// pixel: no point of the same quarter.
fn is_first_of_all(p: u32, step: u32) -> bool {
    let is_divided = is_quartered(~seen[p].x);
    for (var q = p % step; q < p; q += step) {
        if seen[q].x == seen[p].x && seen[q].y != 0u && (!is_divided || are_in_one_quarter(p, q)) {
            return false;
        }
    }
    return true;
}

// True if p is the first point of a triangle, as found.
fn is_first(p: u32) -> bool {
    return ((atomicLoad(&firsts[p / 32u]) >> (p % 32u)) & 1u) != 0u;
}

// The number of triangles that have a first point.
fn first_count() -> u32 {
    return firsts_before(POINTS);
}

// The number of points before p that are the first ones of a triangle.
fn firsts_before(p: u32) -> u32 {
    var count = 0u;
    for (var w = 0u; w < p / 32u; w++) {
        count += countOneBits(atomicLoad(&firsts[w]));
    }
    if p < POINTS {
        count += countOneBits(atomicLoad(&firsts[p / 32u]) & ((1u << (p % 32u)) - 1u));
    }
    return count;
}

// The share of the triangle that p is the first point of, or its share in a quarter.
fn share_of(p: u32, is_few: bool) -> Share {
    let step = select(1u, FEW_STEP, is_few);
    let is_divided = is_quartered(~seen[p].x);
    var count = 0;
    var places = vec2(0);
    for (var q = p; q < POINTS; q += step) {
        if seen[q].x == seen[p].x && seen[q].y != 0u && (!is_divided || are_in_one_quarter(p, q)) {
            count++;
            places += 2 * point_place(q) + 1;
        }
    }
    return Share(f32(count) / f32(POINTS / step), rn2(vec2<f32>(places) * recip(f32(2 * count))));
}

// The depth of the triangle that p sees, at the first point that sees it.
fn depth_of_share(p: u32, step: u32) -> f32 {
    var q = p;
    if is_quartered(~seen[p].x) {
        q = p % step;
        while q < p && (seen[q].x != seen[p].x || seen[q].y == 0u) {
            q += step;
        }
    }
    return bitcast<f32>(seen[q].y);
}

fn are_in_one_quarter(p: u32, q: u32) -> bool {
    return all(point_place(p) >> vec2(7u) == point_place(q) >> vec2(7u));
}

// A word of the points that see something, for lines over the pixel; none if all do.
fn border_word(w: u32) -> u32 {
    var is_border = false;
    for (var p = 0u; p < POINTS; p++) {
        is_border |= seen[p].y == 0u;
    }
    var word = 0u;
    for (var bit = 0u; is_border && bit < 32u; bit++) {
        word |= select(0u, 1u, seen[16u * (bit % 16u) + 2u * w + bit / 16u].y != 0u) << bit;
    }
    return word;
}
