//! The progress of a job, for clients that follow its events: the step that it is at (waiting, reading the mesh, drawing,
//! encoding), and how many of its views are drawn.

use meshsnap_render::pipeline::Stage;

/// The step of its work that a worker is at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// Nothing yet: the job waits.
    #[default]
    Queued,
    /// Bytes become a mesh.
    Importing,
    /// The mesh becomes pictures.
    Drawing,
    /// Pictures become bytes.
    Encoding,
}

/// How far a job has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// The step.
    pub step: Step,
    /// Views that are drawn.
    pub drawn: u32,
    /// All views: several of a sheet.
    pub views: u32,
}

impl Step {
    /// All steps in order.
    pub const ALL: [Self; 4] = [Self::Queued, Self::Importing, Self::Drawing, Self::Encoding];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Importing => "importing",
            Self::Drawing => "drawing",
            Self::Encoding => "encoding",
        }
    }

    /// The step of this name; the first for any other.
    pub fn of_name(name: &str) -> Self {
        Self::ALL.into_iter().find(|step| step.name() == name).unwrap_or_default()
    }
}

impl Progress {
    /// A worker begins to draw so many views.
    pub fn begun(views: u32) -> Self {
        Self { step: Step::Importing, drawn: 0, views }
    }

    /// A stage has ended.
    pub fn after(self, stage: Stage) -> Self {
        match stage {
            Stage::Parse => Self { step: Step::Drawing, ..self },
            Stage::Render | Stage::Judge => {
                let drawn = self.drawn.saturating_add(1).min(self.views);
                let step = if drawn == self.views { Step::Encoding } else { Step::Drawing };
                Self { step, drawn, ..self }
            }
            // Other stages end no step.
            _ => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_counted_and_the_last_one_ends_the_drawing() {
        let begun = Progress { step: Step::Importing, drawn: 0, views: 2 };
        let stages =
            [Stage::Parse, Stage::Plan, Stage::Render, Stage::Plan, Stage::Render, Stage::Encode, Stage::Render];
        let mut now = begun;
        let seen: Vec<_> = stages
            .map(|stage| {
                now = now.after(stage);
                (now.step.name(), now.drawn)
            })
            .into();
        let expected = [
            ("drawing", 0),
            ("drawing", 0),
            ("drawing", 1),
            ("drawing", 1),
            ("encoding", 2),
            ("encoding", 2),
            ("encoding", 2),
        ];
        assert_eq!(seen, expected);
    }
}
