// The test whether an edge is drawn in this view (stage lines). Edges are drawn in passes, each with lines of one
// width and colour. A pass of contours draws silhouettes only: edges whose faces all lie on one side of them on
// screen. If the surface is closed and hides its inside, and the pass leaves hidden lines out, an edge is dropped if
// all its faces face away from the viewer. Also the choice of the face whose light falls on the edge's line. Twin of
// src/render/backend/cpu/lines/contour.rs. edge.wgsl declares the buffers.
//
// Uses: common.wgsl (CONTOUR, CONTOURS, has, INSIDE_OUT, OUTSIDE, rn, SKIP_BACK), one_job.wgsl
// (batch), geometry/triangle.wgsl (area_of, is_negative, is_zero), lines/edge.wgsl (triangles,
// vertices), lines/segment.wgsl (homogeneous_of).

const NO_FACE: u32 = 0xFFFFFFFFu;

// True if the pass draws the edge in this view: not on the far side of a closed surface, and for a
// contour only the silhouette.
fn is_drawn(edge: vec4<u32>) -> bool {
    let is_contour = is_contour_pass();
    if (batch.line_flags & SKIP_BACK) == 0u && !is_contour {
        return true;
    }
    if (batch.line_flags & SKIP_BACK) != 0u && is_hidden(edge.z, is_contour) && is_hidden(edge.w, is_contour) {
        return false;
    }
    if !is_contour {
        return true;
    }
    return is_silhouette(edge);
}

// True if all faces lie on one side of the edge on screen, or there is no second face, even if the
// first is seen edge-on.
fn is_silhouette(edge: vec4<u32>) -> bool {
    if edge.w == NO_FACE {
        return true;
    }
    let a = side_of(edge, edge.z);
    let b = side_of(edge, edge.w);
    return (a < 0 || b < 0) != (a > 0 || b > 0);
}

fn is_contour_pass() -> bool {
    return has(CONTOURS) && (batch.line_flags & CONTOUR) != 0u;
}

// True if a face of a closed surface hides its edges. For a contour, a face seen edge-on does too.
fn is_hidden(face: u32, is_contour: bool) -> bool {
    return faces_away(face) || (is_contour && is_edge_on(face));
}

fn is_edge_on(face: u32) -> bool {
    let a = vertices[triangles[3u * face]];
    let b = vertices[triangles[3u * face + 1u]];
    let c = vertices[triangles[3u * face + 2u]];
    return a.x != OUTSIDE && b.x != OUTSIDE && c.x != OUTSIDE && is_zero(area_of(a, b, c));
}

// Side of the edge on which a face lies on screen: -1, 1, or 0 if it is seen edge-on or is missing.
fn side_of(edge: vec4<u32>, face: u32) -> i32 {
    if face == NO_FACE {
        return 0;
    }
    let t = vec3(triangles[3u * face], triangles[3u * face + 1u], triangles[3u * face + 2u]);
    let is_end = (t == vec3(edge.x)) | (t == vec3(edge.y));
    let corner = select(select(t.z, t.y, !is_end.y), t.x, !is_end.x);
    let a = vertices[edge.x];
    let b = vertices[edge.y];
    let c = vertices[corner];
    if a.x != OUTSIDE && b.x != OUTSIDE && c.x != OUTSIDE {
        let area = area_of(a, b, c);
        return select(select(1, -1, is_negative(area)), 0, is_zero(area));
    }
    // With a corner behind the eye, the side of the face's plane on which the eye is decides.
    let volume = volume_of(homogeneous_of(edge.x), homogeneous_of(edge.y), homogeneous_of(corner));
    return i32(volume > 0.0) - i32(volume < 0.0);
}

// Six times the volume that three points on screen, times W, span with the eye.
fn volume_of(p: vec4<f32>, q: vec4<f32>, r: vec4<f32>) -> f32 {
    let x = rn(p.y * q.w) - rn(p.w * q.y);
    let y = rn(p.w * q.x) - rn(p.x * q.w);
    let w = rn(p.x * q.y) - rn(p.y * q.x);
    return (rn(rn(x) * r.x) + rn(rn(y) * r.y)) + rn(rn(w) * r.w);
}

// The face that lights the edge's line where the pixel shows no surface, plus 1. Of the faces
// towards the viewer it is the one with the highest id, so that the order of edges does not matter.
fn lighting_face(edge: vec4<u32>) -> u32 {
    let best = max(select(edge.z + 1u, 0u, faces_away(edge.z)), select(edge.w + 1u, 0u, faces_away(edge.w)));
    return select(edge.z + 1u, best, best > 0u);
}

// True if a face certainly faces away. A missing face does.
fn faces_away(face: u32) -> bool {
    if face == NO_FACE {
        return true;
    }
    let a = vertices[triangles[3u * face]];
    let b = vertices[triangles[3u * face + 1u]];
    let c = vertices[triangles[3u * face + 2u]];
    if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE {
        return false;
    }
    let area = area_of(a, b, c);
    return !is_zero(area) && is_negative(area) == ((batch.line_flags & INSIDE_OUT) != 0u);
}
