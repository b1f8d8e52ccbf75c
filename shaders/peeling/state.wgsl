// The state of depth peeling that is kept for each sample from one transparent layer to the next (stage peeling): the
// colour of the layers so far, the last layer's triangle and depth, and the materials seen. Twin of
// src/render/backend/cpu/peeling/state.rs. Written by composite.wgsl, read by emit_layer.wgsl, mixed_pixels.wgsl,
// shade.wgsl and coverage.wgsl.
//
// Uses: nothing.

// Alpha below which a surface is ignored: a tenth of a byte's last step in the most transparent
// pictures.
const ALPHA_MIN: f32 = 1e-4;

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
