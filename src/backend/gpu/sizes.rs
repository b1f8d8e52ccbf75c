//! What a device allows, and how large buffers are: bytes a pixel, a sample, an item, and the rows that this leaves room for.

use super::step::Goal;
use crate::plan::DrawPlan;

/// Largest buffer that depends on the picture's size, bytes; but where wide lines look far beyond a band it may be as large as the
/// device binds.
const BAND_BYTES: u64 = 64 << 20;

/// Bytes of the work list before its items.
const WORK_HEAD_BYTES: u64 = 16;

/// Bytes of one of its items.
const WORK_ITEM_BYTES: u64 = 48;

/// Bytes of what layers make of a sample.
pub const LAYERED_BYTES: u64 = 32;

/// Bytes of a sample of the visibility buffer, or of a layer.
pub const SAMPLE_BYTES: u64 = 8;

/// What a device allows, and which way it goes.
#[derive(Clone, Copy, Debug)]
pub struct DeviceTraits {
    /// Largest buffer that can be bound, bytes.
    pub binding_bytes_max: u64,
    /// Workgroups in one direction.
    pub workgroups_max: u32,
    /// Workgroups that share the large triangles.
    pub tile_workgroups: u32,
    /// 64-bit atomics.
    pub int64_atomics: bool,
    /// Whether a thread's loops are cut off after a while: see [`Tiles`](super::tiles::Tiles).
    pub loops_are_limited: bool,
}

/// Whether a plan needs the sample buffer at all.
pub fn has_visibility(plan: &DrawPlan<'_>) -> bool {
    plan.surface.is_some() || plan.hull.is_some()
}

/// Rows of a band, so that none of its buffers is large or breaks the device's limit.
pub fn band_rows(plan: &DrawPlan<'_>, device: &DeviceTraits) -> u32 {
    let row_bytes = u64::from(plan.width_px) * pixel_bytes(plan);
    let rows = |bytes: u64| bytes / row_bytes.max(1);
    // Where lines look beyond the band, as many rows in it as around it, if the device has room for them.
    let least = rows(device.binding_bytes_max).min(4 * u64::from(plan.line_margin_rows()));
    rows(BAND_BYTES.min(device.binding_bytes_max)).max(least).clamp(1, u64::from(plan.height_px.max(1))) as u32
}

/// Rows beyond a band that its lines look at. Where a row is so wide or has so many lines that hardly any fit a buffer, fewer
/// than they would: there something that is hidden by what lies beyond the band may show at its border.
pub fn margin_rows(plan: &DrawPlan<'_>, band_rows: u32, goal: Goal) -> u32 {
    if goal != Goal::Picture || band_rows >= plan.height_px {
        return 0;
    }
    plan.line_margin_rows().min(band_rows / 4)
}

/// Samples of so many rows.
pub fn samples(plan: &DrawPlan<'_>, rows: u32) -> u64 {
    u64::from(plan.width_px) * u64::from(rows) * u64::from(plan.samples)
}

/// Bytes a pixel of colours: the surface's, and the light on lines where they are lit.
pub fn color_bytes(plan: &DrawPlan<'_>) -> u64 {
    if plan.lights_lines() { 32 } else { 16 }
}

/// Bytes a pixel of ink: of each line pass, and whose light falls on lines where they are lit.
pub fn ink_bytes(plan: &DrawPlan<'_>) -> u64 {
    4 * (plan.lines.len() as u64 + u64::from(plan.lights_lines()))
}

/// Bytes of a pixel's strokes: two sums, and a bit for each of 256 points.
pub const STROKES_BYTES: u64 = 40;

/// Bytes of a work list.
pub fn work_bytes(items: u32) -> u64 {
    WORK_HEAD_BYTES + u64::from(items) * WORK_ITEM_BYTES
}

/// Bytes a pixel of the largest buffer that holds a band.
fn pixel_bytes(plan: &DrawPlan<'_>) -> u64 {
    let strokes = if plan.lines.is_empty() { 0 } else { STROKES_BYTES };
    let sample = if plan.layers().is_some() { LAYERED_BYTES } else { SAMPLE_BYTES };
    (u64::from(plan.samples) * sample).max(color_bytes(plan)).max(ink_bytes(plan)).max(strokes)
}
