//! Adaptive samples: which pictures have them, and how many samples the others get instead.

use crate::plan::context::PlanContext;
use crate::scene::Scene;
use crate::spec::Samples;
use crate::warning::Warning;

/// Samples per pixel of pictures that ask for adaptive ones and cannot have them.
const INSTEAD: u32 = 16;

/// The kinds of things that a plan draws.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// True if faces are filled, or an outline's triangles are.
    pub faces: bool,
    /// True if something is transparent.
    pub layers: bool,
}

/// Samples in every pixel, and true if mixed pixels are drawn from coverage points besides.
pub fn samples(scene: &Scene<'_, '_>, shown: Shown, cx: &mut PlanContext<'_>) -> (u32, bool) {
    let samples = scene.spec.image.samples;
    if let Samples::Fixed(samples) = samples {
        return (samples, false);
    }
    let reason = if !shown.faces {
        "no face is filled"
    } else if shown.layers {
        "something is transparent"
    } else {
        return (samples.per_pixel(), true);
    };
    let detail = format!("image.samples is adaptive, and {reason}: each pixel has {INSTEAD} samples instead");
    cx.warnings.push(Warning { code: "samples_fixed", detail });
    (INSTEAD, false)
}
