// Stage shade, per sample: the state of depth peeling. Twin of src/backend/cpu/peeling/state.rs.
// Written by composite.wgsl, read by emit_layer.wgsl, shade.wgsl and coverage.wgsl.

struct PeelState {
    // Premultiplied linear RGBA.
    color: vec4<f32>,
    // The word of the previous layer; 0 where the sample is finished.
    previous: vec2<u32>,
    // Materials of its layers, one bit each, modulo 32.
    materials: u32,
    // The triangle id of the previous layer, or NOTHING.
    taken: u32,
};
