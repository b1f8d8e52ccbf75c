// The colour of one point of the surface: stage 3's formulas. Twin of src/backend/cpu/point.rs.

@group(1) @binding(6) var<storage, read> normals: array<f32>;
@group(1) @binding(7) var<storage, read> normal_triangles: array<u32>;
// Triangles' materials, then edge masks, a byte each.
@group(1) @binding(8) var<storage, read> attributes: array<u32>;
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
const MATERIAL_FILL: u32 = 1u;
const MATERIAL_FACE_NORMALS: u32 = 2u;
const MATERIAL_VERTEX_NORMALS: u32 = 8u;
const MATERIAL_WIRES: u32 = 1920u;

// What of its material a point shows.
struct Show {
    fill: bool,
    // How much of its wires, 0 to 1.
    wires: f32,
};

// Premultiplied linear RGBA of surface triangle `id` at a point, in 1/256 px from the picture's centre.
fn point_color(id: u32, at: vec2<f32>, show: Show) -> vec4<f32> {
    let m = material_index(id);
    var color = materials[m].base_color;
    color = vec4(color.xyz * color.w, color.w);
    let flags = materials[m].flags;
    if (flags & (MATERIAL_VERTEX_NORMALS | MATERIAL_WIRES)) != 0u {
        let b = barycentrics(id, at);
        if (flags & MATERIAL_VERTEX_NORMALS) != 0u {
            color = light(m, facing(interpolated_normal(id, b.value), b.front));
        } else if (flags & MATERIAL_FACE_NORMALS) != 0u {
            color = light(m, facing(face_normal(id), b.front));
        }
        if !show.fill || (flags & MATERIAL_FILL) == 0u {
            color = vec4(0.0);
        }
        if (flags & MATERIAL_WIRES) != 0u && show.wires > 0.0 {
            let cover = show.wires * wire_factor(id, m, b);
            let wire = materials[m].wire_color;
            color = cover * wire + color * (1.0 - cover * wire.w);
        }
    } else if (flags & MATERIAL_FACE_NORMALS) != 0u {
        color = light(m, facing(face_normal(id), is_front(id, at)));
    }
    if (flags & MATERIAL_WIRES) == 0u && (!show.fill || (flags & MATERIAL_FILL) == 0u) {
        return vec4(0.0);
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

// The unit normal on the viewer's side.
fn facing(n: vec3<f32>, front: bool) -> vec3<f32> {
    let length_squared = dot(n, n);
    var scale = 0.0;
    if length_squared > 1e-20 {
        scale = 1.0 / sqrt(length_squared);
    }
    return n * select(-scale, scale, front);
}
