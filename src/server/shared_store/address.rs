//! Addresses of shared stores: `s3://BUCKET/PREFIX`, or `file:///FOLDER` for a folder that all machines mount.

use std::sync::Arc;

use object_store::ObjectStore;
use object_store::local::LocalFileSystem;

/// The error of an address that names no store.
#[derive(Debug, thiserror::Error)]
pub enum AddressError {
    /// The address has another form.
    #[error(
        "--store `{0}` is no address of a shared store: write s3://BUCKET/PREFIX, or file:///FOLDER for a folder that all servers mount"
    )]
    Form(String),
    /// The folder cannot be used.
    #[error("--store: the folder {folder} cannot be used: {cause}")]
    Folder {
        /// The folder.
        folder: String,
        /// The cause.
        cause: std::io::Error,
    },
    /// The settings of the bucket are wrong.
    #[error("--store: {0}")]
    Bucket(String),
    /// The program was built without S3.
    #[cfg(not(feature = "cluster"))]
    #[error("--store: this program was built without S3 (the feature `cluster`); file:///FOLDER works")]
    Absent,
}

/// The beginning of the address of a folder.
pub const FOLDER_SCHEME: &str = "file://";

/// The store at an address. Paths of objects are relative to it.
pub fn open(address: &str) -> Result<Arc<dyn ObjectStore>, AddressError> {
    let form = || AddressError::Form(address.to_owned());
    if let Some(folder) = address.strip_prefix(FOLDER_SCHEME) {
        return if folder.starts_with('/') { open_folder(folder) } else { Err(form()) };
    }
    let place = address.strip_prefix("s3://").ok_or_else(form)?;
    let (bucket, prefix) = place.split_once('/').unwrap_or((place, ""));
    let is_name = |text: &str| text.bytes().all(|b| b.is_ascii_alphanumeric() || b"-._/".contains(&b));
    if bucket.is_empty() || !is_name(bucket) || !is_name(prefix) {
        return Err(form());
    }
    open_bucket(bucket, prefix.trim_matches('/'))
}

fn open_folder(folder: &str) -> Result<Arc<dyn ObjectStore>, AddressError> {
    let error = |cause| AddressError::Folder { folder: folder.to_owned(), cause };
    // A folder that is missing is not made: it may be one that is not mounted yet.
    std::fs::read_dir(folder).map_err(error)?;
    let files = LocalFileSystem::new_with_prefix(folder).map_err(|cause| error(std::io::Error::other(cause)))?;
    Ok(Arc::new(files.with_fsync(true)))
}

#[cfg(feature = "cluster")]
fn open_bucket(bucket: &str, prefix: &str) -> Result<Arc<dyn ObjectStore>, AddressError> {
    super::s3::open(bucket, prefix).map_err(AddressError::Bucket)
}

#[cfg(not(feature = "cluster"))]
fn open_bucket(_: &str, _: &str) -> Result<Arc<dyn ObjectStore>, AddressError> {
    Err(AddressError::Absent)
}
