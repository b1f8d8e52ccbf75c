//! Finds the format of some bytes from the bytes alone, because names and content types lie.
//!
//! The tests are the formats' own, in [`FORMATS`]. They run by their [`Evidence`], the strongest
//! first; between them stand refusals of what a weaker test would take for a mesh.

use super::bundle::is_zip;
use super::formats::{Evidence, FORMATS, Test};
use super::text::is_utf16;
use super::{Format, MeshError, MeshFault, text};

/// Explains an archive where only plain files are read.
pub const INNER_ZIP: &str = "a zip archive (a bundle or a 3MF file) among other files or inside of another archive, and only \
                             one that is the whole upload is opened: send it alone, or the files that are in it";

/// The format of `bytes`, or why none fits. Errors call the bytes `subject`.
pub fn sniff(bytes: &[u8], subject: &str) -> Result<Format, MeshError> {
    find(bytes, subject).map(|(format, _)| format)
}

/// The format of a file that lies among others, few of which are meshes. Those may be textures,
/// whose bytes can look like a mesh by chance: a picture's signature then overrules all but an
/// exact length, and a plausible header counts only if `by_extension` is the same format.
pub fn sniff_among_others(bytes: &[u8], by_extension: Option<Format>) -> Option<Format> {
    let (format, evidence) = find(bytes, "").ok()?;
    let is_other = known_but_unread(bytes).is_some() && !is_utf16(bytes);
    let is_mesh = match evidence {
        Evidence::ExactLength => true,
        Evidence::Plausible => !is_other && by_extension == Some(format),
        _ => !is_other,
    };
    is_mesh.then_some(format)
}

fn find(bytes: &[u8], subject: &str) -> Result<(Format, Evidence), MeshError> {
    for evidence in Evidence::ORDER {
        // An archive may hold a mesh unpacked, and JSON may hold lines of one: the tests after
        // these would see it.
        if evidence == Evidence::Signature && is_zip(bytes) {
            return Err(MeshError::new(MeshFault::BundleBroken, format!("{subject} is {INNER_ZIP}")));
        }
        if evidence == Evidence::Keyword && text::trim_start(bytes).starts_with(b"{") {
            return Err(unrecognised(&format!("{subject} is JSON but not glTF: there is no \"asset\" property")));
        }
        let passes = |tests: &[Test]| tests.iter().any(|(of_test, test)| *of_test == evidence && test(bytes));
        if let Some(entry) = FORMATS.iter().find(|entry| passes(entry.tests)) {
            return Ok((entry.format, evidence));
        }
    }
    let formats = Format::list();
    Err(match known_but_unread(bytes) {
        Some(name) => unrecognised(&format!("{subject} looks like {name}, which is not read: convert it to {formats}")),
        None => unrecognised(&format!(
            "{subject} is not a mesh in a known format ({formats}); if it is one, name it with format_in"
        )),
    })
}

fn unrecognised(detail: &str) -> MeshError {
    MeshError::new(MeshFault::Unrecognised, detail)
}

/// Names formats that users try and that are not read.
fn known_but_unread(bytes: &[u8]) -> Option<&'static str> {
    let starts = |magic: &[u8]| bytes.starts_with(magic);
    [
        (starts(b"\x89PNG") || starts(b"\xFF\xD8\xFF") || starts(b"RIFF"), "a picture"),
        (starts(b"BLENDER"), "a Blender file"),
        (is_utf16(bytes), "UTF-16 text but not OBJ"),
    ]
    .into_iter()
    .find_map(|(is, name)| is.then_some(name))
}
