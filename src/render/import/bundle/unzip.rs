//! The unpacking of a zip archive into the files of an upload. What the archive declares is not
//! trusted. The number of entries and the bytes of all files are limited. An archive is refused if
//! entries share bytes, if entries that are far larger than their packed form take many bytes, or if
//! an entry unpacks to another size than it declares.

use crate::guard::guarded;
use crate::import::bundle::{BundleFile, show};
use crate::import::{MeshError, MeshFault, text};
use crate::limits::{self, Budget, Deadline, Limits};
use bytes::Bytes;
use std::io::{Cursor, Read as _};
use zip::CompressionMethod;
use zip::read::{Config, ZipFileEntry};
use zip::result::ZipError;
use zip::unstable::read::ZipIterable;

/// A local header before its name.
const LOCAL_HEADER_BYTES: u64 = 30;
/// Largest ratio that Deflate can reach: at most 258 bytes from two bits.
const RATIO_MAX: u64 = 1032;
/// An entry of more bytes than this with a larger ratio than the next constant is a bomb: no mesh
/// or texture compresses that well.
const BOMB_BYTES: u64 = 16 << 20;
const BOMB_RATIO: u64 = 200;
/// Allowed bytes of several such entries together: small pictures of a single colour are honest.
const BOMBS_BYTES: u64 = 32 << 20;

/// The files of the archive, without what archivers leave in it.
pub fn unzip(
    archive: &Bytes,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<Vec<BundleFile>, MeshError> {
    guarded("zip", || unpack(archive, limits, budget, deadline))?
}

fn unpack(
    archive: &Bytes,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<Vec<BundleFile>, MeshError> {
    let mut directory = ZipIterable::try_new(Cursor::new(archive.as_ref()), Config::default()).map_err(unreadable)?;
    let entries = directory.len() as u64;
    limits::check(
        "the number of entries in the zip archive",
        entries,
        limits.bundle_entries,
        "--limit-bundle-entries",
    )?;
    let entries: Vec<_> = directory.files().map_err(unreadable)?.collect::<Result<_, _>>().map_err(unreadable)?;
    check_apart(archive, &entries)?;

    // All entries are checked before the first is unpacked.
    let (mut files, mut wanted_entries) = (Vec::new(), Vec::new());
    let mut total = 0_u64;
    for entry in entries {
        deadline.check()?;
        let Some(file) = wanted(&entry)? else { continue };
        file.check_new(&files).map_err(|error| broken(error.to_string()))?;
        total = total.saturating_add(entry.size());
        let what = "the size of the zip archive's files, in bytes,";
        limits::check(what, total, limits.bundle_bytes, "--limit-bundle-bytes")?;
        files.push(file);
        wanted_entries.push(entry);
    }
    budget.spend("the files of the zip archive", total, 1)?;
    check_honest(&wanted_entries, &files)?;
    for (entry, file) in wanted_entries.into_iter().zip(&mut files) {
        file.bytes = inflate(archive, entry, deadline)?.into();
    }
    Ok(files)
}

/// The still empty file for an entry. None for folders and files that archivers add.
fn wanted(entry: &ZipFileEntry<'_>) -> Result<Option<BundleFile>, MeshError> {
    if entry.is_dir() {
        return Ok(None);
    }
    let name = entry
        .name()
        .map_err(|error| broken(format!("a file name in the zip archive is no text: {}", text::foreign(error))))?;
    let refuse = |why: &str| Err(broken(format!("the entry \"{}\" of the zip archive {why}", show(&name))));
    let file =
        BundleFile::new(&name, Bytes::new()).map_err(|e| broken(format!("a zip archive that is refused: {e}")))?;
    if file.path.split('/').any(|part| part == "__MACOSX") || file.base_name() == ".DS_Store" {
        return Ok(None);
    }
    if entry.is_symlink() {
        return refuse("is a symbolic link; archive the files themselves");
    }
    if entry.encrypted() {
        return refuse("is encrypted; send an archive without a password");
    }
    match entry.compression() {
        CompressionMethod::Stored if entry.size() != entry.compressed_size() => {
            refuse("is stored as it is, and yet has two different sizes")
        }
        CompressionMethod::Deflated if entry.size() > entry.compressed_size().saturating_mul(RATIO_MAX) => {
            refuse("claims to be larger than its packed form can be")
        }
        CompressionMethod::Stored | CompressionMethod::Deflated => Ok(Some(file)),
        _ => refuse("is packed by a method that is not read; use Deflate (what `zip` does) or none"),
    }
}

/// Refuses decompression bombs: one large entry or many small ones with an extreme ratio.
fn check_honest(entries: &[ZipFileEntry<'_>], files: &[BundleFile]) -> Result<(), MeshError> {
    let mut total = 0_u64;
    for (entry, file) in entries.iter().zip(files) {
        if entry.size() / BOMB_RATIO <= entry.compressed_size() {
            continue;
        }
        total = total.saturating_add(entry.size());
        if entry.size() > BOMB_BYTES || total > BOMBS_BYTES {
            let others = if entry.size() <= BOMB_BYTES { ", and others before it," } else { "" };
            return Err(broken(format!(
                "the entry \"{}\" of the zip archive{others} is more than {BOMB_RATIO} times as large as its packed form, which \
                 archives of meshes are not; send the file itself",
                show(&file.path)
            )));
        }
    }
    Ok(())
}

/// Refuses entries that share bytes, by which a small archive becomes a large one.
fn check_apart(archive: &[u8], entries: &[ZipFileEntry<'_>]) -> Result<(), MeshError> {
    let directory = entries.iter().map(ZipFileEntry::central_header_start).min().unwrap_or(0);
    let mut ranges = Vec::with_capacity(entries.len());
    for entry in entries {
        let start = entry.header_start();
        let header = usize::try_from(start).ok().and_then(|s| archive.get(s..)?.get(..LOCAL_HEADER_BYTES as usize));
        let lengths = header.map(|h| [h[26], h[27], h[28], h[29]].map(u64::from));
        let end = lengths.and_then(|[n0, n1, e0, e1]| {
            let data = start + LOCAL_HEADER_BYTES + n0 + 256 * n1 + e0 + 256 * e1;
            data.checked_add(entry.compressed_size()).filter(|&end| end <= directory)
        });
        let name = || show(&String::from_utf8_lossy(entry.name_raw()));
        let end = end.ok_or_else(|| {
            broken(format!("the entry \"{}\" of the zip archive lies outside of it, or in its directory", name()))
        })?;
        ranges.push((start, end));
    }
    ranges.sort_unstable();
    if ranges.windows(2).any(|pair| pair[0].1 > pair[1].0) {
        return Err(broken("entries of the zip archive overlap, and each has to have its own bytes".into()));
    }
    Ok(())
}

fn inflate(archive: &Bytes, entry: ZipFileEntry<'_>, deadline: &Deadline) -> Result<Vec<u8>, MeshError> {
    let name = show(&String::from_utf8_lossy(entry.name_raw()));
    let bad = |why: &str| broken(format!("the entry \"{name}\" of the zip archive cannot be unpacked: {why}"));
    let size = usize::try_from(entry.size()).map_err(|_| bad("it is too large"))?;
    let mut cursor = Cursor::new(archive.as_ref());
    let mut reader = entry.with_reader(&mut cursor, zip::ZipReadOptions::new()).map_err(|e| bad(&e.to_string()))?;
    // The size was paid for by the caller and checked against the packed size.
    let mut out = Vec::with_capacity(size);
    let mut chunk = vec![0; 64 << 10];
    loop {
        deadline.check()?;
        let read = reader.read(&mut chunk).map_err(|e| bad(&e.to_string()))?;
        if read == 0 {
            break;
        }
        if out.len() + read > size {
            return Err(bad("it is larger than the archive says"));
        }
        out.extend_from_slice(&chunk[..read]);
    }
    if out.len() < size {
        return Err(bad("it is smaller than the archive says"));
    }
    Ok(out)
}

fn unreadable(error: ZipError) -> MeshError {
    broken(format!("the zip archive cannot be read: {}", text::foreign(error)))
}

fn broken(detail: String) -> MeshError {
    MeshError::new(MeshFault::BundleBroken, detail)
}
