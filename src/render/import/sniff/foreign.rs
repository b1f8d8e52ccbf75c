//! Kinds of files that are recognised but not read, such as other mesh formats, archives and
//! pictures. Each has the words in which callers refuse it, with advice where there is some (convert
//! it, unpack it).
//!
//! Without this, a file of another kind that holds lines of a mesh would be read as a mesh, such as
//! a tar archive of OBJ files.

use crate::import::text::trim_start;

/// A kind of file that is not read.
#[derive(Debug)]
pub struct Foreign {
    /// What the file is, as the end of "it is".
    pub name: &'static str,
    /// What to do with it.
    pub advice: Advice,
    test: fn(&[u8]) -> bool,
}

/// What to do with a file that is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advice {
    /// It holds a mesh of another format.
    Convert,
    /// It holds a mesh after this.
    First(&'static str),
    /// It holds none.
    None,
}

/// Bytes of a text in which its first line or tag is looked for.
const HEAD_BYTES: usize = 1024;

const fn convert(name: &'static str, test: fn(&[u8]) -> bool) -> Foreign {
    Foreign { name, advice: Advice::Convert, test }
}

const fn first(name: &'static str, advice: &'static str, test: fn(&[u8]) -> bool) -> Foreign {
    Foreign { name, advice: Advice::First(advice), test }
}

const fn other(name: &'static str, test: fn(&[u8]) -> bool) -> Foreign {
    Foreign { name, advice: Advice::None, test }
}

/// Every kind, the most certain first.
static KINDS: &[Foreign] = &[
    first("a pointer of Git LFS, not the file that it stands for", "fetch that with `git lfs pull`", |b| {
        b.starts_with(b"version https://git-lfs.github.com/spec/")
    }),
    first("a gzip archive", "unpack it (`gunzip`, or `tar -xzf` of a .tar.gz)", |b| b.starts_with(b"\x1F\x8B\x08")),
    first("a tar archive", "unpack it (`tar -xf`)", is_tar),
    first("a zstd archive", "unpack it (`unzstd`), or save a Blender file without compression and convert it", |b| {
        b.starts_with(b"\x28\xB5\x2F\xFD")
    }),
    first("an xz archive", "unpack it (`unxz`)", |b| b.starts_with(b"\xFD7zXZ\0")),
    first("a bzip2 archive", "unpack it (`bunzip2`)", |b| b.starts_with(b"BZh") && b.get(4..10) == Some(b"1AY&SY")),
    first("a 7z archive", "unpack it (`7z x`)", |b| b.starts_with(b"7z\xBC\xAF\x27\x1C")),
    first("a RAR archive", "unpack it (`unrar x`)", |b| b.starts_with(b"Rar!\x1A\x07")),
    convert("a Blender file", |b| b.starts_with(b"BLENDER")),
    convert("a STEP file", |b| trim_start(b).starts_with(b"ISO-10303-21")),
    convert("a USD file", |b| b.starts_with(b"#usda ") || b.starts_with(b"PXR-USDC")),
    convert("a COLLADA file", |b| is_xml_with(b, b"<COLLADA")),
    convert("an X3D file", |b| is_xml_with(b, b"<X3D")),
    convert("an AMF file", |b| is_xml_with(b, b"<amf")),
    convert("a VRML file", |b| b.starts_with(b"#VRML ")),
    convert("an Alembic file", |b| b.starts_with(b"Ogawa")),
    convert("a Maya file", |b| {
        b.starts_with(b"//Maya ASCII") || b.starts_with(b"FOR4") && b.get(8..12) == Some(b"MAYA")
    }),
    convert("a LightWave file", |b| {
        b.starts_with(b"FORM") && matches!(b.get(8..12), Some(b"LWO2" | b"LWO3" | b"LWOB"))
    }),
    convert("a Rhino file", |b| b.starts_with(b"3D Geometry File Format ")),
    convert("a 3D Studio file", is_3ds),
    other("a picture", |b| {
        let is_riff = |kind: &[u8]| b.starts_with(b"RIFF") && b.get(8..12) == Some(kind);
        b.starts_with(b"\x89PNG\r\n\x1A\n")
            || b.starts_with(b"\xFF\xD8\xFF")
            || b.starts_with(b"GIF8")
            || is_riff(b"WEBP")
    }),
    other("a RIFF file (a sound or a video)", |b| b.starts_with(b"RIFF")),
    other("a PDF file", |b| b.starts_with(b"%PDF-")),
    other("an HTML page", |b| {
        let head: Vec<u8> = trim_start(b).iter().take(14).map(u8::to_ascii_lowercase).collect();
        head.starts_with(b"<!doctype html") || head.starts_with(b"<html")
    }),
    other("a program", |b| b.starts_with(b"\x7FELF")),
];

/// What the file is, if it is known not to be a mesh that is read.
pub fn kind_of(bytes: &[u8]) -> Option<&'static Foreign> {
    KINDS.iter().find(|kind| (kind.test)(bytes))
}

impl Foreign {
    /// A sentence about `subject`, which is one of these; `formats` are those that are read.
    pub fn sentence(&self, subject: &str, formats: &str) -> String {
        let name = self.name;
        match self.advice {
            Advice::Convert => format!("{subject} is {name}, which is not read: convert it to {formats}"),
            Advice::First(what) => format!("{subject} is {name}: {what}"),
            Advice::None => format!("{subject} is {name} and not a mesh ({formats})"),
        }
    }
}

/// A tar archive: its first header has the mark of POSIX or GNU, or else a checksum that is right.
fn is_tar(bytes: &[u8]) -> bool {
    const CHECKSUM: std::ops::Range<usize> = 148..156;
    let Some(header) = bytes.get(..512) else { return false };
    if header[257..].starts_with(b"ustar") {
        return true;
    }
    // Octal digits, then spaces or zeros; the sum counts its own place as spaces.
    let digits = header[CHECKSUM].trim_ascii().split(|&b| b == 0 || b == b' ').next().unwrap_or_default();
    let declared = std::str::from_utf8(digits).ok().and_then(|digits| u32::from_str_radix(digits, 8).ok());
    let sum = |part: &[u8]| part.iter().map(|&b| u32::from(b)).sum::<u32>();
    let actual = sum(&header[..CHECKSUM.start]) + 8 * u32::from(b' ') + sum(&header[CHECKSUM.end..]);
    header[0] != 0 && declared == Some(actual)
}

/// XML whose first element is this one, as far as the first bytes tell.
fn is_xml_with(bytes: &[u8], tag: &[u8]) -> bool {
    let head = trim_start(&bytes[..bytes.len().min(HEAD_BYTES)]);
    head.starts_with(b"<") && head.windows(tag.len()).any(|part| part == tag)
}

/// A main chunk that is as long as the file, with a chunk of the editor or the version in it.
fn is_3ds(bytes: &[u8]) -> bool {
    let length = bytes.get(2..6).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]));
    bytes.starts_with(b"MM") && length.map(|n| n as usize) == Some(bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tar of one file, with the mark of its kind.
    fn tar(content: &[u8], mark: &[u8]) -> Vec<u8> {
        let mut header = vec![0_u8; 512];
        header[..8].copy_from_slice(b"cube.obj");
        header[100..108].copy_from_slice(b"0000644\0");
        header[124..136].copy_from_slice(format!("{:011o}\0", content.len()).as_bytes());
        header[156] = b'0';
        header[257..257 + mark.len()].copy_from_slice(mark);
        header[148..156].fill(b' ');
        let sum: u32 = header.iter().map(|&b| u32::from(b)).sum();
        header[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
        header.extend_from_slice(content);
        header.resize(header.len().next_multiple_of(512) + 1024, 0);
        header
    }

    #[test]
    fn other_files_are_known_for_what_they_are() {
        let obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        let cases: Vec<(Vec<u8>, &str)> = vec![
            (tar(obj, b"ustar\x0000"), "a tar archive"),
            (tar(obj, b"ustar  \0"), "a tar archive"),
            (tar(obj, b""), "a tar archive"),
            (b"\x1F\x8B\x08\0\0\0\0\0".to_vec(), "a gzip archive"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n".to_vec(), "a pointer of Git LFS"),
            (b"ISO-10303-21;\nHEADER;\n".to_vec(), "a STEP file"),
            (b"#usda 1.0\n".to_vec(), "a USD file"),
            (b"PXR-USDC\0\x08".to_vec(), "a USD file"),
            (b"<?xml version=\"1.0\"?>\n<!-- v 0 0 0 -->\n<COLLADA xmlns=\"\">".to_vec(), "a COLLADA file"),
            (b"BLENDER-v300".to_vec(), "a Blender file"),
            (b"\x28\xB5\x2F\xFD....".to_vec(), "a zstd archive"),
            (b"\x89PNG\r\n\x1A\n".to_vec(), "a picture"),
            (b"<!DOCTYPE html>\n<html>".to_vec(), "an HTML page"),
            (b"#VRML V2.0 utf8\n".to_vec(), "a VRML file"),
            (b"MM\x06\0\0\0".to_vec(), "a 3D Studio file"),
        ];
        for (bytes, name) in &cases {
            let kind = kind_of(bytes).unwrap_or_else(|| panic!("{name}"));
            assert!(kind.name.starts_with(name), "{name}: {kind:?}");
        }
        for bytes in [&obj[..], b"", b"solid x", b"ply\n", b"MM", &[0; 600], b"#usd is no keyword here\nv 0 0 0\n"] {
            assert!(kind_of(bytes).is_none(), "{bytes:?}");
        }
    }
}
