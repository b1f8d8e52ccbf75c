//! Pictures in linear light, which the library offers: half floats instead of sRGB bytes. The GPU computes the
//! colours of the pixels in all stages but the last (resolve). They are read back as 32-bit floats, band by
//! band (a band is a range of pixel rows). The CPU lays them over the background, except where lines have blended it
//! in on the GPU, and rounds them to half floats.

use half::f16;

use super::pipelines::Slot;
use super::pipelines::key::{self, pipeline_key};
use super::recorder::Recorder;
use super::schedule::Schedule;
use super::schedule::sizes::DeviceTraits;
use super::schedule::step::{Band, Goal};
use super::{GpuRenderer, execute, traits, upload_geometry, upload_shading};
use crate::backend::{DrawError, DrawTimes, linear};
use crate::image::LinearImage;
use crate::limits::Deadline;
use crate::plan::DrawPlan;

impl GpuRenderer {
    /// Draws a picture in linear light with buffers of its own.
    pub(super) fn draw_linear_once(
        &mut self,
        plan: &DrawPlan<'_>,
        deadline: &Deadline,
    ) -> Result<LinearImage, DrawError> {
        self.draw_times = DrawTimes::default();
        deadline.check()?;
        let width = plan.width_px as usize;
        let mut rgba = vec![[f16::ZERO; 4]; width * plan.height_px as usize];
        let has_colors = !rgba.is_empty() && pipeline_key(plan) & (key::SURFACE | key::HULL | key::LINES) != 0;
        let mut rows = (0..).zip(rgba.chunks_mut(width.max(1)));
        if !has_colors {
            rows.for_each(|(row, out)| linear::write_row(plan, row, std::iter::repeat([0.0; 4]), out));
            return Ok(LinearImage { width_px: plan.width_px, height_px: plan.height_px, rgba });
        }
        let _drawing = self.gpu.begin_job();
        self.job(|gpu, buffers| {
            // Lists of mixed pixels may be too short. What each of their points sees always has room.
            let device = DeviceTraits { has_pixel_lists: false, ..traits(gpu) };
            let schedule = Schedule::new(plan, &device, Goal::Colors)?;
            gpu.make_pipelines(&schedule.kernels(), pipeline_key(plan))?;
            upload_geometry(gpu, buffers, plan, &schedule)?;
            upload_shading(gpu, buffers, plan, &schedule)?;
            let row_bytes = width * size_of::<[f32; 4]>();
            buffers.staging(&gpu.handles, u64::from(schedule.banding.rows) * row_bytes as u64)?;
            let mut recorder = Recorder::new(gpu, deadline, buffers, plan, &schedule.batches)?;
            execute(&mut recorder, plan, &schedule, |recorder, Band { rows: [first, end] }| {
                let size = u64::from(end - first) * row_bytes as u64;
                recorder.copy_out(Slot::Colors, 0, size, 0)?;
                recorder.read_staging(size, |bytes| {
                    for (colors, (row, out)) in bytes.chunks_exact(row_bytes).zip(&mut rows) {
                        let colors = colors.chunks_exact(size_of::<[f32; 4]>()).map(bytemuck::pod_read_unaligned);
                        linear::write_row(plan, row, colors, out);
                    }
                })
            })
        })?;
        Ok(LinearImage { width_px: plan.width_px, height_px: plan.height_px, rgba })
    }
}
