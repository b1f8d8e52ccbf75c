// The test whether a face has a fringe (stage lines): the part of it that lies within half a line's width of its
// sides, as fringes.wgsl has it. Wide faces have none, because few of their pixels would be in it, and neither have
// clipped ones and those that are seen edge-on. The lines along the sides of such faces are drawn edge by edge. The CPU
// keeps a bit for each face, `Sides::unfringed` in src/render/backend/cpu/bands/keep/, so this file has no twin.
//
// Uses: common.wgsl (OUTSIDE, Vertex), geometry/triangle.wgsl (area_of, is_zero).

// Greatest width and height of a face with a fringe, 1/256 px.
const FRINGED_MAX: i32 = 4096;

// True if a face with these corners has a fringe.
fn is_fringed(a: Vertex, b: Vertex, c: Vertex) -> bool {
    if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE {
        return false;
    }
    let low = min(min(vec2(a.x, a.y), vec2(b.x, b.y)), vec2(c.x, c.y));
    let extent = max(max(vec2(a.x, a.y), vec2(b.x, b.y)), vec2(c.x, c.y)) - low;
    return all(extent <= vec2(FRINGED_MAX)) && !is_zero(area_of(a, b, c));
}
