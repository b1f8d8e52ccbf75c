// Stage shade, per pixel: where composite.wgsl keeps what layers add to a pixel, and coverage.wgsl finds it. Twin of
// src/backend/cpu/peeling/tints.rs. Both declare `colors`, which holds, for all pixels of the band each: colours, the light
// on lines, what each layer adds, and the layers' depths.

// Layers that are told apart. All from the last of these on count as one, as far away as the farthest of them.
const TINTS: u32 = 4u;

// True if layers tint some lines.
fn keeps_tints() -> bool {
    return has(LINES) && frame.tint_reach > 0.0;
}

// The place of what a layer adds to pixel i, premultiplied linear RGBA.
fn tint_at(i: u32, layer: u32) -> u32 {
    return (2u + layer) * batch.count + i;
}

// The place of the layers' depths: the farthest that each may be within a line's reach, 0 where there is none.
fn tint_depths_at(i: u32) -> u32 {
    return (2u + TINTS) * batch.count + i;
}
