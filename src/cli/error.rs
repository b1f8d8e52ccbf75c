//! What a command has to complain about, and with which exit code.

use crate::backend::DrawError;
use crate::import::MeshError;
use crate::pipeline::RenderError;
use crate::request::RequestError;

/// One sentence for standard error, and how the process ends.
#[derive(Debug)]
pub struct Complaint {
    /// What is wrong, where, and what to do.
    pub sentence: String,
    /// 1, 2 or 3.
    pub exit_code: u8,
}

impl Complaint {
    /// The mesh or the request is at fault.
    pub fn input(sentence: impl Into<String>) -> Self {
        Self { sentence: sentence.into(), exit_code: 1 }
    }

    /// The command line or the configuration is at fault.
    pub fn usage(sentence: impl Into<String>) -> Self {
        Self { sentence: sentence.into(), exit_code: 2 }
    }

    /// We or the machine are at fault.
    pub fn ours(sentence: impl Into<String>) -> Self {
        Self { sentence: sentence.into(), exit_code: 3 }
    }

    /// The same, about a file.
    pub fn about(mut self, name: &str) -> Self {
        self.sentence = format!("{name}: {}", self.sentence);
        self
    }
}

impl From<RequestError> for Complaint {
    fn from(error: RequestError) -> Self {
        Self::input(error.to_string())
    }
}

impl From<MeshError> for Complaint {
    fn from(error: MeshError) -> Self {
        Self::input(error.to_string())
    }
}

impl From<RenderError> for Complaint {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Mesh(_) | RenderError::Plan(_) => Self::input(error.to_string()),
            RenderError::Draw(DrawError::Stopped(_))
            | RenderError::Stopped(_)
            | RenderError::Encode(_)
            | RenderError::Report(_) => Self::ours(error.to_string()),
            RenderError::Draw(detail) => Self::ours(format!("{detail}; try --backend cpu")),
        }
    }
}
