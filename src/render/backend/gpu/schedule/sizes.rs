//! The sizes of the GPU buffers for a picture, and the number of pixel rows in a band (the part of a picture that is
//! drawn at a time), which follows from these sizes and the limits of the device.

use super::step::Goal;
use crate::backend::DrawError;
use crate::backend::sample_partition::POINTS;
use crate::plan::{DrawPlan, TINTS};

/// Largest buffer that holds a band of the picture, bytes.
const BAND_BYTES: u64 = 64 << 20;

/// The same for the visibility buffer, which hidden-line removal of wide lines reads far beyond
/// their band.
const SEEN_BYTES: u64 = 256 << 20;

/// Bytes of the work list before its items: the numbers of large and of huge ones, for each job of a gang.
pub const WORK_HEAD_BYTES: u64 = 8 * JOBS_MAX as u64;

/// Jobs in a gang, at most.
pub const JOBS_MAX: usize = 16;

/// Bytes of one of its items.
pub const WORK_ITEM_BYTES: u64 = 48;

/// Bytes of a sample's state of depth peeling.
pub const PEEL_STATE_BYTES: u64 = 32;

/// Bytes of a sample of the visibility buffer or of a peeled layer.
pub const SAMPLE_BYTES: u64 = 8;

/// Bytes of a pixel's strokes: two sums, how often they have gone round, a bit for each of 256
/// points, the most that an area differs from its points', the area of holes, and what whole edges cover.
pub const STROKES_BYTES: u64 = 56;

/// Bytes per pixel that name the face by which the pixel's lines are lit.
const OWNER_BYTES: u64 = 4;
/// Bytes per pixel of the depth of a line that layers tint.
const DEPTH_BYTES: u64 = 4;

/// Bytes at the start of the buffer of mixed pixels: their number, and what shaders/mixed/place.wgsl says.
pub const MIXED_HEAD_BYTES: u64 = 16;

/// Mixed pixels whose points are in memory at a time, at most: 64 MiB.
const SLOTS_MAX: u32 = 1 << 15;

/// Items in the lists of mixed pixels: for each pixel of the band, and the least and the most in all. 512 x 512 pixels
/// have a million.
const ITEMS_PER_PIXEL: u32 = 4;
const LIST_ITEMS_MIN: u32 = 1 << 18;
const LIST_ITEMS_MAX: u32 = 1 << 20;

/// Parts of the colours of mixed pixels, at most; four times as many where each quarter of a pixel has its own.
const PARTS_MAX: u32 = 1 << 18;

/// Bytes of such an item, and of a part.
const LIST_ITEM_BYTES: u64 = 64;
const PART_BYTES: u64 = 32;

/// Bytes of a pixel of the picture.
const RGBA_BYTES: u64 = 4;

/// Limits and properties of a device.
#[derive(Clone, Copy, Debug)]
pub struct DeviceTraits {
    /// Largest buffer that can be bound, bytes.
    pub binding_bytes_max: u64,
    /// Workgroups in one direction.
    pub workgroups_max: u32,
    /// Workgroups that share the large triangles.
    pub tile_workgroups: u32,
    /// Size of the largest triangle that a thread draws by itself where there are few, 1/256 px.
    pub alone_size_of_few: i32,
    /// True if the picture is written to where the CPU reads it.
    pub maps_pictures: bool,
    /// 64-bit atomics.
    pub int64_atomics: bool,
    /// True if a thread's loops are cut off after a number of iterations: see
    /// [`Tiles`](super::tiles::Tiles).
    pub loops_are_limited: bool,
    /// True if mixed pixels have lists of triangles, for which there may be no room; otherwise what each of their
    /// points sees is kept.
    pub has_pixel_lists: bool,
}

/// The size of the largest triangle that a thread may draw by itself, 1/256 px: its edge values fit 32 bits.
pub const ALONE_SIZE: i32 = 4096;

/// Division of the picture into bands of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Banding {
    /// Rows of each band but the last.
    pub rows: u32,
    /// Rows beyond a band, above and below, that hidden-line removal reads.
    pub margin: u32,
    /// Pixels beyond the picture, on each side, of which the visibility buffer holds those that are
    /// in a band's rows and margins.
    pub beyond: u32,
    /// True if mixed pixels have lists.
    pub has_pixel_lists: bool,
}

impl Banding {
    /// Bands in which no buffer is large or exceeds the device's limit. Fails if the device has no
    /// room for a row and the rows that its lines read in the picture. If only those beyond the
    /// picture have no room, they are left out: a line at the border that something beyond it hides
    /// may then show.
    pub fn new(plan: &DrawPlan<'_>, device: &DeviceTraits, goal: Goal) -> Result<Self, DrawError> {
        if !goal.is_shown() {
            return Self::with_margin(plan, device, [0, 0]);
        }
        let margin = plan.margin_rows();
        Self::with_margin(plan, device, [margin, plan.margin_px])
            .or_else(|_| Self::with_margin(plan, device, [margin, 0]))
    }

    /// The same with so many rows beyond a band, and pixels beyond the picture.
    fn with_margin(plan: &DrawPlan<'_>, device: &DeviceTraits, [margin, beyond]: [u32; 2]) -> Result<Self, DrawError> {
        let rows_in = |bytes: u64, row_bytes: u64| bytes.min(device.binding_bytes_max) / row_bytes.max(1);
        let rows = rows_in(BAND_BYTES, u64::from(plan.width_px) * pixel_bytes(plan));
        let rows = rows.min(u64::from(plan.height_px)).max(1);
        let seen = rows_in(SEEN_BYTES, u64::from(plan.width_px + 2 * beyond) * seen_bytes(plan));
        let has_pixel_lists = device.has_pixel_lists;
        let whole = Self { rows: plan.height_px, margin: margin.min(beyond), beyond, has_pixel_lists };
        if rows >= u64::from(plan.height_px) && u64::from(whole.seen_rows(plan)) <= seen {
            return Ok(whole);
        }
        let room = seen.saturating_sub(2 * u64::from(margin));
        if room == 0 {
            let why = "the device has no room for what lines so wide look at in a picture so wide";
            return Err(DrawError::BeyondGpu(why.to_owned()));
        }
        Ok(Self { rows: rows.min(room) as u32, margin, beyond, has_pixel_lists })
    }

    /// Columns of the visibility buffer.
    pub fn seen_columns(&self, plan: &DrawPlan<'_>) -> u32 {
        plan.width_px + 2 * self.beyond
    }

    /// Rows that it holds.
    pub fn seen_rows(&self, plan: &DrawPlan<'_>) -> u32 {
        (self.rows + 2 * self.margin).min(plan.height_px + 2 * self.beyond)
    }

    /// Samples that it holds.
    pub fn seen_samples(&self, plan: &DrawPlan<'_>) -> u64 {
        u64::from(self.seen_columns(plan)) * u64::from(self.seen_rows(plan)) * u64::from(plan.samples)
    }

    /// Bytes of all buffers that hold a band.
    pub fn bytes(&self, plan: &DrawPlan<'_>) -> u64 {
        let seen = if has_visibility(plan) { self.seen_samples(plan) * SAMPLE_BYTES } else { 0 };
        let layers = if plan.peeling().is_some() { PEEL_STATE_BYTES + SAMPLE_BYTES } else { 0 };
        let strokes = if plan.lines.is_empty() { 0 } else { STROKES_BYTES };
        let pixel = u64::from(plan.samples) * layers + color_bytes(plan) + strokes + owner_bytes(plan) + RGBA_BYTES;
        let seen = seen + self.mixed_bytes(plan) + self.points_bytes(plan) + self.lists_bytes(plan);
        seen + u64::from(plan.width_px) * u64::from(self.rows) * pixel
    }
}

impl Banding {
    /// Mixed pixels whose points are in memory at a time.
    pub fn slots(&self, plan: &DrawPlan<'_>) -> u32 {
        SLOTS_MAX.min(plan.width_px * self.rows)
    }

    /// Bytes of what is known of a band's mixed pixels.
    pub fn mixed_bytes(&self, plan: &DrawPlan<'_>) -> u64 {
        let [width, rows] = [plan.width_px, self.rows].map(u64::from);
        let border = if plan.lines.is_empty() { 0 } else { POINTS as u64 / 32 };
        let words = (4 + border) * width * rows + (width + 2) * (rows + 2);
        if plan.has_mixed() { MIXED_HEAD_BYTES + 4 * words } else { 0 }
    }

    /// Bytes of what the points of some of them see.
    pub fn points_bytes(&self, plan: &DrawPlan<'_>) -> u64 {
        let slot = POINTS as u64 * SAMPLE_BYTES;
        if plan.has_mixed() && !self.has_pixel_lists { u64::from(self.slots(plan)) * slot } else { 0 }
    }

    /// Items in the lists of mixed pixels that there is room for.
    pub fn list_capacity(&self, plan: &DrawPlan<'_>) -> u32 {
        let wanted = (plan.width_px * self.rows).saturating_mul(ITEMS_PER_PIXEL).clamp(LIST_ITEMS_MIN, LIST_ITEMS_MAX);
        if plan.has_mixed() && self.has_pixel_lists { wanted } else { 0 }
    }

    /// Parts of their colours that there is room for.
    pub fn part_capacity(&self, plan: &DrawPlan<'_>) -> u32 {
        let quarters = if plan.has_quarters() { 4 } else { 1 };
        quarters * self.list_capacity(plan).min(PARTS_MAX)
    }

    /// Bytes of the lists and parts.
    pub fn lists_bytes(&self, plan: &DrawPlan<'_>) -> u64 {
        LIST_ITEM_BYTES * u64::from(self.list_capacity(plan)) + PART_BYTES * u64::from(self.part_capacity(plan))
    }
}

/// Bytes of all buffers that hold a band, on a device without limits.
pub fn bands_bytes(plan: &DrawPlan<'_>) -> u64 {
    let device = DeviceTraits {
        binding_bytes_max: u64::MAX,
        workgroups_max: u32::MAX,
        tile_workgroups: 1,
        alone_size_of_few: ALONE_SIZE,
        maps_pictures: false,
        int64_atomics: true,
        loops_are_limited: false,
        has_pixel_lists: true,
    };
    // Buffers are made a quarter larger than they need to be.
    Banding::new(plan, &device, Goal::Picture)
        .map_or(0, |banding| (banding.bytes(plan) + occlusion_bytes(plan)) / 4 * 5)
}

/// Bytes of the occlusion stage per pixel: a place, and what is found there.
pub const OCCLUSION_BYTES: u64 = 8;

/// Bytes of the occlusion stage, of the whole picture.
pub fn occlusion_bytes(plan: &DrawPlan<'_>) -> u64 {
    let pixels = u64::from(plan.width_px) * u64::from(plan.height_px);
    if plan.occlusion.is_some() { pixels * OCCLUSION_BYTES } else { 0 }
}

/// True if a plan needs the visibility buffer.
pub fn has_visibility(plan: &DrawPlan<'_>) -> bool {
    plan.surface.is_some() || plan.hull.is_some()
}

/// True if one kernel makes the picture of the visibility buffer: nothing is drawn over the surface.
pub fn is_painted(plan: &DrawPlan<'_>) -> bool {
    let has_more = !plan.lines.is_empty() || plan.peeling().is_some() || plan.occlusion.is_some();
    plan.is_shaded() && !has_more && !plan.has_mixed()
}

/// Samples of so many rows.
pub fn samples(plan: &DrawPlan<'_>, rows: u32) -> u64 {
    u64::from(plan.width_px) * u64::from(rows) * u64::from(plan.samples)
}

/// Bytes per pixel of colours: the surface's, then everything's, the light on lines where they are lit, and what tints
/// them (shaders/peeling/tints.wgsl).
pub fn color_bytes(plan: &DrawPlan<'_>) -> u64 {
    let vectors = match () {
        _ if plan.tints_lines() => 2 + TINTS + 2,
        _ if plan.lights_lines() => 2,
        _ => 1,
    };
    16 * vectors as u64
}

/// Bytes per pixel of what is known of its nearest line.
pub fn owner_bytes(plan: &DrawPlan<'_>) -> u64 {
    match () {
        _ if plan.tints_lines() => OWNER_BYTES + DEPTH_BYTES,
        _ if plan.lights_lines() => OWNER_BYTES,
        _ => 0,
    }
}

/// Bytes of a work list.
pub fn work_bytes(items: u32) -> u64 {
    WORK_HEAD_BYTES + u64::from(items) * WORK_ITEM_BYTES
}

/// Bytes per pixel of the visibility buffer.
fn seen_bytes(plan: &DrawPlan<'_>) -> u64 {
    u64::from(plan.samples) * SAMPLE_BYTES
}

/// Bytes per pixel of the largest buffer that holds a band.
fn pixel_bytes(plan: &DrawPlan<'_>) -> u64 {
    let strokes = if plan.lines.is_empty() { 0 } else { STROKES_BYTES };
    let sample = if plan.peeling().is_some() { PEEL_STATE_BYTES } else { SAMPLE_BYTES };
    (u64::from(plan.samples) * sample).max(color_bytes(plan)).max(strokes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::gpu::schedule::test_plans::{Case, DEVICE, each_case};

    /// All buffers that hold a band, whatever is drawn.
    const ALL_BYTES_MAX: u64 = 512 << 20;

    #[test]
    fn bands_never_take_more_than_they_may() {
        let (mut cases, mut refused, mut without, mut mixed) = (0, 0, 0, 0);
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
                assert!(banding.seen_samples(plan) * SAMPLE_BYTES <= device.binding_bytes_max);
                assert!(banding.mixed_bytes(plan) <= device.binding_bytes_max, "{case:?}");
                assert!(banding.lists_bytes(plan) <= device.binding_bytes_max, "{case:?}");
                let again = Banding { has_pixel_lists: false, ..banding };
                assert!(again.points_bytes(plan) <= device.binding_bytes_max, "{case:?}");
                assert!(again.bytes(plan) <= ALL_BYTES_MAX, "{case:?}");
                mixed += usize::from(banding.lists_bytes(plan) > 0 && again.points_bytes(plan) > 0);
                assert!(banding.rows >= 1 && banding.rows <= plan.height_px);
                // The margin is complete unless one band is the whole picture.
                let is_all = banding.rows == plan.height_px && banding.beyond == 0;
                assert!(banding.margin == plan.margin_rows() || is_all, "{case:?}");
                if banding.beyond < case.beyond {
                    without += 1;
                    assert!(case.samples > 8 && case.width_px > 80.0 && device.binding_bytes_max < 256 << 20);
                }
            }
        });
        assert!(mixed > 20, "{mixed} plans have mixed pixels");
        assert!(cases >= 500 && refused < cases / 20, "{refused} of {cases} refused");
        assert!(without < cases / 20, "{without} of {cases} without what is beyond the picture");
    }
}
