//! Made-up plans for tests of buffer sizes and schedules: pictures from one pixel to the largest, with 1 to 16
//! samples per pixel, with thin and wide lines, with and without transparent layers.

use std::sync::Arc;

use super::sizes::{ALONE_SIZE, DeviceTraits};
use crate::plan::{DrawPlan, Edge, Faces, LinePass, PeelingPass, Projection, Shown, SurfacePass, pass_mask};

/// A software adapter.
pub const DEVICE: DeviceTraits = DeviceTraits {
    binding_bytes_max: 128 << 20,
    workgroups_max: 65_535,
    tile_workgroups: 64,
    alone_size_of_few: ALONE_SIZE,
    maps_pictures: false,
    int64_atomics: false,
    loops_are_limited: true,
    has_pixel_lists: true,
};

/// Properties of a test plan.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    pub size_px: [u32; 2],
    pub samples: u32,
    pub is_peeled: bool,
    pub passes: usize,
    pub width_px: f32,
    pub shown: Shown,
    /// Pixels beyond the picture.
    pub beyond: u32,
}

/// The largest picture at 4 samples, with thin lines that nothing hides.
pub const LARGEST: Case =
    Case { size_px: [4096; 2], samples: 4, is_peeled: true, passes: 1, width_px: 1.0, shown: Shown::All, beyond: 0 };

/// Some lines of a width, lit.
pub fn lines(edges: Arc<Vec<Edge>>, width_px: f32, shown: Shown) -> LinePass {
    LinePass { smoothing_px: 1.0, shown, lit: true, is_tinted: true, ..LinePass::new(edges, width_px) }
}

/// A list of edges that do not matter.
pub fn edges(count: u32) -> Arc<Vec<Edge>> {
    Arc::new((0..count).map(|v| Edge { vertices: [v, v + 1], faces: [Edge::NO_FACE; 2] }).collect())
}

/// A plan of these triangles, all clipped, under passes over one list of edges.
pub fn plan<'a>(triangles: &'a [[u32; 3]], case: Case) -> DrawPlan<'a> {
    let row = [0.0; 4];
    let [x, y, z, w] = [row; 4];
    let [to_viewer, screen_up, screen_right] = [[0.0; 3]; 3];
    let clip = Projection { x, y, z, w, near_w: 0.1, clip: true, to_viewer, screen_up, screen_right };
    let mut plan = DrawPlan::new(case.size_px, &[[0.0; 3]], triangles, clip);
    plan.samples = case.samples;
    plan.margin_px = case.beyond;
    plan.surface = Some(SurfacePass { is_shaded: true, ..SurfacePass::new(Faces::Both, Vec::new()) });
    if case.is_peeled {
        plan.pass_masks = vec![pass_mask::SURFACE | pass_mask::LAYER; triangles.len()].into();
        plan.peeling = Some(PeelingPass { count_max: 16, behind_surface: false, wires_only: false, fade: 1.0 });
    }
    plan.lines = vec![lines(edges(3), case.width_px, case.shown); case.passes];
    plan
}

/// Calls `each` with all that differ in what sizes depend on.
pub fn each_case(mut each: impl FnMut(&DrawPlan<'_>, Case)) {
    for size_px in [[4096, 4096], [4096, 100], [100, 4096], [1, 1], [640, 480]] {
        for samples in [1, 4, 8, 16] {
            for (width_px, shown) in
                [(1.0, Shown::All), (100.0, Shown::All), (9.0, Shown::Faded), (100.0, Shown::Visible)]
            {
                for (is_peeled, passes) in [(false, 1), (true, 1), (false, 128), (true, 0)] {
                    let mut case = Case { size_px, samples, is_peeled, passes, width_px, shown, beyond: 0 };
                    each(&plan(&[[0; 3]], case), case);
                    if samples == if is_peeled { 16 } else { 4 } {
                        let mut adaptive = plan(&[[0; 3]], case);
                        adaptive.is_adaptive = true;
                        each(&adaptive, case);
                    }
                    case.beyond = plan(&[[0; 3]], case).line_margin_rows();
                    if case.beyond > 0 {
                        each(&plan(&[[0; 3]], case), case);
                    }
                }
            }
        }
    }
}
