//! The part of a pixel that a stroke covers, as an area and as a mask of points (stage lines). Twin
//! of `shaders/lines/stroke.wgsl`.
//!
//! A stroke is all that lies within half the line's width of a piece of an edge. Where only its two
//! long sides cross the pixel, its area follows from a formula for strips (`profile`). Elsewhere
//! the number of covered points gives its area. The mask tells which of the pixel's [`POINTS`]
//! points, a rank-1 lattice, the stroke covers. It is found in integers, so that both back-ends
//! agree to the bit. If lines have a soft ramp (`smoothing`), each word of the mask has a width of
//! its own. [`coverage`](super::coverage) needs the mask to unite strokes that overlap.

use super::profile::Profile;
use crate::backend::cpu::geometry::transform::{round_to_i32, rsqrt};
use crate::backend::cpu::isa::{Isa, LANES, dispatch};
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
pub type PerPoint = [[i16; WORDS]; BITS];

/// Positions of the points, in 1/65536 px right of and below the pixel's middle.
pub(super) static LATTICE: [PerPoint; 2] = [lattice(GENERATORS[0]), lattice(GENERATORS[1])];

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
    isa: Isa,
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
    pub fn new(isa: Isa, lines: &LinePass) -> Self {
        let (half_width, half_ramp) = (0.5 * lines.width_px, 0.5 * lines.smoothing_px);
        let exponent = lines.square_exponent();
        let half_square = |j: usize, l: usize| {
            let square = |v: i16| (i32::from(v) * i32::from(v)) >> 16;
            ((square(LATTICE[0][j][l]) + square(LATTICE[1][j][l])) >> (17 - exponent)) as i16
        };
        Self {
            isa,
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
    /// None yet.
    pub fn new() -> Self {
        let nothing = [[0; WORDS]; BITS];
        let profile = Profile::new(0.0, 0.0, [1.0, 0.0]);
        Self { along: [0.0; 2], across_at: nothing, along_at: nothing, profile, box_along: 0.0 }
    }

    /// Becomes that of a vector, pixels.
    #[inline(always)]
    pub fn set(&mut self, pen: &Pen, vector: [f32; 2]) {
        let squared = vector[0] * vector[0] + vector[1] * vector[1];
        let inverse = if squared > 0.0 { rsqrt(squared) } else { 0.0 };
        let along = [vector[0] * inverse, vector[1] * inverse];
        let across = [-along[1], along[0]];
        self.along = along;
        find_places(pen.isa, units_of(across), &mut self.across_at);
        find_places(pen.isa, units_of(along), &mut self.along_at);
        self.profile = Profile::new(pen.half_width, pen.half_ramp, across);
        self.box_along = if squared > 0.0 { 0.5 * (along[0].abs() + along[1].abs()) } else { f32::MIN_POSITIVE };
    }

    /// The place of a pixel beside a piece with this direction. The piece's ends are given from the
    /// pixel's centre.
    #[inline(always)]
    pub fn place(&self, ends: [[f32; 2]; 2]) -> PixelDistances {
        PixelDistances::new(self.along, ends)
    }
}

/// A distance from a pixel's centre, in [`UNIT`]s. Beyond a pixel away, all points are on one side.
#[inline(always)]
pub fn units(px: f32) -> i16 {
    round_to_i32(px.clamp(-1.0, 1.0) * UNIT) as i16
}

/// A unit vector, in [`UNIT`]s.
#[inline(always)]
pub fn units_of(direction: [f32; 2]) -> [i16; 2] {
    direction.map(|v| round_to_i32(v * UNIT) as i16)
}

dispatch! {
    /// Every point's place in a direction.
    pub fn find_places(direction: [i16; 2], places: &mut PerPoint) = places_kernel
}

#[inline(always)]
pub(super) fn places_kernel([x, y]: [i16; 2], places: &mut PerPoint) {
    for ((right, down), places) in LATTICE[0].iter().zip(&LATTICE[1]).zip(places) {
        // Complete before it is stored: else the compiler has to assume that a store may change the direction.
        let mut row = [0; WORDS];
        for l in 0..WORDS {
            row[l] = place([x, y], [right[l], down[l]]);
        }
        *places = row;
    }
}

/// The place of a point in a direction.
#[inline(always)]
pub(super) fn place(direction: [i16; 2], point: [i16; 2]) -> i16 {
    high(direction[0], point[0]).wrapping_add(high(direction[1], point[1]))
}

/// The upper half of a product. Sums of these do not overflow; they are written as wrapping ones,
/// because the checks of debug builds would keep the loops from being vectors.
#[inline(always)]
fn high(a: i16, b: i16) -> i16 {
    ((i32::from(a) * i32::from(b)) >> 16) as i16
}

/// The part of a pixel that a stroke covers, as an area and as points.
#[derive(Clone, Copy)]
pub struct Amount {
    /// The area, 0 to 1.
    pub area: f32,
    /// The number of points.
    pub points: u32,
}

/// The places of eight pixels of a row beside a piece of an edge, in pixels.
pub struct Places {
    /// Distances of the pixels' centres from the line, past the piece's start, and past its end.
    across: [f32; LANES],
    past: [[f32; LANES]; 2],
}

impl Places {
    /// `[start, end]` are the piece's, and `first` is the centre of the first pixel.
    #[inline(always)]
    pub fn new(direction: &Direction, [start, end]: [[f32; 2]; 2], first: [f32; 2]) -> Self {
        let (mut across, mut past) = ([0.0; LANES], [[0.0; LANES]; 2]);
        for l in 0..LANES {
            let x = first[0] + l as f32;
            let from = |p: [f32; 2]| [p[0] - x, p[1] - first[1]];
            let place = direction.place([from(start), from(end)]);
            (across[l], past[0][l], past[1][l]) = (place.across, place.past[0], place.past[1]);
        }
        Self { across, past }
    }

    /// Bits of the pixels that are no farther from the piece than this.
    #[inline(always)]
    pub fn within(&self, reach: f32) -> u32 {
        let mut is_within = [0_u32; LANES];
        for l in 0..LANES {
            is_within[l] = u32::from(self.of(l).is_within(reach)) << l;
        }
        is_within.iter().fold(0, |all, bit| all | bit)
    }

    /// Pixel l's.
    #[inline(always)]
    pub fn of(&self, l: usize) -> PixelDistances {
        PixelDistances { across: self.across[l], past: [self.past[0][l], self.past[1][l]] }
    }
}

/// Distances of a pixel's centre: from the line, past the piece's start and past its end.
#[derive(Clone, Copy)]
pub struct PixelDistances {
    across: f32,
    past: [f32; 2],
}

impl PixelDistances {
    /// The place of a pixel beside a piece of an edge that runs along a unit vector. The piece's ends
    /// are given from the pixel's centre.
    #[inline(always)]
    pub fn new(along: [f32; 2], [start, end]: [[f32; 2]; 2]) -> Self {
        let past = |p: [f32; 2]| -(along[0] * p[0] + along[1] * p[1]);
        let across = along[1] * start[0] - along[0] * start[1];
        Self { across, past: [past(start), past(end)] }
    }

    /// Distance past the piece's start, pixels.
    #[inline(always)]
    pub fn past_start(&self) -> f32 {
        self.past[0]
    }

    /// Distance past the nearer end.
    #[inline(always)]
    fn beyond(&self) -> f32 {
        (-self.past[0]).max(self.past[1]).max(0.0)
    }

    /// False if the pixel is farther from the piece than a line reaches.
    #[inline(always)]
    pub fn is_within(&self, reach: f32) -> bool {
        let beyond = self.beyond();
        self.across * self.across + beyond * beyond <= reach * reach
    }
}

/// The part of a pixel that a piece of an edge covers. The pixel lies within the piece's reach;
/// `ends` are the piece's, in pixels from the pixel's centre. `mask`, which is empty, gets the
/// covered points.
#[inline(always)]
pub fn cover(
    pen: &Pen,
    direction: &Direction,
    ends: [[f32; 2]; 2],
    place: &PixelDistances,
    mask: &mut Mask,
) -> Option<Amount> {
    // Does the pixel reach past the start, and past the end?
    let reaches = [place.past[0] < direction.box_along, place.past[1] > -direction.box_along];
    if reaches == [false; 2] {
        let area = direction.profile.coverage(place.across.abs());
        if area == 0.0 {
            return None;
        }
        strip(pen, direction, place.across, place.past, true, mask);
        return Some(Amount { area, points: count(mask) });
    }
    // An edge that is a point has no sides, only the disc around it.
    if direction.along != [0.0; 2] && place.beyond() < direction.box_along {
        strip(pen, direction, place.across, place.past, false, mask);
    }
    if reaches[0] {
        disc(pen, ends[0], mask);
    }
    if reaches[1] {
        disc(pen, ends[1], mask);
    }
    let points = count(mask);
    (points > 0).then_some(Amount { area: points as f32 * (pen.peak * (1.0 / POINTS as f32)), points })
}

/// The points that lie at least `least` along `normal`, a unit vector, from the pixel's centre: both in
/// [`UNIT`]s.
#[derive(Clone, Copy, Default)]
pub struct HalfPlane {
    pub normal: [i16; 2],
    pub least: i16,
}

/// The points that lie in three half planes.
#[inline(always)]
pub fn points_within(sides: &[HalfPlane; 3]) -> Mask {
    let mut outside = [0; WORDS];
    for (right, down) in LATTICE[0].iter().zip(&LATTICE[1]) {
        for l in 0..WORDS {
            let mut is_outside = false;
            for side in sides {
                is_outside |= place(side.normal, [right[l], down[l]]) < side.least;
            }
            push(&mut outside[l], is_outside);
        }
    }
    outside.map(|word| !word)
}

/// True if a point, by its number, lies in a half plane.
pub fn is_point_within(side: &HalfPlane, point: usize) -> bool {
    let (j, l) = (point / WORDS, point % WORDS);
    place(side.normal, [LATTICE[0][j][l], LATTICE[1][j][l]]) >= side.least
}

/// Points of a mask.
#[inline(always)]
pub fn count(mask: &Mask) -> u32 {
    // Four words at a time: the compiler counts no shorter ones faster.
    let four: [u64; WORDS / 4] = bytemuck::cast(*mask);
    (four[0].count_ones() + four[1].count_ones()) + (four[2].count_ones() + four[3].count_ones())
}

#[inline(always)]
fn strip(pen: &Pen, direction: &Direction, across: f32, past: [f32; 2], is_endless: bool, mask: &mut Mask) {
    let (mut low, mut high) = ([0; WORDS], [0; WORDS]);
    if pen.half_ramp == 0.0 {
        (low, high) = ([units(-pen.half_width - across); WORDS], [units(pen.half_width - across); WORDS]);
    } else {
        for l in 0..WORDS {
            let r = pen.radius[l];
            (low[l], high[l]) = (units(-r - across), units(r - across));
        }
    }
    let across = Range::new(&low, &high);
    if is_endless {
        add_strip(pen.isa, &direction.across_at, &across, mask);
        return;
    }
    let (first, last) = (units(-past[0]), units(-past[1]));
    if first <= last {
        let along = Range::new(&[first; WORDS], &[last; WORDS]);
        add_rectangle(pen.isa, [&direction.across_at, &direction.along_at], [&across, &along], mask);
    }
}

dispatch! {
    /// Adds the points whose places lie in a range.
    pub fn add_strip(places: &PerPoint, range: &Range, mask: &mut Mask) = strip_kernel
}

dispatch! {
    /// Adds the points whose places of both kinds lie in their ranges.
    pub fn add_rectangle(places: [&PerPoint; 2], ranges: [&Range; 2], mask: &mut Mask) = rectangle_kernel
}

dispatch! {
    /// Adds the points of a disc.
    pub fn add_disc(half_square: &PerPoint, disc: &Disc, mask: &mut Mask) = disc_kernel
}

#[inline(always)]
fn strip_kernel(places: &PerPoint, range: &Range, mask: &mut Mask) {
    let mut outside = [0; WORDS];
    for places in places {
        for l in 0..WORDS {
            push(&mut outside[l], range.excludes(l, places[l]));
        }
    }
    for l in 0..WORDS {
        mask[l] |= !outside[l];
    }
}

#[inline(always)]
fn rectangle_kernel([across, along]: [&PerPoint; 2], ranges: [&Range; 2], mask: &mut Mask) {
    let mut outside = [0; WORDS];
    for (across, along) in across.iter().zip(along) {
        for l in 0..WORDS {
            push(&mut outside[l], ranges[0].excludes(l, across[l]) | ranges[1].excludes(l, along[l]));
        }
    }
    for l in 0..WORDS {
        mask[l] |= !outside[l];
    }
}

#[inline(always)]
fn disc_kernel(half_square: &PerPoint, disc: &Disc, mask: &mut Mask) {
    // In steps of four, which compilers unroll.
    const STEP: usize = 4;
    let mut outside = [0; WORDS];
    for first in 0..BITS / STEP {
        for j in STEP * first..STEP * first + STEP {
            let (right, down) = (&LATTICE[0][j], &LATTICE[1][j]);
            let mut at = [0_i16; WORDS];
            for l in 0..WORDS {
                at[l] = high(disc.x, right[l]).wrapping_add(high(disc.y, down[l])).wrapping_add(half_square[j][l]);
            }
            for l in 0..WORDS {
                push(&mut outside[l], at[l] > disc.limits[l]);
            }
        }
    }
    for l in 0..WORDS {
        mask[l] |= !outside[l];
    }
}

/// A disc around the end of a piece.
pub struct Disc {
    /// From the end to the pixel's centre, scaled.
    x: i16,
    y: i16,
    /// For each word, the largest `|p|^2 / 2 - p . end` of a point p inside.
    limits: [i16; WORDS],
}

/// A range of places for each word, from a first to a last that is not less.
pub struct Range {
    /// An offset that moves the first place to the least number, and the last place after that
    /// move. One comparison then finds what is outside, because places below the first wrap around.
    shift: [i16; WORDS],
    last: [i16; WORDS],
}

impl Range {
    #[inline(always)]
    fn new(first: &[i16; WORDS], last: &[i16; WORDS]) -> Self {
        let (mut shift, mut moved) = ([0; WORDS], [0; WORDS]);
        for l in 0..WORDS {
            shift[l] = i16::MIN.wrapping_sub(first[l]);
            moved[l] = last[l].wrapping_add(shift[l]);
        }
        Self { shift, last: moved }
    }

    #[inline(always)]
    fn excludes(&self, word: usize, place: i16) -> bool {
        place.wrapping_add(self.shift[word]) > self.last[word]
    }
}

/// Moves a word up by a bit, and puts a bit below. In a loop over words, compilers make vectors of
/// this.
#[inline(always)]
pub(super) fn push(word: &mut u16, bit: bool) {
    *word = (word.wrapping_add(*word)).wrapping_add(u16::from(bit));
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
    add_disc(pen.isa, &pen.half_square, &Disc { x, y, limits }, mask);
}
