//! A file on disk with the compiled pipelines of one kind of GPU, in the driver's own form. It is
//! read when the GPU is opened, so that the driver need not compile the pipelines of an earlier
//! process again, and written when new ones were made. A checksum shows whether the file is
//! damaged.

#![allow(unsafe_code)]

use std::fs;
use std::hash::{BuildHasher as _, RandomState};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rapidhash::v3::rapidhash_v3;

/// Largest file that is read, bytes.
const BYTES_MAX: u64 = 256 << 20;

/// First bytes of a file; a checksum of the rest follows.
const MAGIC: &[u8; 8] = b"msnap-p1";

/// A file for one kind of GPU, and the pipelines of this process, which are written to it.
pub struct PipelineFile {
    path: PathBuf,
    cache: wgpu::PipelineCache,
    /// The checksum of what is on disk. Held while the file is written.
    written: Mutex<Option<u64>>,
}

impl PipelineFile {
    /// The file in a folder, for an adapter. What it holds is used if nothing has damaged it: a folder
    /// that others can write to is not to be trusted with it, because drivers believe what they read.
    /// None if the device keeps no such form.
    pub fn open(folder: &Path, adapter: &wgpu::AdapterInfo, device: &wgpu::Device) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let path = folder.join(format!("{}.bin", wgpu::util::pipeline_cache_key(adapter)?));
        let kept = read(&path).unwrap_or_else(|error| {
            if error.kind() != io::ErrorKind::NotFound {
                tracing::warn!(path = %path.display(), %error, "kept pipelines cannot be read; they are made anew");
            }
            Kept::None
        });
        if matches!(kept, Kept::Damaged) {
            tracing::warn!(path = %path.display(), "kept pipelines are damaged; they are made anew");
        }
        let kept = if let Kept::Whole(data, checksum) = kept { Some((data, checksum)) } else { None };
        let descriptor = wgpu::PipelineCacheDescriptor {
            label: None,
            data: kept.as_ref().map(|(data, _)| &data[..]),
            fallback: true,
        };
        // SAFETY: the data is what `get_data` has given. The checksum shows that nothing has damaged it; that
        // nobody else wrote it is the operator's promise (docs/operations.md). wgpu and the driver compare the
        // adapter and the versions that it begins with.
        let cache = unsafe { device.create_pipeline_cache(&descriptor) };
        tracing::debug!(path = %path.display(), bytes = kept.as_ref().map_or(0, |(data, _)| data.len()), "kept pipelines");
        Some(Self { path, cache, written: Mutex::new(kept.map(|(_, checksum)| checksum)) })
    }

    /// The pipelines as the driver keeps them.
    pub fn cache(&self) -> &wgpu::PipelineCache {
        &self.cache
    }

    /// Writes the file, if it would change and is small enough to be read. A file that cannot be written
    /// costs the next process time, and no more.
    pub fn save(&self) {
        let Some(data) = self.cache.get_data().filter(|data| (data.len() as u64) < BYTES_MAX / 2) else { return };
        let checksum = rapidhash_v3(&data);
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        if *written == Some(checksum) {
            return;
        }
        match write(&self.path, &data, checksum) {
            Ok(()) => *written = Some(checksum),
            Err(error) => tracing::warn!(path = %self.path.display(), %error, "pipelines cannot be kept"),
        }
    }
}

/// The content of a file.
#[derive(Debug, PartialEq)]
enum Kept {
    None,
    Damaged,
    /// The data and its checksum.
    Whole(Vec<u8>, u64),
}

fn read(path: &Path) -> io::Result<Kept> {
    let mut bytes = Vec::new();
    fs::File::open(path)?.take(BYTES_MAX).read_to_end(&mut bytes)?;
    let data = bytes.strip_prefix(MAGIC).and_then(|rest| rest.split_first_chunk::<8>());
    let Some((checksum, data)) = data else { return Ok(Kept::Damaged) };
    let checksum = u64::from_le_bytes(*checksum);
    Ok(if rapidhash_v3(data) == checksum { Kept::Whole(data.to_vec(), checksum) } else { Kept::Damaged })
}

/// Writes a file under another name first, so that a reader sees all of it or nothing.
fn write(path: &Path, data: &[u8], checksum: u64) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        let mut builder = fs::DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.recursive(true).create(folder)?;
    }
    // Not the process's id alone: in containers that share a folder it is often 1.
    let chance = RandomState::new().hash_one(std::process::id());
    let beside = path.with_extension(format!("{chance:016x}.part"));
    let mut file = fs::File::create_new(&beside)?;
    let done = file
        .write_all(MAGIC)
        .and_then(|()| file.write_all(&checksum.to_le_bytes()))
        .and_then(|()| file.write_all(data));
    done.and_then(|()| fs::rename(&beside, path)).inspect_err(|_| {
        let _ = fs::remove_file(&beside);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_file_is_not_used() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("target/pipelines-{}", std::process::id()));
        let path = folder.join("deeper").join("kept.bin");
        assert_eq!(read(&path).unwrap_err().kind(), io::ErrorKind::NotFound);
        let data: Vec<u8> = (0..=255).collect();
        let checksum = rapidhash_v3(&data);
        write(&path, &data, checksum).unwrap();
        assert_eq!(read(&path).unwrap(), Kept::Whole(data, checksum));
        let good = fs::read(&path).unwrap();
        let mut refused = 0;
        for at in [0, 7, 8, 15, 16, 100, good.len() - 1] {
            let mut bad = good.clone();
            bad[at] ^= 1;
            fs::write(&path, bad).unwrap();
            assert_eq!(read(&path).unwrap(), Kept::Damaged, "byte {at}");
            refused += 1;
        }
        for len in [0, 5, 8, 16, good.len() - 1] {
            fs::write(&path, &good[..len]).unwrap();
            assert_eq!(read(&path).unwrap(), Kept::Damaged, "{len} bytes");
            refused += 1;
        }
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(refused, 12);
    }
}
