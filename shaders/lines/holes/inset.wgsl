// The inset of a face (stage lines): the part of the face that the lines along its sides leave free, because it is
// at least half a line's width from all three sides. Also the area of an inset in a pixel. Twin of
// src/render/backend/cpu/lines/holes/inset/mod.rs.
//
// Uses: common.wgsl (recip, rn, rn2, rn3, rsqrt), one_job.wgsl (batch, frame),
// lines/stroke_words.wgsl (HOLE_UNIT).

// Distance from a face's sides from which a sample counts as inside, 1/256 px.
const INSIDE: f32 = 16.0;

// Sides of an inset that are narrower than this add no area, pixels.
const NARROW_PX: f32 = 1e-4;

// Sides that rise less than this within a pixel count as straight there, pixels.
const LEVEL_PX: f32 = 0.0009765625;

// A side of a face, from a corner to the next, and of its inset.
struct InsetSide {
    // The face's corner, 1/256 px from the picture's centre.
    corner: vec2<f32>,
    // Unit vector along, turned so that the inside lies on the same hand for all faces.
    unit: vec2<f32>,
    // Start of the inset's side, pixels from the base; the end's column.
    start: vec2<f32>,
    end_x: f32,
    slope: f32,
};

struct Inset {
    // Pixel of the first corner.
    base: vec2<i32>,
    sides: array<InsetSide, 3>,
    // 1 or -1: the hand of the face.
    turn: f32,
    is_open: bool,
};

// The inset of a face with these corners, in 1/256 px from the picture's centre.
fn inset_of(a: vec2<i32>, b: vec2<i32>, c: vec2<i32>) -> Inset {
    let half = vec2(frame.width, frame.height) * 128;
    let half_width = batch.line_width * 128.0;
    let ab = vec2<f32>(b - a);
    let bc = vec2<f32>(c - b);
    let ca = vec2<f32>(a - c);
    let inverse = vec3(inverse_length(ab), inverse_length(bc), inverse_length(ca));
    let length = rn3(vec3(squared_length(ab), squared_length(bc), squared_length(ca)) * inverse);
    let area = rn(ab.x * bc.y) - rn(ab.y * bc.x);
    let inverse_around = recip(rn(length.x + length.y) + length.z);
    let radius = rn(abs(area) * inverse_around);
    let is_open = radius > half_width;
    let turn = select(1.0, -1.0, area < 0.0);
    let share = 1.0 - rn(half_width * recip(select(1.0, radius, is_open)));
    // From the first corner. The weight of a corner is the length of the side facing it.
    let centre = rn2(rn2(rn2(length.z * ab) + rn2(length.x * -ca)) * inverse_around);
    let corner = vec2<f32>((a + half) & vec2(255));
    let p = inset_corner(vec2(0.0), centre, share, corner);
    let q = inset_corner(ab, centre, share, corner);
    let r = inset_corner(-ca, centre, share, corner);
    return Inset(
        (a + half) >> vec2(8u),
        array<InsetSide, 3>(
            side_of_inset(a, ab, inverse.x * turn, p, q),
            side_of_inset(b, bc, inverse.y * turn, q, r),
            side_of_inset(c, ca, inverse.z * turn, r, p),
        ),
        turn,
        is_open,
    );
}

fn squared_length(v: vec2<f32>) -> f32 {
    return max(rn(v.x * v.x) + rn(v.y * v.y), 1.0);
}

fn inverse_length(v: vec2<f32>) -> f32 {
    return rsqrt(squared_length(v));
}

fn inset_corner(from_first: vec2<f32>, centre: vec2<f32>, share: f32, corner: vec2<f32>) -> vec2<f32> {
    let at = centre + rn2((from_first - centre) * share);
    return rn2((at + corner) * (1.0 / 256.0));
}

fn side_of_inset(corner: vec2<i32>, along: vec2<f32>, inverse: f32, start: vec2<f32>, end: vec2<f32>) -> InsetSide {
    let way = end - start;
    let is_narrow = abs(way.x) < NARROW_PX;
    let steep = rn(way.y * recip(select(abs(way.x), 1.0, is_narrow)));
    let slope = select(select(steep, -steep, way.x < 0.0), 0.0, is_narrow);
    return InsetSide(vec2<f32>(corner), rn2(along * inverse), start, end.x, slope);
}

// True if a sample, in 1/256 px from the picture's centre, lies well inside the face.
fn inset_contains(inset: Inset, at: vec2<f32>) -> bool {
    var is_inside = true;
    for (var k = 0u; k < 3u; k++) {
        let side = inset.sides[k];
        let from_corner = at - side.corner;
        is_inside = is_inside && rn(side.unit.x * from_corner.y) - rn(side.unit.y * from_corner.x) >= INSIDE;
    }
    return is_inside;
}

// Area of the inset in a pixel: the sum, over its sides, of the signed area that lies inside the
// pixel between the side and the pixel's upper border.
fn inset_area(inset: Inset, pixel: vec2<i32>) -> u32 {
    let corner = vec2<f32>(pixel - inset.base);
    var area = 0.0;
    for (var k = 0u; k < 3u; k++) {
        let side = inset.sides[k];
        let y = side.start.y - corner.y;
        let start = side.start.x - corner.x;
        let left = clamp(start, 0.0, 1.0);
        let right = clamp(side.end_x - corner.x, 0.0, 1.0);
        let first = y + rn((left - start) * side.slope);
        let last = y + rn((right - start) * side.slope);
        area -= rn((right - left) * mean_clamped(first, last));
    }
    return u32(rn(clamp(rn(area * inset.turn), 0.0, 1.0) * HOLE_UNIT) + 0.5);
}

// Mean of what grows evenly from a to b, clamped to 0 to 1.
fn mean_clamped(a: f32, b: f32) -> f32 {
    let low = clamp(a, 0.0, 1.0);
    let high = clamp(b, 0.0, 1.0);
    let rise = b - a;
    if abs(rise) <= LEVEL_PX {
        return rn(0.5 * (low + high));
    }
    // The integral of the clamped function.
    let before = rn(rn(0.5 * low) * low) + max(a - 1.0, 0.0);
    let after = rn(rn(0.5 * high) * high) + max(b - 1.0, 0.0);
    // Between the clamped ends, however the difference of the integrals was rounded.
    return clamp((after - before) / rise, min(low, high), max(low, high));
}
