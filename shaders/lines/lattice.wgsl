// The 256 points of a pixel at which it is tested what a line covers (stage lines), a rank-1 lattice in units of
// 1/65536 px that is computed rather than stored. Also the unit, 1/16384 px, in which a point's distances along
// and across a line are compared with the line's borders. The CPU has the points as a table, LATTICE in
// src/render/backend/cpu/lines/stroke.rs, so this file has no twin.
//
// Uses: common.wgsl (round_to_i32), lines/stroke_words.wgsl (GENERATOR, POINTS).

// Steps to the pixel in which along and across are measured.
const UNIT: f32 = 16384.0;

// A distance from a pixel's centre, in these steps. Beyond a pixel away, all points are on one side.
fn units(v: f32) -> i32 {
    return round_to_i32(clamp(v, -1.0, 1.0) * UNIT);
}

// Points right of and below the pixel's middle, 1/65536 px.
struct LatticePoints {
    x: vec4<i32>,
    y: vec4<i32>,
};

// Four points of a word of a mask, from bit `first` on. Bit j of word l is point 16 j + l. Where a
// point lies: i steps to the right, 181 i down.
fn lattice_points(word: u32, first: u32) -> LatticePoints {
    let i = 16u * (vec4(first) + vec4(0u, 1u, 2u, 3u)) + word;
    let x = (2 * vec4<i32>(i) - 255) * 128;
    let y = (2 * vec4<i32>((GENERATOR * i) & vec4(POINTS - 1u)) - 255) * 128;
    return LatticePoints(x, y);
}

// Points' places along a vector.
fn product(v: vec2<i32>, x: vec4<i32>, y: vec4<i32>) -> vec4<i32> {
    return ((v.x * x) >> vec4(16u)) + ((v.y * y) >> vec4(16u));
}
