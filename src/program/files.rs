//! The reading of a file, or of standard input under the name `-`, up to a largest size, and the writing to standard
//! output. The error for a misspelt name proposes a similar one in the same folder, if there is one.

use std::fs::File;
use std::io::{self, ErrorKind, Read as _, Seek as _, Write as _};
use std::path::Path;

use bytes::Bytes;

use crate::error::CliError;

/// Files from this size on are read into large pages, bytes. A page of 4 KiB takes longer to get than
/// to fill.
const LARGE_BYTES: u64 = 1 << 20;

/// Most files of a folder that a misspelt name is compared with.
const NEIGHBOURS_MAX: usize = 10_000;

/// A large page, bytes. Memory of whole ones needs no others.
#[cfg(target_os = "linux")]
const LARGE_PAGE_BYTES: usize = 2 << 20;

/// Reads a whole file, or standard input for `-`, of at most `bytes_max`.
pub fn read(name: &str, bytes_max: u64) -> Result<Bytes, CliError> {
    let failed = |error: io::Error| unreadable(name, &error);
    let limit = bytes_max.saturating_add(1);
    let mut bytes = Vec::new();
    if name == "-" {
        io::stdin().lock().take(limit).read_to_end(&mut bytes).map_err(failed)?;
    } else {
        let mut file = File::open(name).map_err(failed)?;
        // One read into a buffer of the right size. The length is a hint: files may grow, and some
        // have none.
        let metadata = file.metadata().map_err(failed)?;
        if metadata.is_dir() {
            return Err(CliError::usage(format!("{name}: is a folder, and a file is needed")));
        }
        if metadata.is_file() && metadata.len() > bytes_max {
            return Err(too_large(name, bytes_max));
        }
        let length = metadata.len().min(bytes_max);
        if length >= LARGE_BYTES {
            if let Some(bytes) = read_large(&mut file, length).map_err(failed)? {
                return Ok(bytes);
            }
            file.rewind().map_err(failed)?;
        }
        bytes
            .try_reserve_exact(usize::try_from(length).unwrap_or(0).saturating_add(1))
            .map_err(|_| CliError::input(format!("{name}: there is no memory for its {length} bytes")))?;
        file.take(limit).read_to_end(&mut bytes).map_err(failed)?;
    }
    if bytes.len() as u64 > bytes_max {
        return Err(too_large(name, bytes_max));
    }
    Ok(bytes.into())
}

/// The reason why a file cannot be read, and for a misspelt name the nearest one.
fn unreadable(name: &str, error: &io::Error) -> CliError {
    match error.kind() {
        ErrorKind::NotFound => match nearest(Path::new(name)) {
            Some(near) => CliError::input(format!("{name}: there is no such file; did you mean {near}?")),
            None => CliError::input(format!("{name}: there is no such file")),
        },
        ErrorKind::PermissionDenied => CliError::input(format!("{name}: may not be read by this user")),
        ErrorKind::IsADirectory => CliError::usage(format!("{name}: is a folder, and a file is needed")),
        _ => CliError::input(format!("{name}: cannot be read: {error}")),
    }
}

/// The file in the same folder whose name is nearest, by at most two letters.
fn nearest(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let names = std::fs::read_dir(folder).ok()?.take(NEIGHBOURS_MAX);
    let names = names.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let distance = |name: &str| strsim::damerau_levenshtein(wanted, name);
    // A link to nothing is there, and no file.
    let others = names.filter(|name| name != wanted);
    let (distance, name) = others.map(|name| (distance(&name), name)).min()?;
    (distance <= 2 && 2 * distance < wanted.chars().count()).then(|| path.with_file_name(name).display().to_string())
}

fn too_large(name: &str, bytes_max: u64) -> CliError {
    CliError::input(format!("{name}: is larger than {bytes_max} bytes (raise it with --limit-memory-bytes)"))
}

/// Reads a file of this length into large pages, where the system has them. None if it has none, or
/// if the file has another length.
#[cfg(target_os = "linux")]
fn read_large(file: &mut File, length: u64) -> io::Result<Option<Bytes>> {
    let Ok(length) = usize::try_from(length) else { return Ok(None) };
    let Some(whole) = length.checked_next_multiple_of(LARGE_PAGE_BYTES) else { return Ok(None) };
    let Ok(mut pages) = memmap2::MmapMut::map_anon(whole) else { return Ok(None) };
    if pages.advise(memmap2::Advice::HugePage).is_err() {
        return Ok(None);
    }
    match file.read_exact(&mut pages[..length]) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(None),
        other => other?,
    }
    let has_more = file.read(&mut [0])? > 0;
    Ok((!has_more).then(|| Bytes::from_owner(pages).slice(..length)))
}

/// No system but Linux is asked for large pages.
#[cfg(not(target_os = "linux"))]
fn read_large(_file: &mut File, _length: u64) -> io::Result<Option<Bytes>> {
    Ok(None)
}

/// Writes to standard output. A reader that stops early, such as `head`, is not an error.
pub fn print(bytes: &[u8]) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(CliError::ours(format!("standard output cannot be written: {error}")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes that differ from page to page.
    fn bytes_of(length: usize) -> Vec<u8> {
        (0..length).map(|i| (i / 4096 + i) as u8).collect()
    }

    #[test]
    fn files_of_all_sizes_are_read_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh");
        let name = path.to_str().unwrap();
        let large = LARGE_BYTES as usize;
        for length in [0, 1, large - 1, large, large + 1, 3 * large + 12_345] {
            let bytes = bytes_of(length);
            std::fs::write(&path, &bytes).unwrap();
            assert!(read(name, u64::MAX).unwrap() == bytes, "{length}");
            assert!(read(name, length as u64).unwrap() == bytes, "{length} of as many");
            assert_eq!(read(name, (length as u64).saturating_sub(1)).is_err(), length > 0, "{length} of one less");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_of_another_length_is_not_read_into_large_pages() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh");
        let bytes = bytes_of(1 << 20);
        std::fs::write(&path, &bytes).unwrap();
        let read_as = |length: u64| read_large(&mut File::open(&path).unwrap(), length).unwrap();
        // Kernels may be built without large pages.
        let has_large_pages = Path::new("/sys/kernel/mm/transparent_hugepage").exists();
        assert_eq!(read_as(1 << 20).is_some_and(|read| read == bytes), has_large_pages);
        assert!(read_as((1 << 20) - 1).is_none(), "it has grown");
        assert!(read_as((1 << 20) + 1).is_none(), "it has shrunk");
    }
}
