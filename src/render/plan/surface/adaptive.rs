//! The decision for adaptive samples: 4 samples in every pixel (16 if something is transparent), and
//! many more points in some pixels near which faces of different colours meet. Some pictures cannot
//! have them, for example those in which all faces are transparent. They get 16 samples in every pixel
//! instead, and a warning.

use crate::plan::PeelingPass;
use crate::plan::context::PlanContext;
use crate::scene::Scene;
use crate::spec::Samples;
use crate::warning::Warning;

/// The kinds of things that a plan draws.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// True if faces are filled, or an outline's triangles are.
    pub faces: bool,
    /// True if faces are filled and hide what lies behind them.
    pub has_opaque: bool,
    /// The layers, if something is transparent.
    pub layers: Option<PeelingPass>,
}

/// Samples in every pixel, and true if mixed pixels are drawn from coverage points besides.
pub fn samples(scene: &Scene<'_, '_>, shown: Shown, cx: &mut PlanContext<'_>) -> (u32, bool) {
    let samples = scene.spec.image.samples;
    if let Samples::Fixed(samples) = samples {
        return (samples, false);
    }
    let reason = match shown.layers {
        _ if !shown.faces => "no face is filled",
        None => return (samples.per_pixel(), true),
        Some(layers) if layers.wires_only => "wires show through faces",
        Some(_) if !shown.has_opaque => "all faces are transparent",
        Some(_) => return (Samples::LAYERED, true),
    };
    let many = Samples::LAYERED;
    let detail = format!("image.samples is adaptive, and {reason}: each pixel has {many} samples instead");
    cx.warnings.push(Warning { code: "samples_fixed", detail });
    (Samples::LAYERED, false)
}
