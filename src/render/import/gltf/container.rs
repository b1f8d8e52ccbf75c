//! The GLB container: a header and chunks. Our own code, because the `gltf` crate underflows on a
//! length below 12 and refuses chunks of unknown types, which the specification wants ignored.

use crate::import::{MeshError, MeshFault};
use crate::pluralise::pluralise;
use crate::warning::Warning;

/// The chunks of a GLB file.
#[derive(Debug)]
pub struct Glb<'a> {
    /// The glTF document.
    pub json: &'a [u8],
    /// The data of the first buffer.
    pub bin: Option<&'a [u8]>,
    /// Warnings about the container.
    pub warnings: Vec<Warning>,
}

const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// Takes the container apart.
pub fn split(bytes: &[u8]) -> Result<Glb<'_>, MeshError> {
    let (Some(version), Some(length)) = (u32_at(bytes, 4), u32_at(bytes, 8)) else {
        return Err(MeshError::broken(format!(
            "the GLB file is {} long, and its header alone is {HEADER_BYTES}",
            pluralise(bytes.len(), "byte", "bytes")
        )));
    };
    if !bytes.starts_with(b"glTF") {
        return Err(MeshError::broken("the file does not begin with \"glTF\", as a GLB file does"));
    }
    if version != 2 {
        return Err(MeshError::new(
            MeshFault::Unsupported,
            format!("the GLB header at byte 4 says version {version}, and version 2 is read"),
        ));
    }
    let mut warnings = Vec::new();
    let bytes = match usize::try_from(length).ok().and_then(|n| bytes.get(..n).map(|b| (b, bytes.len() - n))) {
        Some((inside, 0)) => inside,
        Some((inside, more)) => {
            let detail = format!("ignored: {} after the end of the GLB container", pluralise(more, "byte", "bytes"));
            warnings.push(Warning { code: "trailing_bytes", detail });
            inside
        }
        None => {
            return Err(MeshError::broken(format!(
                "the GLB header at byte 8 says {length} bytes, and the file has {}: it is cut off or its header is wrong",
                bytes.len()
            )));
        }
    };
    let (json_type, json, next) = chunk(bytes, HEADER_BYTES)?;
    if json_type != *b"JSON" {
        return Err(MeshError::broken("the first GLB chunk, at byte 12, is not of type JSON"));
    }
    // Only the chunk right after the JSON can be the binary buffer; whatever else follows is for
    // others.
    let bin = if next < bytes.len() { Some(chunk(bytes, next)?) } else { None };
    let bin = bin.filter(|(kind, _, _)| kind == b"BIN\0").map(|(_, data, _)| data);
    Ok(Glb { json, bin, warnings })
}

/// The chunk at an offset: its type, its data and where the next one begins.
fn chunk(bytes: &[u8], at: usize) -> Result<([u8; 4], &[u8], usize), MeshError> {
    let cut_off = || MeshError::broken(format!("the GLB chunk at byte {at} is cut off"));
    let length = u32_at(bytes, at).ok_or_else(cut_off)? as usize;
    let kind = bytes.get(at + 4..at + 8).and_then(|b| b.try_into().ok()).ok_or_else(cut_off)?;
    let start = at + CHUNK_HEADER_BYTES;
    let data = bytes.get(start..).and_then(|rest| rest.get(..length)).ok_or_else(|| {
        let left = bytes.len().saturating_sub(start);
        MeshError::broken(format!("the GLB chunk at byte {at} says {length} bytes, and only {left} follow"))
    })?;
    Ok((kind, data, start + length))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}
