// The test whether a face has a fringe (stage lines): the part of it that lies within half a line's width of its
// sides, as fringes.wgsl has it. Wide faces have none, because few of their pixels would be in it, and clipped ones
// have none. The lines along the sides of such faces are drawn edge by edge. Twin of `Fringes::pixels_of` in
// src/render/backend/cpu/lines/fringes.rs.
//
// Uses: common.wgsl (OUTSIDE, Vertex).

// Greatest width and height of a face with a fringe, 1/256 px.
const FRINGED_MAX: i32 = 4096;

// True if a face with these corners has a fringe.
fn is_fringed(a: Vertex, b: Vertex, c: Vertex) -> bool {
    if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE {
        return false;
    }
    let extent = vec2(max(max(a.x, b.x), c.x) - min(min(a.x, b.x), c.x), max(max(a.y, b.y), c.y) - min(min(a.y, b.y), c.y));
    return all(extent <= vec2(FRINGED_MAX));
}
