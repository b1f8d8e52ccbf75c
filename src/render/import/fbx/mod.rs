//! Autodesk FBX, binary and ASCII, parsed by the C library `ufbx`. The library gets bytes, a cap on
//! memory and a deadline callback, and opens no file. Indices that it returns are checked again.
//! Without the feature `fbx` the files are recognised and refused.
//!
//! `isolated` has a file read in another process, if the program has set one up. [`scene`] loads a
//! file, [`costs`] and [`bombs`] refuse those that would take too much time or memory,
//! [`visibility`] finds hidden nodes, [`geometry`] places meshes and splits their polygons, and
//! [`materials`] reads materials and images.

#[cfg(feature = "fbx")]
mod bombs;
#[cfg(feature = "fbx")]
mod costs;
#[cfg(feature = "fbx")]
mod geometry;
#[cfg(all(feature = "fbx", feature = "isolate"))]
mod isolated;
#[cfg(feature = "fbx")]
mod materials;
#[cfg_attr(not(feature = "fbx"), path = "absent.rs")]
mod scene;
#[cfg(feature = "fbx")]
mod visibility;

#[cfg(all(feature = "fbx", feature = "isolate"))]
pub use isolated::answer;

use super::MeshError;
use super::context::Context;
use super::raw::RawMesh;
use super::text;

/// Reads an FBX file, in another process if the program has set one up.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    #[cfg(all(feature = "fbx", feature = "isolate"))]
    if let Some(isolation) = super::isolate::isolation() {
        return isolated::read(bytes, isolation, cx);
    }
    scene::read(bytes, cx)
}

/// Bytes of a text that are searched for its keywords.
const TEXT_SNIFF_BYTES: usize = 4096;
/// True if the bytes begin as an FBX file of either kind.
pub fn is_fbx(bytes: &[u8]) -> bool {
    if bytes.starts_with(b"Kaydara FBX Binary") {
        return true;
    }
    let text = text::trim_start(bytes);
    let head = &text[..text.len().min(TEXT_SNIFF_BYTES)];
    let has = |word: &[u8]| head.windows(word.len()).any(|w| w == word);
    head.starts_with(b"; FBX") || (has(b"FBXHeaderExtension:") && has(b"{"))
}
