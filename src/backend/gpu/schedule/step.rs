//! What a [`Schedule`](crate::backend::gpu::schedule::Schedule) is made of, and for.

use crate::backend::gpu::pipelines::Kernel;

/// One command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Fills a band's samples (and ink) with zeros.
    ClearBand,
    /// Empties the work list.
    ClearWork,
    /// Empties the layer that is looked for.
    ClearLayer,
    /// Where the device must be waited for anyway, asks whether there is another layer behind this one, and if not, goes on
    /// at step `end`.
    EndLayer {
        /// Which.
        layer: u32,
        /// Index of the step after the last layer.
        end: usize,
    },
    /// Runs a kernel over `threads` threads with the batch at `batch`.
    Dispatch {
        /// Which.
        kernel: Kernel,
        /// Index of its numbers.
        batch: usize,
        /// How often.
        workgroups: [u32; 2],
    },
    /// Draws lines, in as many rounds as that takes.
    Lines {
        /// Index of its numbers.
        batch: usize,
        /// How often.
        workgroups: [u32; 2],
    },
    /// Draws the large triangles of the batch.
    Tiles {
        /// The kernel.
        kernel: Kernel,
        /// Index of its numbers.
        batch: usize,
    },
    /// Hands what was recorded to the device.
    Submit,
    /// The band is finished: its rows are copied out.
    EndBand(Band),
}

/// Rows of the picture that are drawn at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Band {
    /// First row, and the row after the last.
    pub rows: [u32; 2],
}

/// What is wanted of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// The picture.
    Picture,
    /// The visibility buffer alone.
    Samples,
    /// One layer alone.
    Layer(u32),
}
