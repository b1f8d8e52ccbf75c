// The colours of the hull, the mesh of triangles beside silhouette edges that is drawn as the outline of a surface
// (stages peeling, shade and mixed). Also the id that stands for no triangle.
//
// Uses: common.wgsl (has, HULL_MATERIALS), one_job.wgsl or gang.wgsl (frame).

// Colours, then the materials of the surface's triangles and of the hull's.
@group(1) @binding(25) var<storage, read> hull_materials: array<u32>;

const NOTHING: u32 = 0xFFFFFFFFu;

// Material index of a triangle, of the surface or of the outline mesh.
fn hull_material(id: u32) -> u32 {
    if has(HULL_MATERIALS) {
        return hull_materials[4u * frame.hull_color_count + id];
    }
    return 0u;
}

fn hull_color(id: u32) -> vec4<f32> {
    if !has(HULL_MATERIALS) {
        return frame.hull_color;
    }
    let at = 4u * min(hull_material(id), frame.hull_color_count - 1u);
    return bitcast<vec4<f32>>(vec4(hull_materials[at], hull_materials[at + 1u], hull_materials[at + 2u], hull_materials[at + 3u]));
}
