//! The recognition of a format by the bytes, because file names and content types are often wrong.
//! An extension counts only if the file lies among others and its bytes prove little.
//!
//! The tests are those of the formats, in [`FORMATS`]. They run in the order of their [`Evidence`]
//! (how much a match proves), the strongest first. Between them, files that a weaker test would
//! wrongly take for a mesh are refused.

pub(crate) mod foreign;

use super::bundle::is_zip;
use super::formats::{Evidence, FORMATS, Test};
use super::text::is_utf16;
use super::{Format, MeshError, MeshFault, Origin, text};

/// Explains an archive where only plain files are read.
pub fn inner_zip(origin: Origin) -> String {
    let advice = origin.send_alone();
    format!("a zip archive (a bundle or a 3MF file) among other files or inside of another archive, and {advice}")
}

/// The format of `bytes`, or why none fits. Errors call the bytes `subject`.
pub fn sniff(bytes: &[u8], subject: &str, origin: Origin) -> Result<Format, MeshError> {
    find(bytes, subject, origin).map(|(format, _)| format)
}

/// The format of a file that lies among others, few of which are meshes. Those may be textures,
/// whose bytes can look like a mesh by chance: a plausible header counts only if `by_extension` is
/// the same format.
pub fn sniff_among_others(bytes: &[u8], by_extension: Option<Format>) -> Option<Format> {
    let (format, evidence) = find(bytes, "", Origin::default()).ok()?;
    let is_mesh = match evidence {
        Evidence::Plausible => by_extension == Some(format),
        _ => true,
    };
    is_mesh.then_some(format)
}

fn find(bytes: &[u8], subject: &str, origin: Origin) -> Result<(Format, Evidence), MeshError> {
    for evidence in Evidence::ORDER {
        // An archive may hold a mesh unpacked, and JSON may hold lines of one: the tests after
        // these would see it.
        if evidence == Evidence::Signature && is_zip(bytes) {
            return Err(MeshError::new(MeshFault::BundleBroken, format!("{subject} is {}", inner_zip(origin))));
        }
        if evidence == Evidence::Keyword && text::trim_start(bytes).starts_with(b"{") {
            return Err(unrecognised(&format!("{subject} is JSON but not glTF: there is no \"asset\" property")));
        }
        if evidence == Evidence::Signature
            && let Some(kind) = foreign::kind_of(bytes)
        {
            return Err(unrecognised(&kind.sentence(subject, &Format::list())));
        }
        let passes = |tests: &[Test]| tests.iter().any(|(of_test, test)| *of_test == evidence && test(bytes));
        if let Some(entry) = FORMATS.iter().find(|entry| passes(entry.tests)) {
            return Ok((entry.format, evidence));
        }
    }
    let formats = Format::list();
    Err(match is_utf16(bytes) {
        true => unrecognised(&format!("{subject} is UTF-16 text but not OBJ: save it as UTF-8, as {formats}")),
        false => unrecognised(&format!(
            "{subject} is not a mesh in a known format ({formats}); if it is one, name it with {}",
            origin.format_option()
        )),
    })
}

fn unrecognised(detail: &str) -> MeshError {
    MeshError::new(MeshFault::Unrecognised, detail)
}
