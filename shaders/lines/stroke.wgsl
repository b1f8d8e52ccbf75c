// The stroke of a piece of an edge in one pixel (stage lines): all that lies within half the line's width of the
// piece. The functions here find the area that it covers in the pixel, and which of the pixel's 256 coverage
// points. They add both to what other strokes cover there. Twin of src/render/backend/cpu/lines/stroke.rs.
//
// Uses: common.wgsl (rn, round_to_i32), one_job.wgsl (batch, frame), geometry/steepness.wgsl
// (MIN_POSITIVE), lines/edge.wgsl (strokes), lines/lattice.wgsl (lattice_points, product, UNIT,
// units), lines/stroke_words.wgsl (AREA_UNIT, AREA_WORD, CARRY_WORD, COUNT_WORD, MASK_WORD,
// MASK_WORDS, POINTS, SLACK_WORD, STROKE_WORDS).

// Farthest from the middle of a unit box to its corner.
const BOX_RADIUS: f32 = 0.70710678;

// Largest scaled area.
const LIMIT: f32 = 16000.0;

// A stroke relative to a pixel: the bounds that the pixel's points are compared with.
struct Stroke {
    // Unit vector along, in 1/16384.
    along: vec2<i32>,
    // Distance of the pixel's centre from the line, pixels.
    across: f32,
    // Bounds along.
    first: i32,
    last: i32,
    // True where the pixel reaches past the start, and past the end, whose discs then count.
    discs: vec2<bool>,
    // True if the strip touches the pixel.
    has_strip: bool,
    // From the ends to the pixel's centre, scaled.
    from_start: vec2<i32>,
    from_end: vec2<i32>,
    // Squares of their lengths, pixels.
    away: vec2<f32>,
};

// From the middle of the line to the farthest pixel's centre that it touches.
fn reach_of_line() -> f32 {
    return 0.5 * batch.line_width + 0.5 * batch.line_smoothing + BOX_RADIUS;
}

// Half the width where the line is as dense as a level, a share of its peak.
fn radius_at(level: u32) -> f32 {
    let half_width = 0.5 * batch.line_width;
    let half_ramp = 0.5 * batch.line_smoothing;
    let share = rn(((f32((level * 7u) % 16u) + 0.5) * 0.0625) * batch.line_peak);
    return rn(half_width + half_ramp) - rn(share * (2.0 * half_ramp));
}

// Position of a pixel's centre relative to a piece of an edge.
struct PixelDistances {
    // Distance from the line.
    across: f32,
    // Distances past the start and past the end.
    past: vec2<f32>,
    // Distance beyond either end; 0 between them.
    beyond: f32,
};

// `start` and `end` are the piece's, in pixels from the pixel's centre, `along` the edge's
// direction.
fn place_of(along: vec2<f32>, start: vec2<f32>, end: vec2<f32>) -> PixelDistances {
    let across = rn(along.y * start.x) - rn(along.x * start.y);
    let past_start = -(rn(along.x * start.x) + rn(along.y * start.y));
    let past_end = -(rn(along.x * end.x) + rn(along.y * end.y));
    return PixelDistances(across, vec2(past_start, past_end), max(max(-past_start, past_end), 0.0));
}

// True if a piece of an edge is within the line's reach of a pixel.
fn touches(place: PixelDistances) -> bool {
    let reach = reach_of_line();
    return rn(place.across * place.across) + rn(place.beyond * place.beyond) <= rn(reach * reach);
}

// Adds the stroke of a piece of an edge to a pixel that it touches. False if it covers nothing.
fn add_stroke(pixel_at: u32, along: vec2<f32>, start: vec2<f32>, end: vec2<f32>) -> bool {
    let reach = reach_of_line();
    let place = place_of(along, start, end);
    let across = place.across;
    let box_along = select(MIN_POSITIVE, 0.5 * (abs(along.x) + abs(along.y)), any(along != vec2(0.0)));
    var stroke: Stroke;
    stroke.along = vec2(round_to_i32(along.x * UNIT), round_to_i32(along.y * UNIT));
    stroke.across = across;
    let is_past_end = place.past.y > -box_along;
    let reaches = vec2(place.past.x < box_along, is_past_end);
    var area = 0.0;
    if !any(reaches) {
        area = strip_area(vec2(-along.y, along.x), abs(across));
        if area == 0.0 {
            return false;
        }
        stroke.first = -0x8000;
        stroke.last = 0x8000;
        stroke.has_strip = true;
    } else {
        stroke.first = units(-place.past.x);
        stroke.last = units(-place.past.y);
        // An edge that is a point has no sides, only the disc around it.
        stroke.has_strip = any(along != vec2(0.0)) && place.beyond < box_along;
        stroke.away = vec2(rn(start.x * start.x) + rn(start.y * start.y), rn(end.x * end.x) + rn(end.y * end.y));
        stroke.discs = reaches & (stroke.away <= vec2(rn(reach * reach)));
        stroke.from_start = scaled(select(vec2(0.0), start, stroke.discs.x));
        stroke.from_end = scaled(select(vec2(0.0), end, stroke.discs.y));
    }
    let at = pixel_at * STROKE_WORDS;
    var points = 0u;
    // frame.zero keeps compilers from unrolling the loop, which would take twice as long to run.
    for (var w = 0u; w < MASK_WORDS + frame.zero; w++) {
        var mask = 0u;
        for (var half = 0u; half < 2u + frame.zero; half++) {
            mask |= points_of(stroke, 2u * w + half) << (16u * half);
        }
        if mask != 0u {
            points += countOneBits(mask);
            atomicOr(&strokes[at + MASK_WORD + w], mask);
        }
    }
    if any(reaches) {
        if points == 0u {
            return false;
        }
        area = f32(points) * (batch.line_peak * (1.0 / 256.0));
    }
    let scaled_area = u32(area * AREA_UNIT + 0.5);
    let of_points = u32(rn(f32(points) * (batch.line_peak * 256.0)) + 0.5);
    atomicMax(&strokes[at + SLACK_WORD], max(scaled_area, of_points) - min(scaled_area, of_points));
    // A sum that has gone round is smaller than what was added.
    var rounds = 0u;
    if atomicAdd(&strokes[at + AREA_WORD], scaled_area) + scaled_area < scaled_area {
        rounds = 1u;
    }
    if atomicAdd(&strokes[at + COUNT_WORD], points) + points < points {
        rounds += 0x10000u;
    }
    if rounds > 0u {
        atomicAdd(&strokes[at + CARRY_WORD], rounds);
    }
    return true;
}

// True if all points of a pixel are covered, so that further strokes change nothing.
fn is_full(pixel_at: u32) -> bool {
    let pixel = pixel_at * STROKE_WORDS;
    let at = pixel + MASK_WORD;
    // One stroke may cover all points and yet leave a corner.
    if atomicLoad(&strokes[pixel + COUNT_WORD]) <= POINTS && atomicLoad(&strokes[pixel + CARRY_WORD]) < 0x10000u {
        return false;
    }
    // No loop: where loops are limited, the pixels found may be many.
    let first = atomicLoad(&strokes[at]) & atomicLoad(&strokes[at + 1u])
        & atomicLoad(&strokes[at + 2u]) & atomicLoad(&strokes[at + 3u]);
    if first != 0xFFFFFFFFu {
        return false;
    }
    let last = atomicLoad(&strokes[at + 4u]) & atomicLoad(&strokes[at + 5u])
        & atomicLoad(&strokes[at + 6u]) & atomicLoad(&strokes[at + 7u]);
    return last == 0xFFFFFFFFu;
}

fn square_unit() -> f32 {
    return f32(1u << batch.line_exponent);
}

fn scaled(end: vec2<f32>) -> vec2<i32> {
    return vec2(round_to_i32(-end.x * square_unit()), round_to_i32(-end.y * square_unit()));
}

fn limit_of(radius: f32, away: f32) -> i32 {
    return round_to_i32(clamp(rn(0.5 * (rn(radius * radius) - away)) * square_unit(), -LIMIT, LIMIT));
}

// The bounds that the sixteen points of a word of the mask are compared with: across, and for the
// discs.
struct Bounds {
    low: i32,
    high: i32,
    discs: vec2<i32>,
};

fn bounds_of(stroke: Stroke, word: u32) -> Bounds {
    var radius = 0.5 * batch.line_width;
    if batch.line_smoothing > 0.0 {
        radius = radius_at(word);
    }
    let discs = vec2(limit_of(radius, stroke.away.x), limit_of(radius, stroke.away.y));
    return Bounds(units(-radius - stroke.across), units(radius - stroke.across), discs);
}

// Points of a word that a stroke covers.
fn points_of(stroke: Stroke, word: u32) -> u32 {
    let bounds = bounds_of(stroke, word);
    return four_points(stroke, bounds, word, 0u) | four_points(stroke, bounds, word, 4u)
        | four_points(stroke, bounds, word, 8u) | four_points(stroke, bounds, word, 12u);
}

// Those of the points from bit `first` on.
fn four_points(stroke: Stroke, bounds: Bounds, word: u32, first: u32) -> u32 {
    let points = lattice_points(word, first);
    let x = points.x;
    let y = points.y;
    var covered = vec4(false);
    if stroke.has_strip {
        let across = ((-stroke.along.y * x) >> vec4(16u)) + ((stroke.along.x * y) >> vec4(16u));
        let along = ((stroke.along.x * x) >> vec4(16u)) + ((stroke.along.y * y) >> vec4(16u));
        covered = (across >= vec4(bounds.low)) & (across <= vec4(bounds.high))
            & (along >= vec4(stroke.first)) & (along <= vec4(stroke.last));
    }
    if any(stroke.discs) {
        let half_square = (((x * x) >> vec4(16u)) + ((y * y) >> vec4(16u))) >> vec4(17u - batch.line_exponent);
        if stroke.discs.x {
            covered = covered | (half_square + product(stroke.from_start, x, y) <= vec4(bounds.discs.x));
        }
        if stroke.discs.y {
            covered = covered | (half_square + product(stroke.from_end, x, y) <= vec4(bounds.discs.y));
        }
    }
    let bits = select(vec4(0u), vec4(1u, 2u, 4u, 8u), covered);
    return ((bits.x | bits.y) | (bits.z | bits.w)) << first;
}

// Distance of the outer places of Gauss's rule from the middle, as a share of half of the range.
const GAUSS_PLACE: f32 = 0.7745967;
// Weights of the outer places and of the middle.
const GAUSS_OUTER: f32 = 0.2777777777777778;
const GAUSS_MIDDLE: f32 = 0.4444444444444444;

// Coverage of a pixel's box by a strip whose middle is that far away: the integral over the strip's width of a trapezoid of
// area 1, made of the two widest of three boxes, and its mean in three places over the narrowest.
fn strip_area(normal: vec2<f32>, distance: f32) -> f32 {
    let n = abs(normal);
    let ramp = batch.line_smoothing;
    let half_width = 0.5 * batch.line_width;
    let widest = max(n.x, n.y);
    let other = min(n.x, n.y);
    let second = max(other, ramp);
    let shift = min(other, ramp) * (0.5 * GAUSS_PLACE);
    let foot = 0.5 * (widest + second);
    let top = 0.5 * abs(widest - second);
    let height = 1.0 / (foot + top);
    var flank = 0.0;
    if foot > top {
        flank = 0.5 * height / (foot - top);
    }
    if distance >= half_width + foot + shift {
        return 0.0;
    }
    let trapezoid = vec4(foot, top, height, flank);
    let middle = strip_at(trapezoid, half_width, distance);
    if shift == 0.0 {
        return clamp(middle, 0.0, 1.0);
    }
    let outer = strip_at(trapezoid, half_width, distance - shift) + strip_at(trapezoid, half_width, distance + shift);
    return clamp(GAUSS_OUTER * outer + GAUSS_MIDDLE * middle, 0.0, 1.0);
}

// The integral of a trapezoid (foot, top, height, flank) over a strip's width.
fn strip_at(trapezoid: vec4<f32>, half_width: f32, distance: f32) -> f32 {
    return half_integral(trapezoid, distance + half_width) - half_integral(trapezoid, distance - half_width);
}

// Integral of the trapezoid from its middle to u.
fn half_integral(trapezoid: vec4<f32>, u: f32) -> f32 {
    let a = min(abs(u), trapezoid.x);
    let past = max(a - trapezoid.y, 0.0);
    let half = trapezoid.z * a - trapezoid.w * past * past;
    return select(half, -half, u < 0.0);
}
