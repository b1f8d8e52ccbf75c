// What the layers have made of a sample so far. Written by layers.wgsl, read by emit_layer.wgsl, shade.wgsl and ink.wgsl.

struct PeelState {
    // Premultiplied linear RGBA.
    color: vec4<f32>,
    // The word of the last layer; 0 where the sample is done.
    previous: vec2<u32>,
    // Materials of its layers, a bit each, modulo 32.
    materials: u32,
    // The id that the last layer was taken for.
    taken: u32,
};
