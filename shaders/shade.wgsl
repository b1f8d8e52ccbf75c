// Stage 3, a pixel: the colour of each triangle that is seen there. Twin of src/backend/cpu/shade.rs.

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;
// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
@group(1) @binding(6) var<storage, read> normals: array<f32>;
@group(1) @binding(7) var<storage, read> normal_triangles: array<u32>;
// Triangles' materials, then edge masks, a byte each.
@group(1) @binding(8) var<storage, read> attributes: array<u32>;
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;
@group(1) @binding(15) var<storage, read> materials: array<Material>;
@group(1) @binding(16) var<storage, read> face_normals: array<f32>;

// src/plan/surface.rs explains the fields.
struct Material {
    base_color: vec4<f32>,
    // Emissive colour, alpha cutoff.
    emissive: vec4<f32>,
    wire_color: vec4<f32>,
    wire_thickness: f32,
    wire_smoothing: f32,
    metallic: f32,
    roughness: f32,
    normal_scale: f32,
    flags: u32,
    padding: vec2<u32>,
    // Four texture uses of eight words.
    textures: array<vec4<u32>, 8>,
};

// Bits of a material's flags.
const MATERIAL_FACE_NORMALS: u32 = 2u;
const MATERIAL_VERTEX_NORMALS: u32 = 8u;
const MATERIAL_WIRES: u32 = 1920u;

const NOTHING: u32 = 0xFFFFFFFFu;

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * 64u;
    if i >= batch.count {
        return;
    }
    let pixel = vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width);
    if sample_count() == 1 {
        colors[i] = group_color(id_at(i), pixel, vec2(8, 8), 1);
        return;
    }
    let ids = vec4(id_at(4u * i), id_at(4u * i + 1u), id_at(4u * i + 2u), id_at(4u * i + 3u));
    var left = ids != vec4(NOTHING);
    var sum = vec4(0.0);
    // Once for each triangle among the samples.
    while any(left) {
        let id = select(select(select(ids.w, ids.z, left.z), ids.y, left.y), ids.x, left.x);
        let same = ids == vec4(id);
        left = left & !same;
        let counts = select(vec4(0), vec4(1), same);
        // The samples' offsets: 6 14 2 10 across, 2 6 10 14 down.
        let across = counts * vec4(6, 14, 2, 10);
        let down = counts * vec4(2, 6, 10, 14);
        let offset = vec2(across.x + across.y + across.z + across.w, down.x + down.y + down.z + down.w);
        let count = counts.x + counts.y + counts.z + counts.w;
        sum += f32(count) * 0.25 * group_color(id, pixel, offset, count);
    }
    colors[i] = sum;
}

fn id_at(sample: u32) -> u32 {
    let word = samples[sample];
    return select(~word.x, NOTHING, word.y == 0u);
}

// The colour of a triangle at the mean of `count` samples whose offsets in 1/16 px add up to `offset_sum`.
fn group_color(id: u32, pixel: vec2<i32>, offset_sum: vec2<i32>, count: i32) -> vec4<f32> {
    if id == NOTHING {
        return vec4(0.0);
    }
    if id >= frame.triangle_count || !has(SURFACE) {
        return frame.hull_color;
    }
    let share = select(select(select(0.25, 1.0 / 3.0, count == 3), 0.5, count == 2), 1.0, count == 1);
    let scale = 16.0 * share;
    return surface_color(id, vec2<f32>(pixel_corner(pixel)) + vec2<f32>(offset_sum) * scale);
}

fn surface_color(id: u32, at: vec2<f32>) -> vec4<f32> {
    let m = material_index(id);
    var color = materials[m].base_color;
    let flags = materials[m].flags;
    if (flags & (MATERIAL_VERTEX_NORMALS | MATERIAL_WIRES)) != 0u {
        let b = barycentrics(id, at);
        if (flags & MATERIAL_VERTEX_NORMALS) != 0u {
            color = light(m, facing(interpolated_normal(id, b.value), b.front));
        } else if (flags & MATERIAL_FACE_NORMALS) != 0u {
            color = light(m, facing(face_normal(id), b.front));
        }
        if (flags & MATERIAL_WIRES) != 0u {
            let cover = wire_factor(id, m, b);
            let wire = materials[m].wire_color;
            color = cover * wire + color * (1.0 - cover * wire.w);
        }
    } else if (flags & MATERIAL_FACE_NORMALS) != 0u {
        color = light(m, facing(face_normal(id), is_front(id, at)));
    }
    return color;
}

fn material_index(id: u32) -> u32 {
    if has(TRIANGLE_MATERIALS) {
        return min(attributes[id], frame.material_count - 1u);
    }
    return 0u;
}

fn face_normal(id: u32) -> vec3<f32> {
    return vec3(face_normals[3u * id], face_normals[3u * id + 1u], face_normals[3u * id + 2u]);
}

fn normal_at(i: u32) -> vec3<f32> {
    return vec3(normals[3u * i], normals[3u * i + 1u], normals[3u * i + 2u]);
}

fn interpolated_normal(id: u32, b: vec3<f32>) -> vec3<f32> {
    return (b.x * normal_at(normal_triangles[3u * id]) + b.y * normal_at(normal_triangles[3u * id + 1u]))
        + b.z * normal_at(normal_triangles[3u * id + 2u]);
}

// Corners relative to the shaded point, by corner: homogeneous x, y, w, and the factor that each barycentric takes besides.
struct Corners {
    x: vec3<f32>,
    y: vec3<f32>,
    w: vec3<f32>,
    weight: vec3<f32>,
    snapped: bool,
    front: bool,
};

// Snapped corners where there are some; where one is behind the eye, the homogeneous ones, which stay right there.
fn corners_of(id: u32, at: vec2<f32>) -> Corners {
    let a = vertices[triangles[3u * id]];
    let b = vertices[triangles[3u * id + 1u]];
    let c = vertices[triangles[3u * id + 2u]];
    if !has(CLIPPED) || (a.x != OUTSIDE && b.x != OUTSIDE && c.x != OUTSIDE) {
        let x = vec3<f32>(vec3(a.x, b.x, c.x)) - at.x;
        let y = vec3<f32>(vec3(a.y, b.y, c.y)) - at.y;
        return Corners(x, y, vec3(1.0), vec3(a.inv_w, b.inv_w, c.inv_w), true, is_negative(area_of(a, b, c)));
    }
    let p = corner_position(triangles[3u * id]);
    let q = corner_position(triangles[3u * id + 1u]);
    let r = corner_position(triangles[3u * id + 2u]);
    let w = vec3(p.w, q.w, r.w);
    return Corners(vec3(p.x, q.x, r.x) - at.x * w, vec3(p.y, q.y, r.y) - at.y * w, w, vec3(1.0), false, false);
}

fn corner_position(v: u32) -> vec4<f32> {
    return homogeneous(vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]));
}

fn is_front(id: u32, at: vec2<f32>) -> bool {
    let corners = corners_of(id, at);
    if corners.snapped {
        return corners.front;
    }
    return barycentrics_of(corners).front;
}

// Perspective-correct barycentrics at a point, and |db/dx| + |db/dy| a pixel.
struct Barycentrics {
    value: vec3<f32>,
    fwidth: vec3<f32>,
    front: bool,
};

fn barycentrics(id: u32, at: vec2<f32>) -> Barycentrics {
    return barycentrics_of(corners_of(id, at));
}

// b_i is proportional to weight_i * (corner_j x corner_k), the area opposite the corner; linear in the point, so that its
// derivatives are exact.
fn barycentrics_of(c: Corners) -> Barycentrics {
    let u = c.weight * (c.x.yzx * c.y.zxy - c.x.zxy * c.y.yzx);
    let ux = c.weight * (c.w.zxy * c.y.yzx - c.w.yzx * c.y.zxy);
    let uy = c.weight * (c.w.yzx * c.x.zxy - c.w.zxy * c.x.yzx);
    let total = (u.x + u.y) + u.z;
    let inverse = 1.0 / total;
    let value = u * inverse;
    let dx = (ux - value * ((ux.x + ux.y) + ux.z)) * inverse;
    let dy = (uy - value * ((uy.x + uy.y) + uy.z)) * inverse;
    return Barycentrics(value, 256.0 * (abs(dx) + abs(dy)), total < 0.0);
}

// The unit normal on the viewer's side.
fn facing(n: vec3<f32>, front: bool) -> vec3<f32> {
    let length_squared = dot(n, n);
    var scale = 0.0;
    if length_squared > 1e-20 {
        scale = 1.0 / sqrt(length_squared);
    }
    return n * select(-scale, scale, front);
}

// Light on a surface with unit normal n: straight alpha in, premultiplied out.
fn light(m: u32, n: vec3<f32>) -> vec4<f32> {
    let base = materials[m].base_color;
    let roughness = materials[m].roughness;
    let alpha = max(roughness * roughness, 0.0025);
    let alpha_squared = alpha * alpha;
    let ambient = frame.ambient * (0.7 + 0.3 * dot(n, frame.screen_up.xyz));
    var diffuse = 0.0;
    var shine = 0.0;
    for (var i = 0u; i < frame.lamp_count; i++) {
        let lamp = frame.lamps[i];
        let halfway = frame.halfways[i].xyz;
        let n_light = max(dot(n, lamp.xyz), 0.0);
        let n_half = max(dot(n, halfway), 0.0);
        let light_half = dot(lamp.xyz, halfway);
        let lobe = n_half * n_half * (alpha_squared - 1.0) + 1.0;
        let gloss = alpha_squared / (lobe * lobe * max(light_half * light_half, 0.1) * (4.0 * roughness + 2.0));
        diffuse += lamp.w * n_light;
        shine += lamp.w * n_light * gloss;
    }
    let metallic = materials[m].metallic;
    let specular = 0.04 + metallic * (base.xyz - 0.04);
    let reflected = base.xyz * (1.0 - metallic) * diffuse + specular * shine;
    return vec4(clamp(base.xyz * ambient + reflected, vec3(0.0), vec3(1.0)) * base.w, base.w);
}

// 1 on the wire, 0 away from it.
fn wire_factor(id: u32, m: u32, b: Barycentrics) -> f32 {
    var mask = 7u;
    if has(EDGE_MASKS) {
        mask = attributes[frame.masks_at + id / 4u] >> (8u * (id & 3u));
    }
    // Coordinate i vanishes on the edge opposite corner i, which runs from corner i + 1 to i + 2.
    let drawn = (vec3(mask) & vec3(2u, 4u, 1u)) != vec3(0u);
    let near = materials[m].wire_thickness * b.fwidth;
    let far = (materials[m].wire_thickness + materials[m].wire_smoothing) * b.fwidth;
    let away = select(vec3(1.0), vec3(ramp(near.x, far.x, b.value.x), ramp(near.y, far.y, b.value.y), ramp(near.z, far.z, b.value.z)), drawn);
    return 1.0 - min(min(away.x, away.y), away.z);
}

fn ramp(near: f32, far: f32, v: f32) -> f32 {
    if far <= near {
        return select(1.0, 0.0, v < near);
    }
    let t = clamp((v - near) / (far - near), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}
