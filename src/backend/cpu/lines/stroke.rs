//! Stage lines, per stroke and pixel: the covered area and the covered points. Twin of
//! `shaders/lines/stroke.wgsl`.
//!
//! A stroke is all that lies within half the line's width of a piece of an edge. Its area in a
//! pixel is exact where only its sides cross the pixel: a strip under the box filter. Its position
//! is described by those of [`POINTS`] evenly spread points that it covers, found in integers, so
//! that both back-ends agree to the bit and strokes can be united ([`coverage`](super::coverage)).

use super::profile::Profile;
use crate::backend::cpu::geometry::transform::{round_to_i32, rsqrt};
use crate::backend::sample_partition;
use crate::backend::sample_partition::GENERATORS;
use crate::plan::LinePass;

/// Words of a mask: as many values of 16 bits as an AVX2 register has.
pub const WORDS: usize = 16;
/// Bits of a word.
const BITS: usize = 16;
/// Points in a pixel.
pub const POINTS: u32 = sample_partition::POINTS as u32;

/// Covered points of a pixel: bit `15 - j` of word l is point `16 j + l`.
pub type Mask = [u16; WORDS];

/// A number for each point: of bit j of word l, at `[j][l]`.
type PerPoint = [[i16; WORDS]; BITS];

/// Positions of the points, in 1/65536 px right of and below the pixel's middle.
static LATTICE: [PerPoint; 2] = [lattice(GENERATORS[0]), lattice(GENERATORS[1])];

/// Steps to the pixel in which along and across are measured.
pub const UNIT: f32 = 16_384.0;

/// Largest scaled area: two of them differ by less than 16 bits hold.
pub const LIMIT: f32 = LinePass::SCALED_MAX;

const fn lattice(generator: usize) -> PerPoint {
    let mut at = [[0; WORDS]; BITS];
    let mut i = 0;
    while i < POINTS as usize {
        at[i / WORDS][i % WORDS] = ((2 * (i * generator % POINTS as usize) as i32 + 1 - POINTS as i32) * 128) as i16;
        i += 1;
    }
    at
}

/// Parameters of all strokes of a line pass.
pub struct Pen {
    /// Half the width, pixels.
    half_width: f32,
    /// Half of the extra ramp, pixels.
    half_ramp: f32,
    /// From the middle of the line to the farthest pixel's centre that it touches, pixels.
    pub reach: f32,
    /// Coverage in the middle of a line, where only its ramp is wider than a pixel.
    pub peak: f32,
    /// Half the width at each of a ramp's levels, a word of the mask each.
    radius: [f32; WORDS],
    /// Scale of areas, so that the largest fits 16 bits.
    square_unit: f32,
    /// Half the square of each point's distance from the middle, scaled by it.
    half_square: PerPoint,
}

impl Pen {
    /// A pass's.
    pub fn new(lines: &LinePass) -> Self {
        let (half_width, half_ramp) = (0.5 * lines.width_px, 0.5 * lines.smoothing_px);
        let exponent = lines.square_exponent();
        let half_square = |j: usize, l: usize| {
            let square = |v: i16| (i32::from(v) * i32::from(v)) >> 16;
            ((square(LATTICE[0][j][l]) + square(LATTICE[1][j][l])) >> (17 - exponent)) as i16
        };
        Self {
            half_width,
            half_ramp,
            reach: lines.reach_px(),
            radius: std::array::from_fn(|l| radius(half_width, half_ramp, lines.peak(), l)),
            peak: lines.peak(),
            square_unit: (1 << exponent) as f32,
            half_square: std::array::from_fn(|j| std::array::from_fn(|l| half_square(j, l))),
        }
    }
}

/// Distance from the middle of a line within which the points of a level are covered.
///
/// Across a line, its coverage is a trapezoid: a box as wide as the line, filtered by a box as wide
/// as its ramp. A level's points are covered where the trapezoid is at least as high as the level.
/// So where two lines cross, the larger coverage remains. Levels are shares of the line's peak,
/// which is less than 1 where the ramp is wider than the line.
fn radius(half_width: f32, half_ramp: f32, peak: f32, level: usize) -> f32 {
    // Neighbouring words far apart in level.
    let level = ((((level * 7) % WORDS) as f32 + 0.5) * (1.0 / WORDS as f32)) * peak;
    (half_width + half_ramp) - level * (2.0 * half_ramp)
}

/// An edge's direction on screen, and every point's place in it.
pub struct Direction {
    /// Unit vector; zero for an edge that is a point, whose ends every pixel reaches past.
    along: [f32; 2],
    /// Places of the points across and along.
    across_at: PerPoint,
    along_at: PerPoint,
    profile: Profile,
    /// Extent of a pixel along the direction, from its middle.
    box_along: f32,
}

impl Direction {
    /// That of a vector, pixels.
    #[inline(always)]
    pub fn new(pen: &Pen, vector: [f32; 2]) -> Self {
        let squared = vector[0] * vector[0] + vector[1] * vector[1];
        let inverse = if squared > 0.0 { rsqrt(squared) } else { 0.0 };
        let along = [vector[0] * inverse, vector[1] * inverse];
        let across = [-along[1], along[0]];
        Self {
            along,
            across_at: places(across),
            along_at: places(along),
            profile: Profile::new(pen.half_width, pen.half_ramp, across),
            box_along: if squared > 0.0 { 0.5 * (along[0].abs() + along[1].abs()) } else { f32::MIN_POSITIVE },
        }
    }
}

#[inline(always)]
fn places(direction: [f32; 2]) -> PerPoint {
    let (x, y) = (round_to_i32(direction[0] * UNIT) as i16, round_to_i32(direction[1] * UNIT) as i16);
    let mut places = [[0; WORDS]; BITS];
    for j in 0..BITS {
        let (right, down, place) = (&LATTICE[0][j], &LATTICE[1][j], &mut places[j]);
        for l in 0..WORDS {
            place[l] = high(x, right[l]) + high(y, down[l]);
        }
    }
    places
}

/// The upper half of a product.
#[inline(always)]
fn high(a: i16, b: i16) -> i16 {
    ((i32::from(a) * i32::from(b)) >> 16) as i16
}

/// Area (0 to 1) and mask of a piece of an edge in a pixel. `ends` are the piece's, in pixels from
/// the pixel's centre.
#[inline(always)]
pub fn cover(pen: &Pen, direction: &Direction, ends: [[f32; 2]; 2]) -> Option<(f32, Mask)> {
    let [start, end] = ends;
    // Distances of the pixel's centre: from the line, past the start and past the end.
    let across = direction.along[1] * start[0] - direction.along[0] * start[1];
    let past = |p: [f32; 2]| -(direction.along[0] * p[0] + direction.along[1] * p[1]);
    let (past_start, past_end) = (past(start), past(end));
    let beyond = (-past_start).max(past_end).max(0.0);
    if across * across + beyond * beyond > pen.reach * pen.reach {
        return None;
    }
    // Does the pixel reach past the start, and past the end?
    let reaches = [past_start < direction.box_along, past_end > -direction.box_along];
    let mut mask = [0; WORDS];
    if reaches == [false; 2] {
        let area = direction.profile.coverage(across.abs());
        if area == 0.0 {
            return None;
        }
        strip(pen, direction, across, [past_start, past_end], true, &mut mask);
        return Some((area, mask));
    }
    // An edge that is a point has no sides, only the disc around it.
    if direction.along != [0.0; 2] && beyond < direction.box_along {
        strip(pen, direction, across, [past_start, past_end], false, &mut mask);
    }
    if reaches[0] {
        disc(pen, start, &mut mask);
    }
    if reaches[1] {
        disc(pen, end, &mut mask);
    }
    let count = count(&mask);
    (count > 0).then_some((count as f32 * (pen.peak * (1.0 / POINTS as f32)), mask))
}

/// Points of a mask.
#[inline(always)]
pub fn count(mask: &Mask) -> u32 {
    // Four words at a time: the compiler counts no shorter ones faster.
    let four = |k: usize| (0..4).fold(0_u64, |all, i| all << 16 | u64::from(mask[4 * k + i]));
    (four(0).count_ones() + four(1).count_ones()) + (four(2).count_ones() + four(3).count_ones())
}

#[inline(always)]
fn strip(pen: &Pen, direction: &Direction, across: f32, past: [f32; 2], is_endless: bool, mask: &mut Mask) {
    let units = |v: f32| round_to_i32(v.clamp(-1.0, 1.0) * UNIT) as i16;
    let (mut low, mut high) = ([0; WORDS], [0; WORDS]);
    if pen.half_ramp == 0.0 {
        (low, high) = ([units(-pen.half_width - across); WORDS], [units(pen.half_width - across); WORDS]);
    } else {
        for l in 0..WORDS {
            let r = pen.radius[l];
            (low[l], high[l]) = (units(-r - across), units(r - across));
        }
    }
    let mut outside = [0; WORDS];
    if is_endless {
        for places in &direction.across_at {
            let mut sign = [0; WORDS];
            for l in 0..WORDS {
                sign[l] = (places[l] - low[l]) | (high[l] - places[l]);
            }
            push_signs(&mut outside, &sign);
        }
    } else {
        let (first, last) = (units(-past[0]), units(-past[1]));
        for (places, ways) in direction.across_at.iter().zip(&direction.along_at) {
            let mut sign = [0; WORDS];
            for l in 0..WORDS {
                sign[l] = (places[l] - low[l]) | (high[l] - places[l]) | (ways[l] - first) | (last - ways[l]);
            }
            push_signs(&mut outside, &sign);
        }
    }
    for l in 0..WORDS {
        mask[l] |= !outside[l];
    }
}

/// Moves words up by a bit, and puts the signs of `of` below. A loop of nothing else is what
/// compilers make vectors of.
#[inline(always)]
fn push_signs(words: &mut [u16; WORDS], of: &[i16; WORDS]) {
    for l in 0..WORDS {
        words[l] = words[l] << 1 | (of[l] as u16) >> 15;
    }
}

/// Adds the points around the end of a piece, which lies at `end` from the pixel's centre.
#[inline(always)]
fn disc(pen: &Pen, end: [f32; 2], mask: &mut Mask) {
    let away = end[0] * end[0] + end[1] * end[1];
    if away > pen.reach * pen.reach {
        return;
    }
    // |p - end|^2 <= r^2, halved: |p|^2 / 2 - p . end <= (r^2 - |end|^2) / 2.
    let limit = |r: f32| round_to_i32(((0.5 * (r * r - away)) * pen.square_unit).clamp(-LIMIT, LIMIT)) as i16;
    let mut limits = [limit(pen.half_width); WORDS];
    if pen.half_ramp > 0.0 {
        for l in 0..WORDS {
            limits[l] = limit(pen.radius[l]);
        }
    }
    let (x, y) = (round_to_i32(-end[0] * pen.square_unit) as i16, round_to_i32(-end[1] * pen.square_unit) as i16);
    let mut outside = [0; WORDS];
    for j in 0..BITS {
        let (right, down, half_square) = (&LATTICE[0][j], &LATTICE[1][j], &pen.half_square[j]);
        let mut sign = [0; WORDS];
        for l in 0..WORDS {
            sign[l] = limits[l] - half_square[l] - high(x, right[l]) - high(y, down[l]);
        }
        push_signs(&mut outside, &sign);
    }
    for l in 0..WORDS {
        mask[l] |= !outside[l];
    }
}
