// The colour of a point of the surface (stage shade): base colour, vertex colours and textures, under the light,
// with wires over them. Twin of src/render/backend/cpu/surface/point.rs.
//
// Uses: common.wgsl (DEBUG, has, rn, rn3, rn4, rolled_off, TEXTURES, VARYING,
// VERTEX_COLORS, WIRE_LIT, WIRES), one_job.wgsl or gang.wgsl (frame), surface/barycentric.wgsl
// (Barycentrics, barycentrics, blend4, is_front), surface/debug.wgsl (debug_color),
// surface/light.wgsl (Light, light, lit, unlit), surface/material.wgsl (MATERIAL_BLEND,
// MATERIAL_BY_ANGLE, MATERIAL_DEBUG_SHIFT, MATERIAL_FACE_NORMALS, MATERIAL_FILL, material_index,
// MATERIAL_LIT, MATERIAL_MASK, MATERIAL_OWN_METALLIC, MATERIAL_OWN_ROUGHNESS,
// MATERIAL_VERTEX_COLORS, MATERIAL_WIRE_LIT, MATERIAL_WIRES, materials, SLOT_BASE, SLOT_EMISSIVE,
// SLOT_METALLIC_ROUGHNESS, SLOT_NORMAL, SLOT_OCCLUSION_TEXTURE), surface/normal.wgsl (angle_share,
// face_normal, normal, normal_mapped, turned_to_viewer), surface/occlusion_texture.wgsl
// (with_occlusion_texture), surface/texture.wgsl (sample_texture, use_of, Uv, uv_of),
// surface/wire.wgsl (wire_cover).

// Three indices per triangle, for each kind of corner value that does not go by position.
@group(1) @binding(7) var<storage, read> corner_triangles: array<u32>;
@group(1) @binding(19) var<storage, read> vertex_colors: array<vec4<f32>>;

// Parts of a material that a point shows.
struct Show {
    fill: bool,
    // Opacity of the wires, 0 to 1.
    wires: f32,
    // Share of the light that reaches it, 0 to 1.
    open: f32,
};

// Premultiplied linear RGBA of surface triangle `id` at a point, in 1/256 px from the picture's
// centre.
fn point_color(id: u32, at: vec2<f32>, show: Show) -> vec4<f32> {
    let m = material_index(id);
    if has(VARYING) {
        return varying_color(id, at, m, show);
    }
    let base = with_alpha(m, materials[m].base_color, show);
    var shown = unlit(base);
    if (materials[m].flags & MATERIAL_FACE_NORMALS) != 0u {
        let normal = turned_to_viewer(face_normal(id), is_front(id, at));
        shown = lit(base, dimmed(light(materials[m].metallic, materials[m].roughness, normal), show.open));
    }
    return premultiplied(shown, materials[m].emissive);
}

fn varying_color(id: u32, at: vec2<f32>, m: u32, show: Show) -> vec4<f32> {
    let flags = materials[m].flags;
    let b = barycentrics(id, at);
    let wire = materials[m].wire_color;
    var cover = 0.0;
    if has(WIRES) && (flags & MATERIAL_WIRES) != 0u && show.wires > 0.0 {
        cover = show.wires * wire_cover(id, at, m, b);
    }
    let debug = (flags >> MATERIAL_DEBUG_SHIFT) & 7u;
    if has(DEBUG) && debug != 0u {
        if !show.fill {
            return cover * wire;
        }
        return over(cover, wire, debug_color(debug, id, at, m, b));
    }
    var uv = Uv(vec2(0.0), vec2(0.0), vec2(0.0));
    var base = materials[m].base_color;
    if has(VERTEX_COLORS) && (flags & MATERIAL_VERTEX_COLORS) != 0u {
        base = rn4(base * vertex_color(id, b));
    }
    if has(TEXTURES) {
        uv = uv_of(id, b, 0u);
        base = rn4(base * sample_texture(m, SLOT_BASE, id, b, uv));
    }
    base = with_alpha(m, base, show);
    if base.w == 0.0 && cover == 0.0 {
        return vec4(0.0);
    }
    if (flags & MATERIAL_BY_ANGLE) != 0u {
        base.w = rn(base.w * angle_share(m, at, normal(id, at, m, b)));
    }
    var light_here = Light(1.0, 0.0);
    if (flags & MATERIAL_LIT) != 0u {
        var gloss = vec2(materials[m].roughness, materials[m].metallic);
        var n = normal(id, at, m, b);
        if has(TEXTURES) {
            let textured = sample_texture(m, SLOT_METALLIC_ROUGHNESS, id, b, uv).yz;
            let own = vec2(flags & MATERIAL_OWN_ROUGHNESS, flags & MATERIAL_OWN_METALLIC) != vec2(0u);
            gloss *= select(textured, vec2(1.0), own);
            if use_of(m, SLOT_NORMAL).texture < frame.image_count {
                n = normal_mapped(id, m, b, uv, n);
            }
        }
        light_here = light(gloss.y, gloss.x, n);
        if has(TEXTURES) && use_of(m, SLOT_OCCLUSION_TEXTURE).texture < frame.image_count {
            let red = sample_texture(m, SLOT_OCCLUSION_TEXTURE, id, b, uv).x;
            light_here = with_occlusion_texture(light_here, materials[m].occlusion_texture_strength, red, gloss.y, n);
        }
        light_here = dimmed(light_here, show.open);
    }
    var emissive = materials[m].emissive;
    if has(TEXTURES) {
        emissive = rn3(emissive * sample_texture(m, SLOT_EMISSIVE, id, b, uv).xyz);
    }
    if has(WIRE_LIT) && (flags & MATERIAL_WIRE_LIT) != 0u {
        return lit_wire(cover, wire, base, light_here, emissive);
    }
    var shown = unlit(base);
    if (flags & MATERIAL_LIT) != 0u {
        shown = lit(base, light_here);
    }
    return over(cover, wire, premultiplied(shown, emissive));
}

// The same light where only a share of it is there.
fn dimmed(whole: Light, open: f32) -> Light {
    return Light(rn(whole.gain * open), rn(whole.gloss * open));
}

fn vertex_color(id: u32, b: Barycentrics) -> vec4<f32> {
    let first = frame.color_triangles_at + 3u * id;
    let p = vertex_colors[corner_triangles[first]];
    let q = vertex_colors[corner_triangles[first + 1u]];
    return blend4(b.value, p, q, vertex_colors[corner_triangles[first + 2u]]);
}

// The base colour with the material's cutoff, blending and opacity applied to alpha.
fn with_alpha(m: u32, base: vec4<f32>, show: Show) -> vec4<f32> {
    let flags = materials[m].flags;
    // Barycentrics round to a little below 0 and above 1, and so does alpha that they blend.
    let alpha = clamp(base.w, 0.0, 1.0);
    let is_cut = (flags & MATERIAL_MASK) != 0u && alpha < materials[m].alpha_cutoff;
    if is_cut || !show.fill || (flags & MATERIAL_FILL) == 0u {
        return vec4(0.0);
    }
    return vec4(base.xyz, rn(select(1.0, alpha, (flags & MATERIAL_BLEND) != 0u) * materials[m].opacity));
}

fn premultiplied(straight: vec4<f32>, emissive: vec3<f32>) -> vec4<f32> {
    return vec4(rn3((straight.xyz + emissive) * straight.w), straight.w);
}

// The wire as paint: over the base colour, under the light.
fn lit_wire(cover: f32, wire: vec4<f32>, base: vec4<f32>, light_here: Light, emissive: vec3<f32>) -> vec4<f32> {
    let painted = over(cover, wire, vec4(rn3(base.xyz * base.w), base.w));
    let left = rn(base.w * (1.0 - rn(cover * wire.w)));
    let lit = rn3(painted.xyz * light_here.gain) + rn(painted.w * light_here.gloss);
    return vec4(rolled_off(lit, max(painted.w, 0.0)) + rn3(emissive * left), painted.w);
}

fn over(cover: f32, top: vec4<f32>, under: vec4<f32>) -> vec4<f32> {
    return rn4(cover * top) + rn4(under * (1.0 - rn(cover * top.w)));
}
