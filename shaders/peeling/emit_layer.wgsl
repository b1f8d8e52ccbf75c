// The triangle that a sample keeps for a layer (stage peeling). Layers are what depth peeling finds of
// transparent surfaces, from front to back. Of the triangles that cover the sample, the nearest one behind the
// previous layer is kept. It must lie in front of the opaque surface, unless wires show through the surface. Twin
// of src/render/backend/cpu/peeling/emit_layer.rs.
//
// Uses: common.wgsl (BEHIND_SURFACE, has, sample_count), one_job.wgsl (batch), peeling/rounds.wgsl
// (is_peeling_done), peeling/state.wgsl (PeelState), samples/samples.wgsl (sample_index),
// samples/samples32.wgsl or samples/samples64.wgsl (keep_nearest).

// The visibility buffer; `samples` is bound to the layer.
@group(1) @binding(26) var<storage, read> base: array<vec2<u32>>;
@group(1) @binding(27) var<storage, read> peel_state: array<PeelState>;

// True if triangles are drawn at all.
fn is_any_wanted() -> bool {
    return !is_peeling_done();
}

fn emit(pixel: vec2<i32>, n: i32, z: f32, id: u32) {
    let index = sample_index(pixel.x, pixel.y, n);
    // The visibility buffer's rows may be longer.
    let longer = u32(2 * batch.seen_margin * (pixel.y - batch.row_first) * sample_count());
    let word = vec2(~id, bitcast<u32>(z));
    if batch.layer > 0u && !is_below(word, peel_state[index].previous) {
        return;
    }
    if !has(BEHIND_SURFACE) && !is_below(base[batch.samples_at + index + longer], word) {
        return;
    }
    keep_nearest(index, z, id);
}

fn is_below(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x < b.x);
}
