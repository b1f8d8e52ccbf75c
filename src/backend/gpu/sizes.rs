//! What a device allows, and how large buffers are: bytes a pixel, a sample, an item, and the rows that this leaves room for.

use super::step::Goal;
use crate::backend::DrawError;
use crate::plan::DrawPlan;

/// Largest buffer that holds a band of the picture, bytes.
const BAND_BYTES: u64 = 64 << 20;

/// The same for the visibility buffer, which wide lines look at far beyond their band.
const SEEN_BYTES: u64 = 256 << 20;

/// Bytes of the work list before its items.
const WORK_HEAD_BYTES: u64 = 16;

/// Bytes of one of its items.
const WORK_ITEM_BYTES: u64 = 48;

/// Bytes of what layers make of a sample.
pub const LAYERED_BYTES: u64 = 32;

/// Bytes of a sample of the visibility buffer, or of a layer.
pub const SAMPLE_BYTES: u64 = 8;

/// Bytes of a pixel's strokes: two sums, how often they have gone round, a bit for each of 256 points, and the most that an area
/// differs from its points'.
pub const STROKES_BYTES: u64 = 48;

/// Bytes of a pixel of lit lines: whose light falls on them.
pub const OWNER_BYTES: u64 = 4;

/// Bytes of a pixel of the picture.
const RGBA_BYTES: u64 = 4;

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

/// How the picture is cut into bands of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Banding {
    /// Rows of each band but the last.
    pub rows: u32,
    /// Rows beyond a band, above and below, that its lines look at.
    pub margin: u32,
}

impl Banding {
    /// So that no buffer is large or breaks the device's limit. Fails where the device has no room for a row and what its lines
    /// look at.
    pub fn new(plan: &DrawPlan<'_>, device: &DeviceTraits, goal: Goal) -> Result<Self, DrawError> {
        let width = u64::from(plan.width_px);
        let rows_in = |bytes: u64, pixel_bytes: u64| bytes.min(device.binding_bytes_max) / (width * pixel_bytes).max(1);
        let rows = rows_in(BAND_BYTES, pixel_bytes(plan)).min(u64::from(plan.height_px)).max(1);
        let beyond = if goal == Goal::Picture { plan.line_margin_rows() } else { 0 };
        let seen = rows_in(SEEN_BYTES, seen_bytes(plan));
        if rows >= u64::from(plan.height_px) && rows <= seen {
            return Ok(Self { rows: rows as u32, margin: 0 });
        }
        let room = seen.saturating_sub(2 * u64::from(beyond));
        if room == 0 {
            let why = "the device has no room for what lines so wide look at in a picture so wide";
            return Err(DrawError::Device(why.to_owned()));
        }
        Ok(Self { rows: rows.min(room) as u32, margin: beyond })
    }

    /// Rows that the visibility buffer holds.
    pub fn seen_rows(&self, plan: &DrawPlan<'_>) -> u32 {
        (self.rows + 2 * self.margin).min(plan.height_px)
    }

    /// Bytes of all buffers that hold a band.
    pub fn bytes(&self, plan: &DrawPlan<'_>) -> u64 {
        let seen = if has_visibility(plan) { seen_bytes(plan) } else { 0 };
        let layers = if plan.layers().is_some() { LAYERED_BYTES + SAMPLE_BYTES } else { 0 };
        let (strokes, owners) = if plan.lines.is_empty() { (0, 0) } else { (STROKES_BYTES, OWNER_BYTES) };
        let pixel = u64::from(plan.samples) * layers + color_bytes(plan) + strokes + owners + RGBA_BYTES;
        let width = u64::from(plan.width_px);
        width * (u64::from(self.seen_rows(plan)) * seen + u64::from(self.rows) * pixel)
    }
}

/// Bytes of all buffers that hold a band, on a device that allows whatever is asked of it.
pub fn bands_bytes(plan: &DrawPlan<'_>) -> u64 {
    let device = DeviceTraits {
        binding_bytes_max: u64::MAX,
        workgroups_max: u32::MAX,
        tile_workgroups: 1,
        int64_atomics: true,
        loops_are_limited: false,
    };
    // Buffers are made a quarter larger than they need to be.
    Banding::new(plan, &device, Goal::Picture).map_or(0, |banding| banding.bytes(plan) / 4 * 5)
}

/// Whether a plan needs the sample buffer at all.
pub fn has_visibility(plan: &DrawPlan<'_>) -> bool {
    plan.surface.is_some() || plan.hull.is_some()
}

/// Samples of so many rows.
pub fn samples(plan: &DrawPlan<'_>, rows: u32) -> u64 {
    u64::from(plan.width_px) * u64::from(rows) * u64::from(plan.samples)
}

/// Bytes a pixel of colours: the surface's, then everything's, and the light on lines where they are lit.
pub fn color_bytes(plan: &DrawPlan<'_>) -> u64 {
    if plan.lights_lines() { 32 } else { 16 }
}

/// Bytes of a work list.
pub fn work_bytes(items: u32) -> u64 {
    WORK_HEAD_BYTES + u64::from(items) * WORK_ITEM_BYTES
}

/// Bytes a pixel of the visibility buffer.
fn seen_bytes(plan: &DrawPlan<'_>) -> u64 {
    u64::from(plan.samples) * SAMPLE_BYTES
}

/// Bytes a pixel of the largest buffer that holds a band.
fn pixel_bytes(plan: &DrawPlan<'_>) -> u64 {
    let strokes = if plan.lines.is_empty() { 0 } else { STROKES_BYTES };
    let sample = if plan.layers().is_some() { LAYERED_BYTES } else { SAMPLE_BYTES };
    (u64::from(plan.samples) * sample).max(color_bytes(plan)).max(strokes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::gpu::test_plans::{Case, DEVICE, each_case};

    /// All buffers that hold a band, whatever is drawn.
    const ALL_BYTES_MAX: u64 = 512 << 20;

    #[test]
    fn bands_never_take_more_than_they_may() {
        let (mut cases, mut refused) = (0, 0);
        each_case(|plan, case| {
            assert!(bands_bytes(plan) <= ALL_BYTES_MAX / 4 * 5, "{case:?}");
            let small = DeviceTraits { binding_bytes_max: 128 << 20, ..DEVICE };
            for device in [DeviceTraits { binding_bytes_max: 4 << 30, ..DEVICE }, small] {
                cases += 1;
                let Ok(banding) = Banding::new(plan, &device, Goal::Picture) else {
                    refused += 1;
                    let Case { samples: at, width_px, .. } = case;
                    assert!(at > 8 && width_px > 80.0 && device.binding_bytes_max < 256 << 20, "{case:?}");
                    continue;
                };
                assert!(banding.bytes(plan) <= ALL_BYTES_MAX, "{}: {banding:?} {case:?}", banding.bytes(plan));
                assert!(samples(plan, banding.seen_rows(plan)) * SAMPLE_BYTES <= device.binding_bytes_max);
                assert!(banding.rows >= 1 && banding.rows <= plan.height_px);
                // What lies beyond a band is there in whole, unless the band is all there is.
                assert!(banding.margin == plan.line_margin_rows() || banding.rows == plan.height_px, "{case:?}");
            }
        });
        assert!(cases >= 500 && refused < cases / 20, "{refused} of {cases} refused");
    }
}
