// Barycentric coordinates of shaded points (stage shade): where each point lies in its triangle, corrected for
// perspective, and how this changes from pixel to pixel. Other values, such as normals and texture coordinates, are
// interpolated by them. Twin of src/render/backend/cpu/surface/barycentric.rs.
//
// Uses: common.wgsl (CLIPPED, has, homogeneous, OUTSIDE, recip, rn2, rn3, rn4, Vertex),
// one_job.wgsl or gang.wgsl (frame), geometry/triangle.wgsl (area_of, is_negative).

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;

// Corners relative to the shaded point, by corner: homogeneous x, y, w, and the factor that each
// barycentric takes besides.
struct Corners {
    x: vec3<f32>,
    y: vec3<f32>,
    w: vec3<f32>,
    weight: vec3<f32>,
    snapped: bool,
    front: bool,
};

// Snapped corners; if one is behind the eye, the homogeneous ones, which are valid there too.
fn corners_of(id: u32, at: vec2<f32>) -> Corners {
    let a = vertices[frame.vertices_at + triangles[3u * id]];
    let b = vertices[frame.vertices_at + triangles[3u * id + 1u]];
    let c = vertices[frame.vertices_at + triangles[3u * id + 2u]];
    if !has(CLIPPED) || (a.x != OUTSIDE && b.x != OUTSIDE && c.x != OUTSIDE) {
        let x = vec3<f32>(vec3(a.x, b.x, c.x)) - at.x;
        let y = vec3<f32>(vec3(a.y, b.y, c.y)) - at.y;
        return Corners(x, y, vec3(1.0), vec3(a.inv_w, b.inv_w, c.inv_w), true, is_negative(area_of(a, b, c)));
    }
    let p = homogeneous(corner_position(id, 0u));
    let q = homogeneous(corner_position(id, 1u));
    let r = homogeneous(corner_position(id, 2u));
    let w = vec3(p.w, q.w, r.w);
    let x = vec3(p.x, q.x, r.x) - rn3(at.x * w);
    let y = vec3(p.y, q.y, r.y) - rn3(at.y * w);
    return Corners(x, y, w, vec3(1.0), false, false);
}

// In the unit box.
fn corner_position(id: u32, corner: u32) -> vec3<f32> {
    let v = triangles[3u * id + corner];
    return vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]);
}

fn is_front(id: u32, at: vec2<f32>) -> bool {
    let corners = corners_of(id, at);
    if corners.snapped {
        return corners.front;
    }
    return barycentrics_of(corners).front;
}

// Linear in the point: the areas opposite the corners, weighted, and how they change.
struct Areas {
    u: vec3<f32>,
    dx: vec3<f32>,
    dy: vec3<f32>,
};

fn areas_of(c: Corners) -> Areas {
    return Areas(
        rn3(c.weight * (rn3(c.x.yzx * c.y.zxy) - rn3(c.x.zxy * c.y.yzx))),
        rn3(c.weight * (rn3(c.w.zxy * c.y.yzx) - rn3(c.w.yzx * c.y.zxy))),
        rn3(c.weight * (rn3(c.w.yzx * c.x.zxy) - rn3(c.w.zxy * c.x.yzx))),
    );
}

// Perspective-correct barycentrics at a point, and how they change a pixel to the right and a pixel
// down.
struct Barycentrics {
    // They add up to 1: two are computed, the third is the rest.
    value: vec3<f32>,
    dx: vec3<f32>,
    dy: vec3<f32>,
    front: bool,
};

fn barycentrics(id: u32, at: vec2<f32>) -> Barycentrics {
    return barycentrics_of(corners_of(id, at));
}

// b_i is proportional to the area opposite the corner, so that the derivatives are exact too. The
// CPU's bits, if not where it may be quicker because nothing is decided by them.
fn barycentrics_of(c: Corners) -> Barycentrics {
    let areas = areas_of(c);
    let total = (areas.u.x + areas.u.y) + areas.u.z;
    let size = abs(total);
    var inverse = 0.0;
    if size > 1e-30 && size < 1e30 {
        inverse = recip(size);
    }
    inverse = select(inverse, -inverse, total < 0.0);
    let first = rn2(areas.u.xy * inverse);
    let value = vec3(first, (1.0 - first.x) - first.y);
    let total_x = (areas.dx.x + areas.dx.y) + areas.dx.z;
    let total_y = (areas.dy.x + areas.dy.y) + areas.dy.z;
    let dx = rn3((areas.dx - rn3(value * total_x)) * inverse);
    let dy = rn3((areas.dy - rn3(value * total_y)) * inverse);
    return Barycentrics(value, 256.0 * dx, 256.0 * dy, total < 0.0);
}

// Distance in pixels from the point to the line on screen that carries the edge opposite corner i,
// for each.
fn edge_distances_px(c: Corners) -> vec3<f32> {
    let areas = areas_of(c);
    let slope = areas.dx * areas.dx + areas.dy * areas.dy;
    return abs(areas.u) / max(256.0 * sqrt(slope), vec3(1e-30));
}

// A triangle's barycentrics, continued beyond its edges, in a pixel's centre and in the centres of
// its neighbours across and down in the same block of 2 x 2 pixels.
struct Quad {
    own: vec3<f32>,
    across: vec3<f32>,
    down: vec3<f32>,
    // 1 where the neighbour is right of the pixel (below it), -1 where it is left of it (above it).
    sign: vec2<f32>,
};

fn quad_around(id: u32, at: vec2<f32>) -> Quad {
    let half = vec2(frame.width, frame.height) * 128;
    let pixel = vec2<i32>(at + vec2<f32>(half)) >> vec2(8u);
    let center = vec2<f32>(pixel * 256 - half + 128);
    let sign = select(vec2(-1.0), vec2(1.0), (pixel & vec2(1)) == vec2(0));
    let across = vec2(center.x + 256.0 * sign.x, center.y);
    let down = vec2(center.x, center.y + 256.0 * sign.y);
    return Quad(barycentrics(id, center).value, barycentrics(id, across).value, barycentrics(id, down).value, sign);
}

fn blend2(w: vec3<f32>, p: vec2<f32>, q: vec2<f32>, r: vec2<f32>) -> vec2<f32> {
    return (rn2(w.x * p) + rn2(w.y * q)) + rn2(w.z * r);
}

fn blend3(w: vec3<f32>, p: vec3<f32>, q: vec3<f32>, r: vec3<f32>) -> vec3<f32> {
    return (rn3(w.x * p) + rn3(w.y * q)) + rn3(w.z * r);
}

fn blend4(w: vec3<f32>, p: vec4<f32>, q: vec4<f32>, r: vec4<f32>) -> vec4<f32> {
    return (rn4(w.x * p) + rn4(w.y * q)) + rn4(w.z * r);
}
