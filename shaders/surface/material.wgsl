// The material of a triangle, as shading reads it: colours, metallic and roughness, wires, textures, and flags
// (stage shade). The CPU's counterpart is ShadedMaterial in src/render/plan/surface/mod.rs.
//
// Uses: common.wgsl (has, TRIANGLE_MATERIALS), one_job.wgsl or gang.wgsl (frame).

// Triangles' materials, then edge masks, one byte each.
@group(1) @binding(8) var<storage, read> attributes: array<u32>;
@group(1) @binding(15) var<storage, read> materials: array<Material>;

// src/render/plan/surface/mod.rs explains the fields.
struct Material {
    base_color: vec4<f32>,
    emissive: vec3<f32>,
    alpha_cutoff: f32,
    wire_color: vec4<f32>,
    wire_thickness: f32,
    wire_smoothing: f32,
    metallic: f32,
    roughness: f32,
    normal_scale: f32,
    flags: u32,
    opacity: f32,
    facing_opacity: f32,
    occlusion_texture_strength: f32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
    // Five texture uses of eight words.
    textures: array<vec4<u32>, 10>,
};

// Bits of a material's flags.
const MATERIAL_FILL: u32 = 1u;
const MATERIAL_FACE_NORMALS: u32 = 2u;
const MATERIAL_DERIVATIVE_NORMALS: u32 = 4u;
const MATERIAL_VERTEX_NORMALS: u32 = 8u;
const MATERIAL_LIT: u32 = 14u;
const MATERIAL_VERTEX_COLORS: u32 = 16u;
const MATERIAL_MASK: u32 = 32u;
const MATERIAL_BLEND: u32 = 64u;
const MATERIAL_WIRE_BARYCENTRIC: u32 = 256u;
const MATERIAL_WIRE_FWIDTH_MIN: u32 = 512u;
const MATERIAL_WIRE_FWIDTH: u32 = 1024u;
const MATERIAL_WIRES: u32 = 1920u;
const MATERIAL_WIRE_LIT: u32 = 2048u;
const MATERIAL_DEBUG_SHIFT: u32 = 12u;
const MATERIAL_OWN_METALLIC: u32 = 32768u;
const MATERIAL_OWN_ROUGHNESS: u32 = 65536u;
const MATERIAL_BY_ANGLE: u32 = 131072u;

// Places among a material's textures.
const SLOT_BASE: u32 = 0u;
const SLOT_METALLIC_ROUGHNESS: u32 = 1u;
const SLOT_NORMAL: u32 = 2u;
const SLOT_EMISSIVE: u32 = 3u;
const SLOT_OCCLUSION_TEXTURE: u32 = 4u;

// Metals below this roughness mirror sharply.
const MIRROR_ROUGHNESS: f32 = 0.5;

// The index of no texture.
const TEXTURE_NONE: u32 = 0xFFFFFFFFu;

fn material_index(id: u32) -> u32 {
    if has(TRIANGLE_MATERIALS) {
        return min(attributes[id], frame.material_count - 1u);
    }
    return 0u;
}

// True if a metal may mirror so sharply that its light changes much with its normal.
fn mirrors_sharply(m: u32) -> bool {
    let texture = materials[m].textures[2u * SLOT_METALLIC_ROUGHNESS + 1u].z;
    return materials[m].metallic > 0.0 && (materials[m].roughness < MIRROR_ROUGHNESS || texture != TEXTURE_NONE);
}

// True if a triangle is shaded in each quarter of a pixel: with adaptive samples, if it mirrors sharply with normals that
// change within a face.
fn is_quartered(id: u32) -> bool {
    if frame.has_quarters == 0u || id >= frame.triangle_count {
        return false;
    }
    let m = material_index(id);
    return (materials[m].flags & MATERIAL_VERTEX_NORMALS) != 0u && mirrors_sharply(m);
}
