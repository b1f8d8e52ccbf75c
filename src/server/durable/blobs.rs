//! The files beside the database of the data folder (`log`), for bytes that are too large for it, such as meshes and
//! pictures. Each file is named by the SHA-256 of its bytes.

use std::io;
use std::path::{Path, PathBuf};

use bytes::Bytes;
use object_store::local::LocalFileSystem;
use object_store::{ObjectStoreExt as _, path};

use crate::digest::Digest;

/// A store of bytes under their digests. One across machines, such as S3, is another implementation.
pub trait Blobs: Send + Sync {
    /// Stores bytes. They are there as a whole, and durably, once this returns.
    fn put(&self, digest: Digest, bytes: &Bytes) -> io::Result<()>;
    /// The bytes. None if there are none of this name.
    fn get(&self, digest: Digest) -> io::Result<Option<Bytes>>;
    /// Removes the bytes. It is no error if there are none.
    fn delete(&self, digest: Digest) -> io::Result<()>;
    /// All names.
    fn list(&self) -> io::Result<Vec<Digest>>;
}

/// A folder with a file for each, in sub-folders by the first two digits. `sha256sum` verifies them.
pub struct FolderBlobs {
    files: LocalFileSystem,
    folder: PathBuf,
}

impl FolderBlobs {
    /// Opens a folder that exists, and removes files that were not written to their end.
    pub fn open(folder: &Path) -> io::Result<Self> {
        let files = LocalFileSystem::new_with_prefix(folder).map_err(to_io)?.with_fsync(true);
        let opened = Self { files, folder: folder.to_owned() };
        opened.each_file(|file, digest| if digest.is_none() { std::fs::remove_file(file) } else { Ok(()) })?;
        Ok(opened)
    }

    fn each_file(&self, mut visit: impl FnMut(&Path, Option<Digest>) -> io::Result<()>) -> io::Result<()> {
        for part in std::fs::read_dir(&self.folder)? {
            let part = part?.path();
            if !part.is_dir() {
                continue;
            }
            for file in std::fs::read_dir(part)? {
                let file = file?.path();
                visit(&file, file.file_name().and_then(|name| name.to_str()).and_then(Digest::parse))?;
            }
        }
        Ok(())
    }
}

impl Blobs for FolderBlobs {
    fn put(&self, digest: Digest, bytes: &Bytes) -> io::Result<()> {
        pollster::block_on(self.files.put(&place(digest), bytes.clone().into())).map(drop).map_err(to_io)
    }

    fn get(&self, digest: Digest) -> io::Result<Option<Bytes>> {
        let reading = async { self.files.get(&place(digest)).await?.bytes().await };
        match pollster::block_on(reading) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(to_io(error)),
        }
    }

    fn delete(&self, digest: Digest) -> io::Result<()> {
        match pollster::block_on(self.files.delete(&place(digest))) {
            Ok(()) | Err(object_store::Error::NotFound { .. }) => Ok(()),
            Err(error) => Err(to_io(error)),
        }
    }

    fn list(&self) -> io::Result<Vec<Digest>> {
        let mut all = Vec::new();
        self.each_file(|_, digest| {
            all.extend(digest);
            Ok(())
        })?;
        Ok(all)
    }
}

fn place(digest: Digest) -> path::Path {
    let name = digest.to_string();
    path::Path::from_iter([&name[..2], &name])
}

/// The system's error, which the library wraps, so that a full disk is known as one.
fn to_io(error: object_store::Error) -> io::Error {
    let mut source: Option<&(dyn std::error::Error + 'static)> = Some(&error);
    while let Some(cause) = source {
        if let Some(system) = cause.downcast_ref::<io::Error>() {
            return io::Error::new(system.kind(), error.to_string());
        }
        source = cause.source();
    }
    io::Error::other(error)
}
