// Where the visibility stage's samples go: into the visibility buffer.

fn emit(index: u32, z: f32, id: u32) {
    keep_nearest(index, z, id);
}
