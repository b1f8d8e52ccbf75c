//! The properties of each kernel (a compute shader with one entry point, in one of its variants): the name of the
//! entry point, the files of shaders/ that its source consists of, its `override` constants, the buffer that is bound
//! at each binding, and whether several jobs can share its dispatches.

use super::key;
use super::prune::pruned;
use super::reflection::Reflection;
use super::shaders::{files_of, text_of};
use super::{Kernel, SampleTarget, SampleWrite, Slot};

impl Kernel {
    /// Name of the entry point, and of the file in shaders/.
    pub fn entry(self) -> &'static str {
        match self {
            Self::Transform => "transform",
            Self::Visibility { .. } => "visibility",
            Self::Clip => "clip",
            Self::Grid => "grid",
            Self::Gather => "gather",
            Self::Composite => "composite",
            Self::VisibilityTile { .. } => "visibility_tile",
            Self::VisibilityFew { .. } => "visibility_few",
            Self::Paint => "paint",
            Self::Shade => "shade",
            Self::Breaks => "breaks",
            Self::Thin => "thin",
            Self::MixedPixels => "mixed_pixels",
            Self::MixedColor => "mixed_color",
            Self::MixedParts => "mixed_parts",
            Self::MixedShade => "mixed_shade",
            Self::MixedSum => "mixed_sum",
            Self::Holes => "holes",
            Self::Tips => "tips",
            Self::Fringes => "fringes",
            Self::Edge => "edge",
            Self::Coverage => "coverage",
            Self::LineLight => "line_light",
            Self::Resolve => "resolve",
        }
    }

    /// The kernel's files, one after the other.
    pub fn source(self, is_of_gang: bool) -> String {
        self.files(is_of_gang).into_iter().map(text_of).collect()
    }

    /// The kernel's code, without what a pipeline with this key does not run.
    pub fn source_for(self, key: u32) -> String {
        pruned(&self.source(key & key::GANG != 0), key)
    }

    /// Bits of the key that the code depends on.
    pub fn key_bits(self, is_of_gang: bool) -> u32 {
        let bits = Reflection::of(self.entry(), &self.source(is_of_gang)).key_bits;
        bits | if is_of_gang { key::GANG } else { 0 }
    }

    /// The kernel's files in shaders/.
    pub fn files(self, is_of_gang: bool) -> Vec<&'static str> {
        let uniforms = if is_of_gang { "gang.wgsl" } else { "one_job.wgsl" };
        let (write, target) = match self {
            Self::Visibility { write, target } | Self::VisibilityTile { write, target } => (write, target),
            Self::VisibilityFew { write } => (write, SampleTarget::Visibility),
            _ => return files_of(self.entry(), &[uniforms]),
        };
        let write = match write {
            SampleWrite::Both => "samples/samples64.wgsl",
            SampleWrite::Depth | SampleWrite::Id => "samples/samples32.wgsl",
        };
        let target = match target {
            SampleTarget::Visibility => "samples/emit.wgsl",
            SampleTarget::Layer => "peeling/emit_layer.wgsl",
            SampleTarget::Points => "mixed/points.wgsl",
            SampleTarget::Lists => "mixed/lists.wgsl",
        };
        files_of(self.entry(), &[uniforms, write, target])
    }

    /// True if a gang's jobs can share it: then it asks for its job first.
    pub fn is_shared(self) -> bool {
        match self {
            Self::Transform | Self::VisibilityFew { .. } | Self::Paint => true,
            Self::Grid | Self::Gather | Self::Shade | Self::Resolve => true,
            Self::Visibility { target, .. } | Self::VisibilityTile { target, .. } => target == SampleTarget::Visibility,
            _ => false,
        }
    }

    /// Values of the kernel's `override` constants.
    pub fn constants(self, key: u32) -> Vec<(&'static str, f64)> {
        let key = ("PIPELINE_KEY", f64::from(key));
        match self {
            Self::Visibility { write, .. } | Self::VisibilityTile { write, .. } | Self::VisibilityFew { write } => {
                match write {
                    SampleWrite::Both => vec![key],
                    SampleWrite::Depth => vec![key, ("PHASE", 0.0)],
                    SampleWrite::Id => vec![key, ("PHASE", 1.0)],
                }
            }
            _ => vec![key],
        }
    }

    /// The buffer that is bound at a slot's number. Kernels that find a peeled layer write it where
    /// others write the visibility buffer, and read that where others read the layer. Those that find what points see
    /// write that there, too.
    pub fn bound_at(self, slot: Slot) -> Slot {
        match (self, slot) {
            (
                Self::Visibility { target: SampleTarget::Layer, .. }
                | Self::VisibilityTile { target: SampleTarget::Layer, .. },
                slot,
            ) => match slot {
                Slot::Samples => Slot::PeelLayer,
                Slot::PeelLayer => Slot::Samples,
                slot => slot,
            },
            (
                Self::Visibility { target: SampleTarget::Points, .. }
                | Self::VisibilityTile { target: SampleTarget::Points, .. },
                Slot::Samples,
            ) => Slot::Points,
            _ => slot,
        }
    }
}
