//! The database of the data folder (redb, a key-value store). The code calls it the log, after the
//! trait `Log`. It keeps the records of jobs and of stored meshes. These name bytes: mesh files,
//! results, request documents, mesh reports. Small ones are kept in the database, too; larger ones are
//! files (`blobs`).
//!
//! Changes are made in transactions, each whole or not at all. The thread `committer` writes them. When
//! the server starts, it reads the database to restore jobs and meshes, and removes bytes that no
//! record needs.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;

use bytes::Bytes;
use redb::{Builder, Database, DatabaseError, ReadableDatabase as _, ReadableTable as _, TableDefinition};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::RecoveredJob;
use super::record::{Change, EndRecord, JobKey, JobRecord, MeshRecord};
use crate::digest::Digest;

/// A log of changes. A queue across machines is another implementation.
pub trait Log: Send {
    /// The jobs and meshes that are stored.
    fn load(&mut self) -> io::Result<Contents>;
    /// Bytes that are kept in the log.
    fn small(&mut self, digest: Digest) -> io::Result<Option<Bytes>>;
    /// The names of all bytes that are kept in the log.
    fn small_digests(&mut self) -> io::Result<Vec<Digest>>;
    /// Makes all the changes, durably, or none of them.
    fn commit(&mut self, changes: &[Change]) -> io::Result<()>;
}

/// The content of a log.
#[derive(Default)]
pub struct Contents {
    /// The jobs, in the order of acceptance.
    pub jobs: Vec<RecoveredJob>,
    /// The stored meshes.
    pub meshes: Vec<MeshRecord>,
}

const VERSION: u64 = 1;

/// Memory in which the library keeps pages of the file.
const CACHE_BYTES: usize = 8 << 20;

const ABOUT: TableDefinition<&str, u64> = TableDefinition::new("about");
const JOBS: TableDefinition<JobKey, &[u8]> = TableDefinition::new("jobs");
const STARTS: TableDefinition<JobKey, u32> = TableDefinition::new("starts");
const ENDS: TableDefinition<JobKey, &[u8]> = TableDefinition::new("ends");
const MESHES: TableDefinition<[u8; 32], &[u8]> = TableDefinition::new("meshes");
const SMALL: TableDefinition<[u8; 32], &[u8]> = TableDefinition::new("small");

/// A job's record, how often it was begun, and the record of its end.
type Row = (Vec<u8>, u32, Option<Vec<u8>>);

/// Opens the database anew.
type Opener = Box<dyn Fn() -> Result<Database, DatabaseError> + Send>;

/// A log in a redb database.
pub struct RedbLog {
    opener: Opener,
    /// None after an error: redb then refuses everything until it is opened again.
    database: Option<Database>,
}

impl Contents {
    /// The names of the bytes that the records need.
    pub fn digests(&self) -> BTreeSet<Digest> {
        let mut all = BTreeSet::new();
        for job in &self.jobs {
            match &job.end {
                Some(end) => all.extend(end.picture.as_ref().map(|picture| picture.digest)),
                None => {
                    let newer = job.record.newer.iter().flat_map(|newer| &newer.files);
                    all.extend(job.record.files.iter().chain(newer).map(|file| file.digest));
                    all.extend(job.record.request.document);
                }
            }
        }
        for mesh in &self.meshes {
            all.extend(mesh.files.iter().map(|file| file.digest).chain([mesh.report]));
        }
        all
    }
}

impl RedbLog {
    /// Opens a file, which is made if it is missing. `ResourceBusy`: another process has it open.
    /// `Unsupported`: a newer version wrote it.
    pub fn open(path: &Path) -> io::Result<Self> {
        if !path.exists() {
            // A file that is there is whole: it gets its name when it is.
            let unfinished = path.with_extension("new");
            let _ = std::fs::remove_file(&unfinished);
            drop(Self::with(Box::new({
                let unfinished = unfinished.clone();
                move || builder().create(&unfinished)
            }))?);
            std::fs::rename(&unfinished, path)?;
            std::fs::File::open(path.parent().unwrap_or(path))?.sync_all()?;
        }
        let path = path.to_owned();
        Self::with(Box::new(move || builder().open(&path)))
    }

    /// Opens what `opener` opens, now and after each error.
    pub fn with(opener: Opener) -> io::Result<Self> {
        let mut log = Self { opener, database: None };
        log.run(|database| {
            let transaction = begin(database)?;
            let version = {
                let mut about = transaction.open_table(ABOUT)?;
                let found = about.get("version")?.map(|version| version.value());
                if found.is_none() {
                    about.insert("version", VERSION)?;
                }
                for table in [JOBS, ENDS] {
                    transaction.open_table(table)?;
                }
                transaction.open_table(STARTS)?;
                for table in [MESHES, SMALL] {
                    transaction.open_table(table)?;
                }
                found
            };
            match version {
                None => transaction.commit()?,
                Some(_) => transaction.abort()?,
            }
            Ok(version)
        })
        .and_then(|version| match version {
            None | Some(VERSION) => Ok(()),
            Some(_) => Err(io::ErrorKind::Unsupported.into()),
        })?;
        Ok(log)
    }

    fn run<T>(&mut self, work: impl FnOnce(&Database) -> Result<T, redb::Error>) -> io::Result<T> {
        let database = match self.database.take() {
            Some(database) => database,
            None => (self.opener)().map_err(|error| to_io(error.into()))?,
        };
        let done = work(&database).map_err(to_io)?;
        self.database = Some(database);
        Ok(done)
    }
}

impl Log for RedbLog {
    fn load(&mut self) -> io::Result<Contents> {
        let rows = self.run(|database| {
            let transaction = database.begin_read()?;
            let mut jobs: BTreeMap<JobKey, Row> = BTreeMap::new();
            for row in transaction.open_table(JOBS)?.iter()? {
                let (key, value) = row?;
                jobs.insert(key.value(), (value.value().to_vec(), 0, None));
            }
            for row in transaction.open_table(STARTS)?.iter()? {
                let (key, value) = row?;
                jobs.entry(key.value()).and_modify(|job| job.1 = value.value());
            }
            for row in transaction.open_table(ENDS)?.iter()? {
                let (key, value) = row?;
                jobs.entry(key.value()).and_modify(|job| job.2 = Some(value.value().to_vec()));
            }
            let mut meshes = Vec::new();
            for row in transaction.open_table(MESHES)?.iter()? {
                meshes.push(row?.1.value().to_vec());
            }
            Ok((jobs, meshes))
        })?;
        let (jobs, meshes) = rows;
        let read_job = |(record, starts, end): Row| {
            let end = end.map(|end| parse::<EndRecord>(&end)).transpose()?;
            Ok::<_, io::Error>(RecoveredJob { record: parse::<JobRecord>(&record)?, starts, end })
        };
        // Keys are UUIDs of version 7, so their order is that of acceptance.
        let jobs = jobs.into_values().map(read_job).collect::<Result<_, _>>()?;
        let meshes = meshes.iter().map(|mesh| parse(mesh)).collect::<Result<_, _>>()?;
        Ok(Contents { jobs, meshes })
    }

    fn small(&mut self, digest: Digest) -> io::Result<Option<Bytes>> {
        self.run(|database| {
            let small = database.begin_read()?.open_table(SMALL)?;
            Ok(small.get(digest.as_bytes())?.map(|bytes| Bytes::copy_from_slice(bytes.value())))
        })
    }

    fn small_digests(&mut self) -> io::Result<Vec<Digest>> {
        self.run(|database| {
            let small = database.begin_read()?.open_table(SMALL)?;
            small.iter()?.map(|row| Ok(Digest::from_bytes(row?.0.value()))).collect()
        })
    }

    fn commit(&mut self, changes: &[Change]) -> io::Result<()> {
        if changes.is_empty() {
            return Ok(());
        }
        self.run(|database| {
            let transaction = begin(database)?;
            {
                let mut tables = Tables {
                    jobs: transaction.open_table(JOBS)?,
                    starts: transaction.open_table(STARTS)?,
                    ends: transaction.open_table(ENDS)?,
                    meshes: transaction.open_table(MESHES)?,
                    small: transaction.open_table(SMALL)?,
                };
                changes.iter().try_for_each(|change| tables.apply(change))?;
            }
            transaction.commit()?;
            Ok(())
        })
    }
}

struct Tables<'t> {
    jobs: redb::Table<'t, JobKey, &'static [u8]>,
    starts: redb::Table<'t, JobKey, u32>,
    ends: redb::Table<'t, JobKey, &'static [u8]>,
    meshes: redb::Table<'t, [u8; 32], &'static [u8]>,
    small: redb::Table<'t, [u8; 32], &'static [u8]>,
}

impl Tables<'_> {
    fn mesh(&self, digest: Digest) -> Result<Option<MeshRecord>, redb::Error> {
        let stored = self.meshes.get(digest.as_bytes())?.map(|record| parse(record.value())).transpose();
        stored.map_err(redb::Error::Io)
    }

    fn change_end(&mut self, key: JobKey, change: impl FnOnce(EndRecord) -> EndRecord) -> Result<(), redb::Error> {
        let end = self.ends.get(key)?.map(|end| parse::<EndRecord>(end.value())).transpose();
        if let Some(end) = end.map_err(redb::Error::Io)? {
            self.ends.insert(key, &*json(&change(end))?)?;
        }
        Ok(())
    }

    fn apply(&mut self, change: &Change) -> Result<(), redb::Error> {
        match change {
            Change::Accepted(record) => {
                self.jobs.insert(record.key, &*json(record)?)?;
            }
            Change::Started(key) => {
                let before = self.starts.get(key)?.map_or(0, |count| count.value());
                self.starts.insert(key, before.saturating_add(1))?;
            }
            // A job that was forgotten stays so.
            Change::Ended(key, record) if self.jobs.get(key)?.is_some() => {
                self.ends.insert(key, &*json(record)?)?;
            }
            Change::Ended(..) => {}
            Change::Fetched(key, at_unix_ms) => {
                self.change_end(*key, |end| EndRecord { fetched_unix_ms: Some(*at_unix_ms), ..end })?;
            }
            Change::Notified(key, at_unix_ms) => {
                self.change_end(*key, |end| EndRecord { notified_unix_ms: Some(*at_unix_ms), ..end })?;
            }
            Change::Forgotten(key) => {
                self.jobs.remove(key)?;
                self.starts.remove(key)?;
                self.ends.remove(key)?;
            }
            Change::MeshStored(record) => {
                // The report and the way of reading stay those of the first time, as they do in memory.
                let stored = match self.mesh(record.digest)? {
                    Some(mut stored) => {
                        stored.add_owners(record);
                        json(&stored)?
                    }
                    None => json(record)?,
                };
                self.meshes.insert(record.digest.as_bytes(), &*stored)?;
            }
            Change::MeshDisowned(digest, owner) => {
                if let Some(mut stored) = self.mesh(*digest)? {
                    stored.remove_owner(owner);
                    self.meshes.insert(digest.as_bytes(), &*json(&stored)?)?;
                }
            }
            Change::MeshRemoved(digest) => {
                self.meshes.remove(digest.as_bytes())?;
            }
            Change::SmallStored(digest, bytes) => {
                self.small.insert(digest.as_bytes(), &**bytes)?;
            }
            Change::SmallRemoved(digest) => {
                self.small.remove(digest.as_bytes())?;
            }
        }
        Ok(())
    }
}

/// Two syncs per commit, so that which of two states is valid does not depend on a checksum: the data is
/// clients', and the checksum is none against malice.
fn begin(database: &Database) -> Result<redb::WriteTransaction, redb::Error> {
    let mut transaction = database.begin_write()?;
    transaction.set_two_phase_commit(true);
    Ok(transaction)
}

/// The settings of a database.
pub(super) fn builder() -> Builder {
    let mut builder = Builder::new();
    builder.set_cache_size(CACHE_BYTES);
    builder
}

fn json(record: &impl Serialize) -> Result<Vec<u8>, redb::Error> {
    serde_json::to_vec(record).map_err(|error| redb::Error::Io(error.into()))
}

fn parse<T: DeserializeOwned>(text: &[u8]) -> io::Result<T> {
    serde_json::from_slice(text).map_err(io::Error::from)
}

fn to_io(error: redb::Error) -> io::Error {
    match error {
        redb::Error::Io(error) => error,
        redb::Error::DatabaseAlreadyOpen => io::ErrorKind::ResourceBusy.into(),
        other => io::Error::other(other),
    }
}
