// The nearest triangle of a sample, kept without 64-bit atomics (stage visibility). This takes two phases, each
// over all triangles. The first finds the nearest depth. The second computes all depths again, and finds the
// lowest id of the triangles that have the nearest one. The memory is the same as with 64 bits: low word, high
// word.
//
// Uses: nothing.

@group(1) @binding(4) var<storage, read_write> samples: array<atomic<u32>>;

override PHASE: u32 = 0u;

fn keep_nearest(index: u32, z: f32, id: u32) {
    if PHASE == 0u {
        atomicMax(&samples[2u * index + 1u], bitcast<u32>(z));
    } else if atomicLoad(&samples[2u * index + 1u]) == bitcast<u32>(z) {
        atomicMax(&samples[2u * index], ~id);
    }
}
