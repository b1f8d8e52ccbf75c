//! Errors of commands, with their exit codes.

use meshsnap_render::backend::DrawError;
use meshsnap_render::import::MeshError;
use meshsnap_render::pipeline::RenderError;
use meshsnap_render::request::RequestError;

/// A sentence for standard error, and an exit code.
#[derive(Debug)]
pub struct CliError {
    /// The fault, its place, and what to do about it.
    pub sentence: String,
    /// 1 to 3; see [`crate`].
    pub exit_code: u8,
}

impl CliError {
    /// A fault of the mesh or the request.
    pub fn input(sentence: impl Into<String>) -> Self {
        Self { sentence: sentence.into(), exit_code: 1 }
    }

    /// A fault of the command line or the configuration.
    pub fn usage(sentence: impl Into<String>) -> Self {
        Self { sentence: sentence.into(), exit_code: 2 }
    }

    /// A fault of meshsnap or the machine.
    pub fn ours(sentence: impl Into<String>) -> Self {
        Self { sentence: sentence.into(), exit_code: 3 }
    }

    /// A failure whose sentences are printed already.
    pub fn silent(exit_code: u8) -> Self {
        Self { sentence: String::new(), exit_code }
    }

    /// Adds the name of the file that it is about.
    pub fn about(mut self, name: &str) -> Self {
        self.sentence = format!("{name}: {}", self.sentence);
        self
    }
}

impl From<RequestError> for CliError {
    fn from(error: RequestError) -> Self {
        Self::input(error.to_string())
    }
}

impl From<MeshError> for CliError {
    fn from(error: MeshError) -> Self {
        Self::input(error.to_string())
    }
}

impl From<RenderError> for CliError {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Mesh(_) | RenderError::Plan(_) => Self::input(error.to_string()),
            RenderError::Draw(DrawError::Stopped(_)) | RenderError::Stopped(_) | RenderError::Encode(_) => {
                Self::ours(error.to_string())
            }
            RenderError::Draw(detail) => Self::ours(format!("{detail}; try --backend cpu")),
        }
    }
}
