// Stage 1b, a triangle or edge that reaches behind the eye or far outside the picture. Twin of src/backend/cpu/clip.rs.

// Bound of clipped coordinates, a little inside the guard band so that rounding cannot leave it.
const BOUND: f32 = 1048064.0;

struct Polygon {
    corners: array<vec4<f32>, 8>,
    len: u32,
};

fn clip_triangle(a: vec4<f32>, b: vec4<f32>, c: vec4<f32>) -> Polygon {
    var polygon: Polygon;
    polygon.corners[0] = a;
    polygon.corners[1] = b;
    polygon.corners[2] = c;
    polygon.len = 3u;
    for (var plane = 0; plane < 5; plane++) {
        var cut: Polygon;
        for (var i = 0u; i < polygon.len; i++) {
            let from_corner = polygon.corners[i];
            let to_corner = polygon.corners[select(i + 1u, 0u, i + 1u == polygon.len)];
            let d_from = plane_distance(plane, from_corner);
            let d_to = plane_distance(plane, to_corner);
            if d_from >= 0.0 && cut.len < 8u {
                cut.corners[cut.len] = from_corner;
                cut.len++;
            }
            if (d_from >= 0.0) != (d_to >= 0.0) && cut.len < 8u {
                // Always from the inside to the outside: the neighbour across the edge gets the same point, bit for bit.
                if d_from >= 0.0 {
                    cut.corners[cut.len] = intersect(from_corner, to_corner, d_from, d_to);
                } else {
                    cut.corners[cut.len] = intersect(to_corner, from_corner, d_to, d_from);
                }
                cut.len++;
            }
        }
        polygon = cut;
    }
    return polygon;
}

fn plane_distance(plane: i32, p: vec4<f32>) -> f32 {
    let reach = rn(BOUND * p.w);
    switch plane {
        case 0: { return rn(p.w - frame.near_w); }
        case 1: { return rn(reach - p.x); }
        case 2: { return rn(reach + p.x); }
        case 3: { return rn(reach - p.y); }
        default: { return rn(reach + p.y); }
    }
}

fn intersect(inside: vec4<f32>, outside: vec4<f32>, d_inside: f32, d_outside: f32) -> vec4<f32> {
    let t = rn(d_inside * recip(rn(d_inside - d_outside)));
    return vec4(
        inside.x + rn(t * rn(outside.x - inside.x)),
        inside.y + rn(t * rn(outside.y - inside.y)),
        inside.z + rn(t * rn(outside.z - inside.z)),
        inside.w + rn(t * rn(outside.w - inside.w)),
    );
}

fn snap_clipped(p: vec4<f32>) -> Vertex {
    let r = recip(p.w);
    let x = clamp(rn(p.x * r), -BOUND, BOUND);
    let y = clamp(rn(p.y * r), -BOUND, BOUND);
    return Vertex(round_to_i32(x), round_to_i32(y), rn(p.z * r), r);
}
