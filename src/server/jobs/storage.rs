//! The form of jobs in the data folder: it makes records of accepted jobs and of their ends, and reads stored results
//! again. `http/recovery.rs` makes jobs of the records after a restart.

use std::collections::HashSet;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;

use super::job::{Failure, Finished, Job, JobState, Media, Newer, Task, Timings, Work, unix_ms};
use crate::digest::Digest;
use crate::durable::{
    ClaimRecord, Durable, EndRecord, ErrorRecord, FileRecord, Hold, JobRecord, PictureRecord, RequestKind,
    RequestRecord, SelectionRecord, SideRecord, Unstored, WarningRecord,
};
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
        let (files, mut holds) = self.of_files(&work.bundle, &work.holds)?;
        let newer = match &work.task {
            Task::Diff(comparing) => {
                let Newer { bundle, holds: known, mesh, .. } = &comparing.newer;
                let (files, own) = self.of_files(bundle, known)?;
                holds.extend(own);
                Some(SideRecord { files, is_zip: bundle.is_zip(), mesh: *mesh })
            }
            Task::Draw(_) | Task::Inspect { .. } | Task::Check(_) => None,
        };
        let recipe = work.recipe.clone().unwrap_or_default();
        let document = recipe.document.as_ref().map(|bytes| self.durable.hold(bytes)).transpose()?;
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
            document: document.as_ref().map(|hold| hold.digest()),
            names_mesh: recipe.mesh.is_some(),
            overrides: recipe.overrides.to_vec(),
            format: format.to_owned(),
            kind,
            upload,
        };
        holds.extend(document);
        let record = JobRecord {
            key: job.id.key(),
            accepted_unix_ms: job.accepted_unix_ms,
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
            claim: work
                .claim
                .as_ref()
                .map(|claim| ClaimRecord { key: claim.name.key.to_string(), request: claim.request }),
        };
        Ok((record, holds))
    }

    /// The records of the files of a bundle. They are in the data folder already if there are as many holds.
    fn of_files(&self, bundle: &Bundle, holds: &[Arc<Hold>]) -> Result<Stored<Vec<FileRecord>>, Unstored> {
        let files = bundle.files();
        let holds = match holds.len() == files.len() {
            true => holds.to_vec(),
            false => files.iter().map(|file| self.durable.hold(&file.bytes)).collect::<Result<_, _>>()?,
        };
        let digests = holds.iter().map(|hold| hold.digest());
        let records = files.iter().zip(digests).map(|(file, digest)| FileRecord { path: file.path.clone(), digest });
        Ok((records.collect(), holds))
    }

    /// The record of a job's end. Writes the file of a large picture.
    pub fn of_end(&self, state: &JobState) -> Result<Stored<EndRecord>, Unstored> {
        let mut end = EndRecord { at_unix_ms: unix_ms(), ..EndRecord::default() };
        let mut holds = Vec::new();
        match state {
            JobState::Done(finished) => {
                let hold = self.durable.hold(&finished.content)?;
                end.picture = Some(picture_record(finished, hold.digest()));
                holds.push(hold);
            }
            JobState::Failed(failure) => end.error = Some((self.describe)(failure)),
            JobState::Queued | JobState::Running | JobState::Inspected(_) | JobState::Cancelled => {}
        }
        Ok((end, holds))
    }
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
