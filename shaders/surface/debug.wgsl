// Debug views (stage shade): in place of a surface's own colour, numbers of the triangle at a point are shown as
// colours, such as barycentric coordinates, the normal or texture coordinates. Twin of
// src/render/backend/cpu/surface/debug.rs.
//
// Uses: common.wgsl (dot3, has, rn2, rn3, UVS, VERTEX_COLORS), one_job.wgsl or gang.wgsl (frame),
// surface/barycentric.wgsl (Barycentrics, corners_of, edge_distances_px), surface/light.wgsl
// (light, lit), surface/material.wgsl (MATERIAL_LIT, materials), surface/normal.wgsl (normal),
// surface/point.wgsl (vertex_color), surface/texture.wgsl (bounded, uv_of), surface/wire.wgsl
// (drawn_edges).

// Values of the debug view in a material's flags.
const DEBUG_BARYCENTRIC: u32 = 1u;
const DEBUG_MIN_BARYCENTRIC: u32 = 2u;
const DEBUG_EDGE_DISTANCE: u32 = 3u;
const DEBUG_NORMAL: u32 = 4u;
const DEBUG_UV: u32 = 5u;
const DEBUG_FACE_ORIENTATION: u32 = 6u;
const DEBUG_VERTEX_COLOR: u32 = 7u;

// The material's debug view at a point: opaque linear RGBA.
fn debug_color(view: u32, id: u32, at: vec2<f32>, m: u32, b: Barycentrics) -> vec4<f32> {
    let is_lit = (materials[m].flags & MATERIAL_LIT) != 0u;
    switch view {
        case DEBUG_BARYCENTRIC: { return shown(b.value); }
        case DEBUG_MIN_BARYCENTRIC: { return shown(vec3(3.0 * min(min(b.value.x, b.value.y), b.value.z))); }
        case DEBUG_EDGE_DISTANCE: {
            let px = select(vec3(8.0), edge_distances_px(corners_of(id, at)), drawn_edges(id));
            return shown(vec3(min(min(px.x, px.y), min(px.z, 8.0)) / 8.0));
        }
        case DEBUG_NORMAL: {
            if is_lit {
                let n = normal(id, at, m, b);
                let seen = vec3(dot3(n, frame.screen_right.xyz), dot3(n, frame.screen_up.xyz), dot3(n, frame.to_viewer.xyz));
                return shown(0.5 + rn3(0.5 * seen));
            }
        }
        case DEBUG_UV: {
            if has(UVS) {
                return shown(checker(uv_of(id, b, 0u).at));
            }
        }
        case DEBUG_FACE_ORIENTATION: {
            let paint = shown(select(vec3(0.86, 0.30, 0.26), vec3(0.36, 0.56, 0.86), b.front));
            if is_lit {
                return lit(paint, light(0.0, materials[m].roughness, normal(id, at, m, b)));
            }
            return paint;
        }
        case DEBUG_VERTEX_COLOR: {
            if has(VERTEX_COLORS) {
                return vec4(vertex_color(id, b).xyz, 1.0);
            }
        }
        default: {}
    }
    return shown(vec3(0.5));
}

// Eight squares a unit; u in red, v in green.
fn checker(at: vec2<f32>) -> vec3<f32> {
    let uv = bounded(at, 65536.0);
    let cell = vec2<i32>(floor(8.0 * uv));
    let bright = select(0.55, 1.0, ((cell.x + cell.y) & 1) == 0);
    return rn3(bright * vec3(0.2 + rn2(0.8 * (uv - floor(uv))), 0.45));
}

// The linear colour that is stored as these values: sRGB decoding (IEC 61966-2-1), the same bits on
// both back-ends.
fn shown(display: vec3<f32>) -> vec4<f32> {
    let v = clamp(display, vec3(0.0), vec3(1.0));
    let t = rn3((v + 0.055) * 0.9478673);
    // t^2.4 = (t t^(-1/5))^3, the root by Newton's iteration from an integer guess.
    var root = bitcast<vec3<f32>>(vec3(0x4C2C47E5u) - bitcast<vec3<u32>>(t) / 5u);
    for (var i = 0; i < 4; i++) {
        let square = rn3(root * root);
        root = rn3(root * (1.2 - rn3(rn3(0.2 * t) * rn3(rn3(square * square) * root))));
    }
    let part = rn3(t * root);
    let curve = rn3(rn3(part * part) * part);
    return vec4(select(curve, v * (1.0 / 12.92), v <= vec3(0.04045)), 1.0);
}
