//! Errors of making a plan: the picture takes more than is allowed, the file lacks the camera that the
//! request asks for, or the job was stopped. The program itself is never at fault.

use crate::limits::{Exhausted, LimitExceeded, Stopped};
use crate::scene::SceneError;

/// A mesh and a request that do not make a picture. The text is safe to show to clients.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The picture takes more than is allowed.
    #[error(transparent)]
    Limit(#[from] LimitExceeded),
    /// The request asks for the file's camera, and there is none.
    #[error("`camera.from_file` is true, and the file has no camera")]
    NoCamera,
    /// The job's time was up, or it was cancelled.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl PlanError {
    /// The stable code under which programs know it. Limits and deadlines have codes that do not depend on the plan.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Limit(_) => "limit",
            Self::NoCamera => "no_camera",
            Self::Stopped(_) => "deadline",
        }
    }
}

impl From<SceneError> for PlanError {
    fn from(error: SceneError) -> Self {
        match error {
            SceneError::Limit(limit) => Self::Limit(limit),
            SceneError::NoCamera => Self::NoCamera,
        }
    }
}

impl From<Exhausted> for PlanError {
    fn from(exhausted: Exhausted) -> Self {
        match exhausted {
            Exhausted::Limit(limit) => Self::Limit(limit),
            Exhausted::Stopped(stopped) => Self::Stopped(stopped),
        }
    }
}
