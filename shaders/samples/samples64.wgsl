// The nearest triangle of a sample, kept with 64-bit atomics (stage visibility). One word holds the depth and,
// below it, the complement of the id. Its maximum is the nearest depth and, of equal depths, the lowest id.
//
// Uses: nothing.

@group(1) @binding(4) var<storage, read_write> samples: array<atomic<u64>>;

fn keep_nearest(index: u32, z: f32, id: u32) {
    atomicMax(&samples[index], (u64(bitcast<u32>(z)) << 32u) | u64(~id));
}
