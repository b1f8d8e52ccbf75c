//! The work of a job: a mesh, and the task on it.

use std::sync::Arc;

use bytes::Bytes;

use crate::digest::Digest;
use crate::durable::Hold;
use crate::jobs::claims::Claim;
use crate::jobs::class::Owner;
use crate::memory::MemoryShare;
use meshsnap_inspect::check::RuleSet;
use meshsnap_render::import::{Bundle, Format};
use meshsnap_render::limits::{Budget, Lend, Limits};
use meshsnap_render::spec::{BackendChoice, Spec};

/// The work of one job.
#[derive(Debug)]
pub struct Work {
    /// The mesh and the files beside it.
    pub bundle: Bundle,
    /// The mesh's format. None: found from the bytes.
    pub format_in: Option<Format>,
    /// The name under which the mesh may stay in memory as it was read; None if it is not to.
    pub mesh_key: Option<String>,
    /// The task on the mesh.
    pub task: Task,
    /// The memory of `bundle`, shared with all other holders of the same bytes.
    pub memory: Arc<MemoryShare>,
    /// The memory that a worker borrows for it. None until one begins it.
    pub lender: Option<Arc<dyn Lend>>,
    /// The request that `task` was read from, so that it can be read again after a restart. None for work that
    /// nobody fetches later.
    pub recipe: Option<Arc<Recipe>>,
    /// The party that asks for it.
    pub owner: Owner,
    /// The id of the request, for the log.
    pub request_id: Arc<str>,
    /// The bundle's files in the data folder, if they are there already.
    pub holds: Arc<[Arc<Hold>]>,
    /// The name that the client gave the request.
    pub claim: Option<Arc<Claim>>,
    /// The address that hears of its end.
    pub webhook: Option<Arc<str>>,
}

impl Work {
    /// An unspent budget, of which all that is spent is borrowed as the job's memory.
    pub fn budget(&self, limits: &Limits) -> Budget {
        Budget::lent(limits, self.lender.clone())
    }

    /// True if its request asks for a GPU.
    pub fn needs_gpu(&self) -> bool {
        let spec = match &self.task {
            Task::Draw(spec) => Some(spec),
            Task::Diff(comparing) => comparing.picture.as_ref(),
            Task::Check(_) | Task::Inspect { .. } => None,
        };
        spec.is_some_and(|spec| spec.backend == BackendChoice::Gpu)
    }

    /// Its mesh, and the newer one of a comparison.
    pub fn meshes(&self) -> Vec<Bundle> {
        let newer = if let Task::Diff(comparing) = &self.task { Some(&comparing.newer.bundle) } else { None };
        [&self.bundle].into_iter().chain(newer).cloned().collect()
    }
}

/// A request for a picture, a check or a comparison, as it was sent.
#[derive(Clone, Debug, Default)]
pub struct Recipe {
    /// The bytes of the document.
    pub document: Option<Bytes>,
    /// The dotted keys.
    pub overrides: Box<[(String, String)]>,
    /// The stored mesh that the document names.
    pub mesh: Option<Digest>,
}

/// Tasks on a mesh.
#[derive(Clone, Debug)]
pub enum Task {
    /// Draw a picture.
    Draw(Box<Spec>),
    /// Judge it by rules.
    Check(Box<Checking>),
    /// Compare it with a newer one.
    Diff(Box<Comparing>),
    /// Write a report on its content.
    Inspect {
        /// The time within its animation, as in [`Spec::time_s`].
        time_s: Option<f64>,
    },
}

/// A mesh that is judged.
#[derive(Clone, Debug)]
pub struct Checking {
    /// The rules.
    pub rules: RuleSet,
    /// All places of faults are listed, not the first few.
    pub all_places: bool,
    /// The name of the upload.
    pub digest: Digest,
    /// A broken rule of level `error` is an answer of 422.
    pub may_fail: bool,
}

/// A mesh that is compared with a newer one.
#[derive(Clone, Debug)]
pub struct Comparing {
    /// The newer mesh.
    pub newer: Newer,
    /// The largest distance that counts as the same, file units.
    pub max_distance: Option<f64>,
    /// The picture that is the answer. None: the answer is JSON.
    pub picture: Option<Box<Spec>>,
    /// A difference is an answer of 422.
    pub may_fail: bool,
}

/// The newer one of two meshes.
#[derive(Clone, Debug)]
pub struct Newer {
    /// The mesh and the files beside it.
    pub bundle: Bundle,
    /// The memory of `bundle`.
    pub memory: Arc<MemoryShare>,
    /// The bundle's files in the data folder, if they are there already.
    pub holds: Arc<[Arc<Hold>]>,
    /// Its name, if it is stored.
    pub mesh: Option<Digest>,
}
