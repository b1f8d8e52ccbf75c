//! The printout of `render --explain`: the back-end that drew, the state of the GPU, the work that was left out and
//! why, and the time of each stage.

use std::time::Duration;

use meshsnap_render::backend::GpuStatus;
use meshsnap_render::pipeline::{DrawReport, Stage};

/// Prints what `--explain` asks for.
pub fn explain(report: &DrawReport, gpu: &GpuStatus, read: Duration, times: &[(Stage, Duration)], total: Duration) {
    say!("drawn by {}", report.backend.name());
    if let Some(selection) = &report.selection {
        let (error, time_ms) = (selection.expected_error, selection.expected_time_ms);
        say!("chosen: {selection}; expected error {error}/255, expected time {time_ms} ms");
    }
    let device = gpu.info.as_ref().map(|info| {
        let features = if info.features.is_empty() { "no optional features".into() } else { info.features.join(", ") };
        format!("{}, {}, {}, {features}", info.name, info.driver, info.device_type)
    });
    let parts = [Some(gpu.state.name().to_owned()), device, gpu.reason.clone()];
    say!("gpu: {}", parts.into_iter().flatten().collect::<Vec<_>>().join("; "));
    for skip in &report.skips {
        say!("skipped {}: {}", skip.kind, skip.why);
    }
    if report.draw_times.mixed_pixels > 0 {
        let why = "faces that differ in colour meet near them";
        say!("mixed pixels, drawn from 64 or 256 points each because {why}: {}", report.draw_times.mixed_pixels);
    }
    if report.short_chains > 0 {
        say!("lines left out, shorter than wire.min_length or outline.min_length: {}", report.short_chains);
    }
    say!("{:<6} {:9.3} ms", "read", read.as_secs_f64() * 1e3);
    for (stage, took) in times {
        say!("{:<6} {:9.3} ms", format!("{stage:?}").to_lowercase(), took.as_secs_f64() * 1e3);
        if *stage == Stage::Render {
            for (part, took) in report.draw_times.parts() {
                say!("  {:<12} {:9.3} ms", part.name(), took.as_secs_f64() * 1e3);
            }
        }
    }
    say!("{:<6} {:9.3} ms", "total", total.as_secs_f64() * 1e3);
}
