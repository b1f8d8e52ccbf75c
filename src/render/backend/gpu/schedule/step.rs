//! The kinds of commands, called steps, that a [`Schedule`](super::Schedule) consists of, and its goal: what they
//! compute together, such as a picture or the visibility buffer alone.

use crate::backend::gpu::pipelines::Kernel;

/// One command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Clears a band's strokes and, unless a kernel has done so, its samples.
    ClearBand {
        /// True if no kernel has cleared the samples.
        samples: bool,
    },
    /// Empties the work list.
    ClearWork,
    /// Clears the peeled layer.
    ClearLayer,
    /// Reads whether there may be another layer and, if not, continues at step `end`. Only where
    /// rounds wait for the device anyway.
    EndLayer {
        /// Its index.
        layer: u32,
        /// Index of the step after the last layer.
        end: usize,
    },
    /// Clears what the points of mixed pixels see.
    ClearPoints,
    /// Reads how many mixed pixels there are and, if there are no more than so many, continues at step `end`.
    EndMixed {
        /// Mixed pixels that are drawn.
        drawn: u32,
        /// Index of the step after the last of them.
        end: usize,
    },
    /// Runs a kernel.
    Dispatch {
        /// The kernel.
        kernel: Kernel,
        /// Index of its batch.
        batch: usize,
        /// Workgroups in x and y.
        workgroups: [u32; 2],
    },
    /// Draws lines, in as many rounds as that takes.
    Lines {
        /// Index of its batch.
        batch: usize,
        /// Workgroups in x and y.
        workgroups: [u32; 2],
    },
    /// Draws the large triangles of the batch.
    Tiles {
        /// The kernel.
        kernel: Kernel,
        /// Index of its batch.
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

/// Result that a schedule computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// The picture.
    Picture,
    /// The colours of its pixels, which stage resolve puts over the background.
    Colors,
    /// The visibility buffer alone.
    Samples,
    /// One layer alone.
    Layer(u32),
}

impl Goal {
    /// True if all is drawn that a picture shows.
    pub fn is_shown(self) -> bool {
        matches!(self, Self::Picture | Self::Colors)
    }
}
