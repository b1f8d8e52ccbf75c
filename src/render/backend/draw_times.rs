//! The duration of each part of drawing, for reports. The parts are the stages, and three steps of the CPU back-end:
//! sorting into bands, colours of whole faces, rows to the encoder. Only peeling has no time of its own: it counts as
//! visibility or shade.

use std::time::Duration;

/// A stage of drawing that is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrawStage {
    /// Vertices to the screen.
    Transform,
    /// Triangles and edges into bands of rows.
    Sort,
    /// Colours of whole faces.
    FaceColors,
    /// Triangles into samples.
    Visibility,
    /// Depths to the light that hollows go without.
    Occlusion,
    /// Samples to colours; where no line is drawn over faces of one colour each, to bytes too.
    Shade,
    /// Pixels near which faces meet, once more.
    Mixed,
    /// Edges over colours.
    Lines,
    /// Colours to bytes.
    Resolve,
    /// Rows to the encoder, while those below are drawn.
    EncodeRows,
}

impl DrawStage {
    /// All of them, in order.
    pub const ALL: [Self; 10] = [
        Self::Transform,
        Self::Sort,
        Self::FaceColors,
        Self::Visibility,
        Self::Occlusion,
        Self::Shade,
        Self::Mixed,
        Self::Lines,
        Self::Resolve,
        Self::EncodeRows,
    ];

    /// The word used in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Transform => "transform",
            Self::Sort => "sort",
            Self::FaceColors => "face_colors",
            Self::Visibility => "visibility",
            Self::Occlusion => "occlusion",
            Self::Shade => "shade",
            Self::Mixed => "mixed",
            Self::Lines => "lines",
            Self::Resolve => "resolve",
            Self::EncodeRows => "encode_rows",
        }
    }
}

/// The duration of each stage of one picture, and how many of its pixels were mixed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DrawTimes {
    stages: [Duration; DrawStage::ALL.len()],
    /// Pixels that were drawn from coverage points; 0 unless samples are adaptive.
    pub mixed_pixels: u64,
}

impl DrawTimes {
    /// Adds to the duration of a stage.
    pub fn add(&mut self, stage: DrawStage, took: Duration) {
        self.stages[stage as usize] += took;
    }

    /// The duration of a stage.
    pub fn of(&self, stage: DrawStage) -> Duration {
        self.stages[stage as usize]
    }

    /// The stages that took time, in order. Empty if nothing was timed.
    pub fn parts(&self) -> impl Iterator<Item = (DrawStage, Duration)> {
        DrawStage::ALL.into_iter().zip(self.stages).filter(|(_, took)| !took.is_zero())
    }
}
