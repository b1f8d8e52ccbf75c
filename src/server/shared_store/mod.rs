//! The shared store: a bucket of S3, or a folder that several machines mount, in which any number of daemons keep what
//! each of them must find. These are the stored meshes, the pictures that were drawn of them, and jobs. What a daemon has in
//! memory is a cache of it then.
//!
//! Objects under the address's prefix:
//!
//! - `meshes/SHA-256/OWNER`: a stored mesh as one party has it, with its files and its report. OWNER is a digest of the
//!   party's name. Each party has a copy of its own: so to store, to find and to delete are one operation each, and no
//!   two daemons need to agree on anything.
//! - `pictures/SHA-256/KEY`: a picture of that mesh under its render key, which is a digest of all that decides the
//!   picture. Two daemons that draw the same picture write the same object. Nothing depends on these objects: they may
//!   be deleted at any time.
//! - `jobs/ID` and `results/ID`: a job that has not ended, and the end of one ([`jobs`]). Servers without a shared queue
//!   write none.
//! - `service`: the name of the shared queue whose jobs are here, and a name of this store by which that queue knows it.
//! - `meshsnap`: marks the store as one. Each server writes it at its start, and looks from time to time whether it is there.
//!
//! [`objects`] has the form of the objects. [`s3`] opens a bucket.
//!
//! Architecture invariant: nothing here knows HTTP requests of clients, or keeps bytes in memory.

mod address;
mod jobs;
mod objects;
#[cfg(feature = "cluster")]
mod s3;
#[cfg(test)]
mod tests;

pub use address::AddressError;
pub use jobs::{AcceptedJob, Ages, EndedJob, FoundJob};

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use futures_util::TryStreamExt as _;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt as _};

use super::digest::Digest;
use super::durable::Unstored;
use super::jobs::{Finished, Owner};
use super::keys::Access;
use super::store::NewMesh;

/// Time between two looks at whether the store can be reached.
const LOOK_EVERY: Duration = Duration::from_secs(5);

/// The longest time for which a look and the reading of a picture wait: a picture can be drawn instead.
const LOOK_TIME: Duration = Duration::from_secs(5);

/// Attempts to delete or to create an object after the first.
const ATTEMPTS_MORE: u32 = 3;

/// The name of the object that marks a shared store, and its bytes.
const MARK: &str = "meshsnap";
const MARK_TEXT: &str = "A store that servers of meshsnap share: see --store.\n";

/// The longest time between two attempts to reach it at the start.
const ATTEMPT_EVERY_MAX: Duration = Duration::from_secs(10);

/// The shared store.
#[derive(Debug)]
pub struct SharedStore {
    objects: Arc<dyn ObjectStore>,
    /// True for a folder, false for a bucket.
    is_folder: bool,
    /// Its address, for messages.
    address: String,
    /// The error of the last look, or of an operation since. None: the store can be reached.
    trouble: Mutex<Option<String>>,
}

/// The error of an operation: the store cannot be reached, or does not do what it should.
#[derive(Debug, thiserror::Error)]
#[error("the shared store {address}: {cause}")]
pub struct Unavailable {
    address: String,
    cause: String,
}

/// Reasons why a shared store is not used at all.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The address has the wrong form.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// This server may not write to it.
    #[error("the shared store {address} refuses the credentials or the rights of this server: {cause}")]
    Refused {
        /// The address.
        address: String,
        /// The answer.
        cause: String,
    },
    /// There is no such bucket or folder.
    #[error("there is no shared store at {address}: {cause}")]
    Missing {
        /// The address.
        address: String,
        /// The answer.
        cause: String,
    },
    /// It overwrites what must be created once.
    #[error(
        "the shared store {address} ignores the condition If-None-Match of writes, without which a job could end twice: \
         --queue needs another store"
    )]
    Unconditional {
        /// The address.
        address: String,
    },
    /// It has the jobs of another queue.
    #[error(
        "the shared store {address} has the jobs of the queue {found}, and --queue names {needed}; give each queue a store \
         or a prefix of its own, or remove the object `service` if the other one is no more"
    )]
    OtherQueue {
        /// The address.
        address: String,
        /// The queue whose jobs it has.
        found: String,
        /// The queue of this server.
        needed: String,
    },
    /// The stored meshes of the data folder could not be put into it.
    #[error("{0}; the stored meshes of the data folder are to be put there")]
    HandOver(#[from] Unavailable),
    /// They could not be removed from the data folder.
    #[error("{0}; the stored meshes of the data folder are in the shared store now")]
    DataFolder(#[from] Unstored),
}

/// A stored mesh that was found in the store.
#[derive(Clone, Debug)]
pub struct FoundMesh {
    place: Path,
    /// Bytes of its object.
    pub bytes: u64,
}

impl SharedStore {
    /// The store at an address: `s3://BUCKET/PREFIX` or `file:///FOLDER`. Nothing is read yet.
    pub fn new(address: &str) -> Result<Self, AddressError> {
        let (objects, address) = (address::open(address)?, address.to_owned());
        let is_folder = address.starts_with(address::FOLDER_SCHEME);
        Ok(Self { objects, is_folder, address, trouble: Mutex::default() })
    }

    /// Marks the store as one, and returns once that is done. While it cannot be reached, tries again; the log says so.
    pub async fn reach(&self) -> Result<(), OpenError> {
        let mut pause = Duration::from_millis(250);
        loop {
            let Err(cause) = self.mark().await else { return Ok(()) };
            let (address, words) = (self.address.clone(), words_of(&cause));
            match cause {
                object_store::Error::PermissionDenied { .. } | object_store::Error::Unauthenticated { .. } => {
                    return Err(OpenError::Refused { address, cause: words });
                }
                object_store::Error::NotFound { .. } => return Err(OpenError::Missing { address, cause: words }),
                _ if is_forbidden(&cause) => return Err(OpenError::Refused { address, cause: words }),
                _ => tracing::warn!(address, cause = words, "waiting for the shared store"),
            }
            tokio::time::sleep(pause).await;
            pause = (2 * pause).min(ATTEMPT_EVERY_MAX);
        }
    }

    /// Looks from time to time whether the store can be reached. Never returns.
    pub async fn watch(&self) {
        loop {
            tokio::time::sleep(LOOK_EVERY).await;
            let trouble = self.look().await.err().map(|error| words_of(&error));
            let before =
                std::mem::replace(&mut *self.trouble.lock().unwrap_or_else(PoisonError::into_inner), trouble.clone());
            match (before, trouble) {
                (None, Some(cause)) => {
                    tracing::error!(address = self.address, cause, "the shared store cannot be reached")
                }
                (Some(_), None) => tracing::info!(address = self.address, "the shared store can be reached again"),
                _ => {}
            }
        }
    }

    /// True if the last look, or an operation since, did not reach the store.
    pub fn is_in_trouble(&self) -> bool {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Stores a mesh for its owners. It is there as a whole, and durably, once this returns.
    pub async fn put_mesh(&self, mesh: &NewMesh) -> Result<(), Unavailable> {
        self.is_there().await?;
        for owner in &mesh.owners {
            let object = objects::of_mesh(mesh, owner);
            self.objects
                .put(&place_of_mesh(mesh.digest, owner), object)
                .await
                .map_err(|cause| self.unavailable(cause))?;
        }
        Ok(())
    }

    /// Finds a mesh that the party sees.
    pub async fn find_mesh(&self, digest: Digest, access: &Access) -> Result<Option<FoundMesh>, Unavailable> {
        Ok(self.copies(digest, access).await?.into_iter().next())
    }

    /// Reads a mesh. None if it is gone, or if its object is damaged.
    pub async fn read_mesh(&self, digest: Digest, found: &FoundMesh) -> Result<Option<NewMesh>, Unavailable> {
        let Some(bytes) = self.read(&found.place).await? else { return Ok(None) };
        // Hashing many bytes would block other requests.
        let reading = tokio::task::spawn_blocking(move || objects::read_mesh(digest, bytes));
        let mesh = reading.await.ok().flatten();
        if mesh.is_none() {
            tracing::error!(address = self.address, mesh = %digest, "the object of a stored mesh is damaged");
        }
        Ok(mesh)
    }

    /// Deletes what the party has of a mesh, and its pictures if no other party has it. False if the party has none.
    pub async fn delete_mesh(&self, digest: Digest, access: &Access) -> Result<bool, Unavailable> {
        let copies = self.copies(digest, access).await?;
        for copy in &copies {
            self.delete(&copy.place).await?;
        }
        if !copies.is_empty() && self.list(&folder_of_mesh(digest)).await?.is_empty() {
            for picture in self.list(&folder_of_pictures(digest)).await? {
                self.delete(&picture.place).await?;
            }
        }
        Ok(!copies.is_empty())
    }

    /// Stores a picture of a stored mesh under its render key.
    pub async fn put_picture(&self, mesh: Digest, key: &str, picture: &Finished) -> Result<(), Unavailable> {
        self.is_there().await?;
        let object = objects::of_picture(picture);
        self.objects.put(&place_of_picture(mesh, key), object).await.map(drop).map_err(|cause| self.unavailable(cause))
    }

    /// The picture of a stored mesh under a render key. None if there is none, or if its object is damaged.
    pub async fn picture(&self, mesh: Digest, key: &str) -> Result<Option<Finished>, Unavailable> {
        let place = place_of_picture(mesh, key);
        match tokio::time::timeout(LOOK_TIME, self.read(&place)).await {
            Ok(read) => Ok(read?.and_then(objects::read_picture)),
            Err(_) => Err(self.unavailable(late())),
        }
    }

    /// The copies of a mesh that a party sees: its own, or those of all.
    async fn copies(&self, digest: Digest, access: &Access) -> Result<Vec<FoundMesh>, Unavailable> {
        if access.sees_all() {
            return self.list(&folder_of_mesh(digest)).await;
        }
        let place = place_of_mesh(digest, &access.owner);
        match self.objects.head(&place).await {
            Ok(meta) => Ok(vec![FoundMesh { place, bytes: meta.size }]),
            Err(object_store::Error::NotFound { .. }) => Ok(Vec::new()),
            Err(cause) => Err(self.unavailable(cause)),
        }
    }

    async fn list(&self, folder: &Path) -> Result<Vec<FoundMesh>, Unavailable> {
        let found = self.objects.list(Some(folder)).map_ok(|meta| FoundMesh { place: meta.location, bytes: meta.size });
        found.try_collect().await.map_err(|cause| self.unavailable(cause))
    }

    async fn read(&self, place: &Path) -> Result<Option<bytes::Bytes>, Unavailable> {
        let reading = async { self.objects.get(place).await?.bytes().await };
        match reading.await {
            Ok(bytes) => Ok(Some(bytes)),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(cause) => Err(self.unavailable(cause)),
        }
    }

    /// Deletes an object. Tries it again, because the crate does not.
    async fn delete(&self, place: &Path) -> Result<(), Unavailable> {
        let mut attempt = 0;
        loop {
            match self.objects.delete(place).await {
                Ok(()) | Err(object_store::Error::NotFound { .. }) => return Ok(()),
                Err(_) if attempt < ATTEMPTS_MORE => attempt += 1,
                Err(cause) => return Err(self.unavailable(cause)),
            }
        }
    }

    /// Writes the mark: so a missing bucket shows, and credentials that may only read.
    async fn mark(&self) -> object_store::Result<()> {
        self.objects.put(&Path::from(MARK), MARK_TEXT.into()).await.map(drop)
    }

    /// Reads the mark. Where a folder is not mounted any more, it is missing. In a bucket it is written again, because a rule
    /// may have removed it.
    async fn look(&self) -> object_store::Result<()> {
        let mark = Path::from(MARK);
        let looking = async {
            match self.objects.get(&mark).await {
                Err(object_store::Error::NotFound { .. }) if !self.is_folder => self.mark().await,
                looked => looked.map(drop),
            }
        };
        tokio::time::timeout(LOOK_TIME, looking).await.unwrap_or_else(|_| Err(late()))
    }

    /// An error if a folder is not mounted any more: writing would make it anew, on this machine alone.
    async fn is_there(&self) -> Result<(), Unavailable> {
        if self.is_folder {
            self.look().await.map_err(|cause| self.unavailable(cause))?;
        }
        Ok(())
    }

    fn unavailable(&self, cause: object_store::Error) -> Unavailable {
        let cause = words_of(&cause);
        // The next look finds out how it is.
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = Some(cause.clone());
        Unavailable { address: self.address.clone(), cause }
    }
}

/// The error of an answer that does not come.
fn late() -> object_store::Error {
    object_store::Error::Generic { store: "shared", source: "it does not answer".into() }
}

/// True if the file system does not let this process write.
fn is_forbidden(error: &object_store::Error) -> bool {
    let mut source: Option<&(dyn std::error::Error + 'static)> = Some(error);
    while let Some(cause) = source {
        if let Some(system) = cause.downcast_ref::<std::io::Error>() {
            return system.kind() == std::io::ErrorKind::PermissionDenied;
        }
        source = cause.source();
    }
    false
}

/// An error in one line. Of an answer of S3, which is XML, its code and message.
fn words_of(error: &object_store::Error) -> String {
    let text = error.to_string();
    let within = |tag: &str| {
        let (_, rest) = text.split_once(&format!("<{tag}>"))?;
        rest.split_once("</").map(|(words, _)| words)
    };
    match (within("Code"), within("Message")) {
        (Some(code), Some(message)) => format!("{code}, {message}"),
        _ => text.replace('\n', " "),
    }
}

fn folder_of_mesh(digest: Digest) -> Path {
    Path::from_iter(["meshes", &digest.to_string()])
}

fn place_of_mesh(digest: Digest, owner: &Owner) -> Path {
    folder_of_mesh(digest).join(Digest::of(owner.to_string().as_bytes()).to_string())
}

fn folder_of_pictures(digest: Digest) -> Path {
    Path::from_iter(["pictures", &digest.to_string()])
}

fn place_of_picture(mesh: Digest, key: &str) -> Path {
    // A render key is a tag in quotation marks, perhaps with `W/` before it.
    folder_of_pictures(mesh).join(Digest::of(key.as_bytes()).to_string())
}
