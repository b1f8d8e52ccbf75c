//! Which format some bytes are in, from the bytes alone: names and content types lie.

use super::{Format, MeshError, MeshFault, fbx, off, ply, stl, text};

/// How far into a text its first telling line may be. Exporters write long comment headers.
const TEXT_SNIFF_BYTES: usize = 1 << 20;

/// What an archive is where only files are looked at.
pub const INNER_ZIP: &str = "a zip archive (a bundle or a 3MF file) among other files or inside of another archive, and only \
                             one that is the whole upload is opened: send it alone, or the files that are in it";

/// The format of `bytes`, or why none fits; `what` is what an error calls them.
pub fn sniff(bytes: &[u8], what: &str) -> Result<Format, MeshError> {
    // Before anything that looks at text: a binary STL may well begin with "solid".
    if stl::is_exact_binary(bytes) {
        return Ok(Format::StlBinary);
    }
    // Before text: what an archive stores without packing it may read as a mesh.
    if is_zip(bytes) {
        return Err(MeshError::new(MeshFault::BundleBroken, format!("{what} is {INNER_ZIP}")));
    }
    if bytes.starts_with(b"glTF") {
        return Ok(Format::Glb);
    }
    if ply::is_ply(bytes) {
        return Ok(Format::Ply);
    }
    if off::is_off(bytes) {
        return Ok(Format::Off);
    }
    if fbx::is_fbx(bytes) {
        return Ok(Format::Fbx);
    }
    // Notepad's "Unicode". Of the text formats, OBJ is the one that people edit.
    if text::is_utf16(bytes) && looks_like_obj(&text::head(bytes, TEXT_SNIFF_BYTES)) {
        return Ok(Format::Obj);
    }
    let text = trim_start(bytes);
    if text.starts_with(b"{") {
        return if contains(text, b"\"asset\"") {
            Ok(Format::Gltf)
        } else {
            Err(unrecognised(&format!("{what} is JSON but not glTF: there is no \"asset\" property")))
        };
    }
    if stl::is_ascii(text) {
        return Ok(Format::StlAscii);
    }
    if looks_like_obj(text) {
        return Ok(Format::Obj);
    }
    if stl::is_loose_binary(bytes) {
        return Ok(Format::StlBinary);
    }
    if let Some(name) = known_but_unread(bytes) {
        return Err(unrecognised(&format!(
            "{what} looks like {name}, which is not read: convert it to {}",
            Format::ALL
        )));
    }
    Err(unrecognised(&format!(
        "{what} is not a mesh in a known format ({}); if it is one, name it with format_in",
        Format::ALL
    )))
}

/// The format of a file that lies among others, few of which are meshes. What only resembles a binary STL is one if it
/// `may_be_stl` by its name.
pub fn sniff_among_others(bytes: &[u8], may_be_stl: bool) -> Option<Format> {
    if is_zip(bytes) || known_but_unread(bytes).is_some() && !text::is_utf16(bytes) {
        return stl::is_exact_binary(bytes).then_some(Format::StlBinary);
    }
    let format = sniff(bytes, "").ok()?;
    (format != Format::StlBinary || may_be_stl || stl::is_exact_binary(bytes)).then_some(format)
}

/// Without a byte order mark and leading white space.
pub fn trim_start(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start()
}

/// Whether this is a zip archive with something in it.
pub fn is_zip(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

fn unrecognised(detail: &str) -> MeshError {
    MeshError::new(MeshFault::Unrecognised, detail)
}

fn contains(haystack: &[u8], needle: &[u8]) -> bool {
    haystack.windows(needle.len()).any(|w| w == needle)
}

/// A vertex with three numbers or a face with an index: words alone also begin lines of prose and of noise.
fn looks_like_obj(text: &[u8]) -> bool {
    let head = &text[..text.len().min(TEXT_SNIFF_BYTES)];
    head.split(|&b| b == b'\n' || b == b'\r').any(|line| {
        let Ok(line) = std::str::from_utf8(line) else { return false };
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => words.by_ref().take(3).filter(|w| w.parse::<f64>().is_ok()).count() == 3,
            Some("f") => words.next().is_some_and(is_corner),
            _ => false,
        }
    })
}

fn is_corner(word: &str) -> bool {
    word.split('/').next().is_some_and(|index| index.parse::<i64>().is_ok())
}

/// Formats that users try and we can name.
fn known_but_unread(bytes: &[u8]) -> Option<&'static str> {
    let starts = |magic: &[u8]| bytes.starts_with(magic);
    [
        (starts(b"\x89PNG") || starts(b"\xFF\xD8\xFF") || starts(b"RIFF"), "a picture"),
        (starts(b"BLENDER"), "a Blender file"),
        (starts(b"\xFF\xFE") || starts(b"\xFE\xFF"), "UTF-16 text but not OBJ"),
    ]
    .into_iter()
    .find_map(|(is, name)| is.then_some(name))
}
