// The triangle that a sample of the visibility buffer keeps (stage visibility): the nearest of those that cover
// the sample. peeling/emit_layer.wgsl takes the place of this file where layers of transparent triangles are
// drawn.
//
// Uses: one_job.wgsl or gang.wgsl (batch), samples/samples.wgsl (sample_index),
// samples/samples32.wgsl or samples/samples64.wgsl (keep_nearest).

// True if triangles are drawn at all.
fn is_any_wanted() -> bool {
    return true;
}

fn emit(pixel: vec2<i32>, n: i32, z: f32, id: u32) {
    keep_nearest(batch.samples_at + sample_index(pixel.x, pixel.y, n), z, id);
}
