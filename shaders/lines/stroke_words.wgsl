// The layout of the buffer `strokes` (stage lines): 14 words per pixel about its strokes (a stroke is the area
// that the line of one part of an edge covers) and about the area that lines leave free. The kernels edge, fringes,
// holes, tips and coverage write to them. At the end of a pass coverage.wgsl reads them and sets them to zero for the
// next pass. Where hidden parts fade it also does so after the strokes of whole edges, and keeps WHOLE_WORD. The CPU has
// a struct, LineCoverage in src/render/backend/cpu/lines/coverage.rs, so this file has no twin.
//
// Uses: common.wgsl (sample_count).

// Points in a pixel, and the lattice they lie on: point i is in column i and row GENERATOR * i,
// modulo POINTS.
const POINTS: u32 = 256u;
const GENERATOR: u32 = 181u;

// Steps to the pixel of a sum of areas.
const AREA_UNIT: f32 = 65536.0;

// Steps to the pixel of a hole's area.
const HOLE_UNIT: f32 = 65536.0;

// Words per pixel.
const STROKE_WORDS: u32 = 14u;
// The sum of the strokes' areas.
const AREA_WORD: u32 = 0u;
// The sum of their counts of points.
const COUNT_WORD: u32 = 1u;
// Number of times that each sum has wrapped around: areas in the lower half, counts in the upper.
const CARRY_WORD: u32 = 2u;
// The first word of the mask: the points that any stroke covers.
const MASK_WORD: u32 = 3u;
const MASK_WORDS: u32 = 8u;
// The largest difference between a stroke's area and its points.
const SLACK_WORD: u32 = 11u;
// The area of holes, and the marks below. The CPU's are in Holes, src/render/backend/cpu/lines/holes/mod.rs.
const HOLE_WORD: u32 = 12u;
// The share that whole edges cover, where their hidden parts are faded: bits of an f32.
const WHOLE_WORD: u32 = 13u;
// Bit of a pixel in which areas do not tell what is free.
const MARKED: u32 = 0x80000000u;
// Bit of a marked pixel that gets the strokes of all edges, because points do not tell either.
const STROKED: u32 = 0x40000000u;

// The marks of a pixel in which points tell. With one sample per pixel strokes do instead: a rim that no
// sample shows may count as hidden, and the strokes of the edges beside it make up for it.
fn point_marks() -> u32 {
    return select(MARKED, MARKED | STROKED, sample_count() == 1);
}
