// The points at which each triangle of a mixed pixel is visible, as sets with a bit per point (stage mixed). Mixed
// pixels are drawn again, from 64 or 256 points each, because different colours meet there. Counting bits gives
// the triangle's share of the points, and their mean position. A workgroup works on one pixel at a time. Twin of
// src/render/backend/cpu/mixed/points.rs.
//
// Workgroup memory has room for one set per thread. For pixels with more triangles, and in pictures whose
// triangles may be clipped, shares.wgsl is used, which goes through all points.
//
// Uses: common.wgsl (recip, rn2, WORKGROUP), mixed/lattice.wgsl (FEW_STEP, point_place, POINTS,
// Share), mixed/shares.wgsl (firsts, FIRSTS_WORDS, seen), surface/material.wgsl (is_quartered).

// By item of the pixel's list: the points that see it, a bit each.
var<workgroup> sets: array<atomic<u32>, SETS_WORDS>;
// By binary digit of rows: the points whose row has it.
var<workgroup> digit_sets: array<u32, DIGIT_WORDS>;

const SETS_WORDS: u32 = WORKGROUP * FIRSTS_WORDS;
const DIGIT_WORDS: u32 = 8u * FIRSTS_WORDS;

// Quarters of a pixel have numbers: 0 and 1 above, left and right; 2 and 3 below. This one means all of
// the pixel.
const WHOLE: u32 = 4u;

// Finds the points whose rows have each digit: a word by each thread.
fn find_digit_sets(thread: u32) {
    var word = 0u;
    for (var bit = 0u; bit < 32u; bit++) {
        let row = u32(point_place(32u * (thread % FIRSTS_WORDS) + bit).y);
        word |= ((row >> (thread / FIRSTS_WORDS)) & 1u) << bit;
    }
    digit_sets[thread] = word;
}

// Empties all sets, with all threads of the workgroup.
fn clear_sets(thread: u32) {
    for (var w = thread; w < SETS_WORDS; w += WORKGROUP) {
        atomicStore(&sets[w], 0u);
    }
    if thread < FIRSTS_WORDS {
        atomicStore(&firsts[thread], 0u);
    }
}

// Puts the points of a thread into the sets of the items that they see.
fn add_points(items: vec4<u32>, own: vec2<u32>) {
    add_point(items.x, own.x);
    if own.y == WORKGROUP {
        add_point(items.y, own.x + WORKGROUP);
        add_point(items.z, own.x + 2u * WORKGROUP);
        add_point(items.w, own.x + 3u * WORKGROUP);
    }
}

fn add_point(item: u32, p: u32) {
    if seen[p].y != 0u {
        atomicOr(&sets[item * FIRSTS_WORDS + p / 32u], 1u << (p % 32u));
    }
}

// A word of an item's set in a quarter. Columns are the numbers of points.
fn set_word(item: u32, w: u32, quarter: u32) -> u32 {
    let word = atomicLoad(&sets[item * FIRSTS_WORDS + w]);
    if quarter == WHOLE {
        return word;
    }
    let lower = digit_sets[7u * FIRSTS_WORDS + w];
    let is_right = w >= FIRSTS_WORDS / 2u;
    return select(0u, word & select(~lower, lower, quarter >= 2u), is_right == ((quarter & 1u) != 0u));
}

// The first and the last number of the quarters in which an item is shaded; both WHOLE where it is shaded once.
fn quarters_of_set(item: u32) -> vec2<u32> {
    let p = first_of_set(item, WHOLE);
    if p < POINTS && is_quartered(~seen[p].x) {
        return vec2(0u, WHOLE - 1u);
    }
    return vec2(WHOLE);
}

// The lowest point of an item's set in a quarter; POINTS if there is none.
fn first_of_set(item: u32, quarter: u32) -> u32 {
    for (var w = 0u; w < FIRSTS_WORDS; w++) {
        let word = set_word(item, w, quarter);
        if word != 0u {
            return 32u * w + firstTrailingBit(word);
        }
    }
    return POINTS;
}

// Notes the first point of each item, or of each of its quarters: an item by each thread.
fn find_firsts_of_sets(thread: u32, length: u32) {
    if thread < length {
        let quarters = quarters_of_set(thread);
        for (var q = quarters.x; q <= quarters.y; q++) {
            let p = first_of_set(thread, q);
            if p < POINTS {
                atomicOr(&firsts[p / 32u], 1u << (p % 32u));
            }
        }
    }
}

// The share of an item's points in a quarter.
fn share_of_set(item: u32, quarter: u32, is_few: bool) -> Share {
    var count = 0u;
    var sums = vec2(0u);
    for (var w = 0u; w < FIRSTS_WORDS; w++) {
        let word = set_word(item, w, quarter);
        let in_word = countOneBits(word);
        count += in_word;
        // Columns are the numbers of points.
        sums.x += 32u * w * in_word + countOneBits(word & 0xAAAAAAAAu) + 2u * countOneBits(word & 0xCCCCCCCCu)
            + 4u * countOneBits(word & 0xF0F0F0F0u) + 8u * countOneBits(word & 0xFF00FF00u)
            + 16u * countOneBits(word & 0xFFFF0000u);
        for (var digit = 0u; digit < 8u; digit++) {
            sums.y += countOneBits(word & digit_sets[digit * FIRSTS_WORDS + w]) << digit;
        }
    }
    let all = POINTS / select(1u, FEW_STEP, is_few);
    return Share(f32(count) / f32(all), rn2(vec2<f32>(2u * sums + count) * recip(f32(2u * count))));
}
