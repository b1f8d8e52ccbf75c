//! The form of jobs in the data folder, and in a store that several servers share: it makes records of accepted jobs and of their ends, and reads stored results
//! again. `http/recovery.rs` makes jobs of the records after a restart.

use std::collections::HashSet;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;

use super::job::{Failure, Finished, Job, JobId, JobState, Media, Newer, Task, Timings, Work, unix_ms};
use crate::digest::Digest;
use crate::durable::{
    ClaimRecord, Durable, EndRecord, ErrorRecord, FileRecord, Hold, JobRecord, PictureRecord, RequestKind,
    RequestRecord, SelectionRecord, SideRecord, Unstored, WarningRecord,
};
use crate::memory::Memory;
use meshsnap_render::backend::{BackendKind, DrawTimes};
use meshsnap_render::import::Bundle;
use meshsnap_render::pipeline::QualitySelection;
use meshsnap_render::spec::Samples;
use meshsnap_render::spec::words::{Words, word_for};
use meshsnap_render::warning::Warning;

/// Most different names that are taken over from a data folder: more than there are warnings, methods and
/// flags.
const NAMES_MAX: usize = 1000;

/// The word for verdicts in place of a picture's format.
pub const JSON: &str = "json";

/// The data folder, and the words in which failures are stored.
#[derive(Clone)]
pub struct Storage {
    /// The data folder.
    pub durable: Durable,
    /// A failure in the words of the interface.
    pub describe: fn(&Failure) -> ErrorRecord,
}

/// What was written, and the bytes that it names.
pub type Stored<R> = (R, Vec<Arc<Hold>>);

impl std::fmt::Debug for Storage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Storage").finish_non_exhaustive()
    }
}

impl Storage {
    /// The record of a job that is accepted. Writes files, so it may take long.
    pub fn of_job(&self, job: &Job, work: &Work) -> Result<Stored<JobRecord>, Unstored> {
        let mut holds = Vec::new();
        let record = record_of((job.id, job.accepted_unix_ms), work, true, &mut |bytes, known| {
            let hold = known.map_or_else(|| self.durable.hold(bytes), |hold| Ok(hold.clone()))?;
            let digest = hold.digest();
            holds.push(hold);
            Ok(digest)
        })?;
        Ok((record, holds))
    }

    /// The record of a job's end. Writes the file of a large picture.
    pub fn of_end(&self, state: &JobState) -> Result<Stored<EndRecord>, Unstored> {
        let hold = match state {
            JobState::Done(finished) => Some(self.durable.hold(&finished.content)?),
            _ => None,
        };
        let end = end_of(state, hold.as_ref().map(|hold| hold.digest()), self.describe);
        Ok((end, hold.into_iter().collect()))
    }
}

/// The record of an end. `content` names the bytes of a result.
pub fn end_of(state: &JobState, content: Option<Digest>, describe: fn(&Failure) -> ErrorRecord) -> EndRecord {
    let end = EndRecord { at_unix_ms: unix_ms(), ..EndRecord::default() };
    match (state, content) {
        (JobState::Done(finished), Some(digest)) => {
            EndRecord { picture: Some(picture_record(finished, digest)), ..end }
        }
        (JobState::Failed(failure), _) => EndRecord { error: Some(describe(failure)), ..end },
        _ => end,
    }
}

/// The state that a record of an end means. `content` has the bytes of a result, unless they are lost.
pub fn read_end(end: &EndRecord, content: Option<Bytes>, memory: &Arc<Memory>) -> JobState {
    match (&end.picture, &end.error) {
        (Some(picture), _) => {
            let read = content.and_then(|bytes| read_picture(picture.clone(), bytes));
            read.map_or(JobState::Failed(Arc::new(Failure::Lost)), |finished| {
                JobState::Done(Arc::new(finished.counted(memory)))
            })
        }
        (None, Some(error)) => JobState::Failed(Arc::new(Failure::Recorded(error.clone()))),
        (None, None) => JobState::Cancelled,
    }
}

/// Keeps bytes for a record, and returns their name. A hold says that the data folder has them already.
pub type Keep<'k, E> = dyn FnMut(&Bytes, Option<&Arc<Hold>>) -> Result<Digest, E> + 'k;

/// The record of a job with this name and time of acceptance. The files of stored meshes are kept for it only if
/// `keeps_stored` is true.
pub fn record_of<E>(
    (id, accepted_unix_ms): (JobId, u64),
    work: &Work,
    keeps_stored: bool,
    keep: &mut Keep<'_, E>,
) -> Result<JobRecord, E> {
    let recipe = work.recipe.clone().unwrap_or_default();
    let mut files_of = |bundle: &Bundle, holds: &[Arc<Hold>], mesh: Option<Digest>| match mesh {
        Some(_) if !keeps_stored => Ok(Vec::new()),
        _ => keep_files(bundle, holds, keep),
    };
    let files = files_of(&work.bundle, &work.holds, recipe.mesh)?;
    let newer = match &work.task {
        Task::Diff(comparing) => {
            let Newer { bundle, holds, mesh, .. } = &comparing.newer;
            Some(SideRecord { files: files_of(bundle, holds, *mesh)?, is_zip: bundle.is_zip(), mesh: *mesh })
        }
        Task::Draw(_) | Task::Inspect { .. } | Task::Check(_) => None,
    };
    let document = recipe.document.as_ref().map(|bytes| keep(bytes, None)).transpose()?;
    let (kind, format, upload) = match &work.task {
        Task::Draw(spec) => (RequestKind::Draw, spec.image.format.map_or("png", word_for), None),
        Task::Inspect { .. } => (RequestKind::Draw, "", None),
        Task::Check(checking) => (RequestKind::Check, JSON, Some(checking.digest)),
        Task::Diff(comparing) => {
            let picture = comparing.picture.as_ref().and_then(|spec| spec.image.format);
            (RequestKind::Diff, picture.map_or(JSON, word_for), None)
        }
    };
    let request = RequestRecord {
        document,
        names_mesh: recipe.mesh.is_some(),
        overrides: recipe.overrides.to_vec(),
        format: format.to_owned(),
        kind,
        upload,
    };
    Ok(JobRecord {
        key: id.key(),
        accepted_unix_ms,
        request,
        files,
        is_zip: work.bundle.is_zip(),
        format_in: work.format_in.map(|format| format.name().to_owned()),
        entry: work.bundle.entry().map(str::to_owned),
        owner: work.owner.to_string(),
        request_id: work.request_id.to_string(),
        mesh: recipe.mesh,
        webhook: work.webhook.as_deref().map(str::to_owned),
        newer,
        needs_gpu: work.needs_gpu(),
        traceparent: None,
        claim: work.claim.as_ref().map(|claim| ClaimRecord { key: claim.name.key.to_string(), request: claim.request }),
    })
}

/// The records of the files of a bundle. They are in the data folder already if there are as many holds.
fn keep_files<E>(bundle: &Bundle, holds: &[Arc<Hold>], keep: &mut Keep<'_, E>) -> Result<Vec<FileRecord>, E> {
    let files = bundle.files();
    let known = |index| holds.get(index).filter(|_| holds.len() == files.len());
    let records = files
        .iter()
        .enumerate()
        .map(|(index, file)| Ok(FileRecord { path: file.path.clone(), digest: keep(&file.bytes, known(index))? }));
    records.collect()
}

/// The record of a picture or a verdict whose bytes have this digest.
pub fn picture_record(finished: &Finished, digest: Digest) -> PictureRecord {
    let warnings = finished.warnings.iter();
    let selection = finished.selection.as_ref().map(|selection| SelectionRecord {
        samples: match selection.samples {
            Samples::Fixed(samples) => samples,
            // `read_picture` reads it as adaptive, the only other kind.
            _ => 0,
        },
        wire_methods: selection.wire_methods.iter().map(|&method| method.to_owned()).collect(),
        backend: word_for(selection.backend).to_owned(),
        expected_error: selection.expected_error,
        expected_time_ms: selection.expected_time_ms,
    });
    PictureRecord {
        digest,
        format: match finished.media {
            Media::Picture(format) => word_for(format).to_owned(),
            Media::Json => JSON.to_owned(),
        },
        has_failed: finished.has_failed,
        backend: finished.backend.name().to_owned(),
        is_substitute: finished.is_substitute,
        mesh_was_kept: finished.mesh_was_kept,
        warnings: warnings.map(|w| WarningRecord { code: w.code.to_owned(), detail: w.detail.clone() }).collect(),
        selection,
        timings_us: finished.timings.parts().map(|(_, took)| u64::try_from(took.as_micros()).unwrap_or(u64::MAX)),
    }
}

/// A picture or a verdict as it was stored. None if a word of the record is not known any more.
pub fn read_picture(record: PictureRecord, content: Bytes) -> Option<Finished> {
    let [queue, parse, plan, render, encode] = record.timings_us.map(Duration::from_micros);
    let selection = match record.selection {
        Some(selection) => Some(QualitySelection {
            samples: match selection.samples {
                0 => Samples::Adaptive,
                samples => Samples::Fixed(samples),
            },
            wire_methods: selection.wire_methods.iter().map(|method| name(method)).collect(),
            backend: value_of(&selection.backend)?,
            expected_error: selection.expected_error,
            expected_time_ms: selection.expected_time_ms,
        }),
        None => None,
    };
    let backend = [BackendKind::Cpu, BackendKind::Gpu].into_iter().find(|kind| kind.name() == record.backend)?;
    let warnings = record.warnings.into_iter();
    Some(Finished {
        content,
        memory: None,
        media: if record.format == JSON { Media::Json } else { Media::Picture(value_of(&record.format)?) },
        has_failed: record.has_failed,
        backend,
        is_substitute: record.is_substitute,
        warnings: warnings.map(|w| Warning { code: name(&w.code), detail: w.detail }).collect(),
        selection,
        mesh_was_kept: record.mesh_was_kept,
        timings: Timings { queue, parse, plan, render, encode },
        draw_times: DrawTimes::default(),
    })
}

/// The value that a word means.
pub fn value_of<T: Words>(word: &str) -> Option<T> {
    T::ALL.iter().find(|(known, _)| *known == word).map(|&(_, value)| value)
}

/// A name of the program's own that was read from a data folder: a warning's, a method's. There are few, so that
/// each is kept once and for good, as it is in the program itself.
pub fn name(text: &str) -> &'static str {
    static NAMES: LazyLock<Mutex<HashSet<&'static str>>> = LazyLock::new(Mutex::default);
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = names.get(text) {
        return known;
    }
    if names.len() >= NAMES_MAX {
        return "unknown";
    }
    let leaked: &'static str = text.to_owned().leak();
    names.insert(leaked);
    leaked
}
