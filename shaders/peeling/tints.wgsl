// The indices in the buffer `colors` at which composite.wgsl keeps the colours and depths of transparent layers,
// per pixel (stage peeling). coverage.wgsl reads them to tint the lines that lie behind these layers. Twin of
// src/render/backend/cpu/peeling/tints.rs.
//
// Both kernels declare `colors`. It holds five things one after the other, each for all pixels of the band of rows
// that is being drawn: the colours, the light on lines, the colour that each layer adds (from the fourth on, all
// count as one), the layers' depths, and their steepness (the slope of the depth on screen).
//
// Uses: common.wgsl (has, LINES), one_job.wgsl (batch, frame).

// Layers that are told apart. All from the last of these on count as one, as far away as the
// farthest of them.
const TINTS: u32 = 4u;

// The steepness of a triangle that is seen from the edge: it is in front of nothing.
const EDGE_ON: f32 = 1e30;

// True if layers tint some lines.
fn keeps_tints() -> bool {
    return has(LINES) && frame.has_tints != 0u;
}

// The place of the colour that a layer adds to pixel i, premultiplied linear RGBA.
fn tint_at(i: u32, layer: u32) -> u32 {
    return (2u + layer) * batch.count + i;
}

// The place of the layers' depths, the farthest of each; 0 where there is none.
fn tint_depths_at(i: u32) -> u32 {
    return (2u + TINTS) * batch.count + i;
}

// The place of the greatest of their changes of depth per 1/256 px.
fn tint_steepness_at(i: u32) -> u32 {
    return (3u + TINTS) * batch.count + i;
}
