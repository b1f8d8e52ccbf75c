//! The table of mesh formats: for each its names, its file extensions, the tests that recognise its
//! bytes or its package, and the function that reads it.
//!
//! From this table follow the recognition of files, the choice of the mesh in an upload, the
//! request field `format_in`, the lists of formats in messages and help texts, the daemon's
//! description of what it can do (capabilities), and the fuzz targets of formats.

use super::bundle::BundleFile;
use super::context::Context;
use super::raw::RawMesh;
use super::{Format, MeshError, fbx, gltf, obj, off, ply, stl, three_mf};

/// A sniffing test, and the strength of its evidence.
pub type Test = (Evidence, fn(&[u8]) -> bool);

/// Finds the first file to read among the unpacked files of a package, or None if they are none.
pub type PackageStart = fn(&[BundleFile]) -> Option<usize>;

/// A row of the table: everything about one format beside its importer.
pub struct FormatEntry {
    /// The format.
    pub format: Format,
    /// Name in `format_in`, `--format-in` and reports. Both kinds of STL share one.
    pub name: &'static str,
    /// Name in a sentence about a file of the format.
    pub label: &'static str,
    /// Name in a list of formats.
    pub list_label: &'static str,
    /// File extensions in lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Tests that recognise bytes of the format.
    pub tests: &'static [Test],
    /// For formats that are a zip package.
    pub package_start: Option<PackageStart>,
    /// Reads a file of the format, given its bytes.
    pub read: fn(&[u8], &mut Context<'_>) -> Result<RawMesh, MeshError>,
    /// True if a file can have animations, and so a `scene.time_s`.
    pub has_animations: bool,
}

/// The strength of a sniffing test. Tests run in this order, and tests of equal strength in the
/// order of [`FORMATS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Evidence {
    /// The length is exactly what the header declares. Asked before anything that looks at text,
    /// because a binary STL may begin with the word `solid` of the ASCII kind.
    ExactLength,
    /// The first bytes are the format's own.
    Signature,
    /// A JSON document with the property that the format requires.
    Document,
    /// A text with the format's keywords.
    Keyword,
    /// A line of text that parses as a statement of the format.
    Statement,
    /// A plausible header, and a length that does not quite fit it.
    Plausible,
}

impl Evidence {
    /// All of it, the strongest first.
    pub const ORDER: [Self; 6] =
        [Self::ExactLength, Self::Signature, Self::Document, Self::Keyword, Self::Statement, Self::Plausible];
}

/// Defaults of a row.
const PLAIN: FormatEntry = FormatEntry {
    format: Format::Obj,
    name: "",
    label: "",
    list_label: "",
    extensions: &[],
    tests: &[],
    package_start: None,
    read: obj::read,
    has_animations: false,
};

/// Every format that is read, in the order in which clients see their names.
pub const FORMATS: &[FormatEntry] = &[
    FormatEntry {
        format: Format::Obj,
        name: "obj",
        label: "OBJ",
        list_label: "OBJ",
        extensions: &["obj"],
        tests: &[(Evidence::Statement, obj::is_obj)],
        read: obj::read,
        ..PLAIN
    },
    FormatEntry {
        format: Format::Gltf,
        name: "gltf",
        label: "glTF",
        list_label: "glTF",
        extensions: &["gltf"],
        tests: &[(Evidence::Document, gltf::is_gltf)],
        read: gltf::read,
        has_animations: true,
        ..PLAIN
    },
    FormatEntry {
        format: Format::Glb,
        name: "glb",
        label: "GLB",
        list_label: "GLB",
        extensions: &["glb"],
        tests: &[(Evidence::Signature, gltf::is_glb)],
        read: gltf::read,
        has_animations: true,
        ..PLAIN
    },
    FormatEntry {
        format: Format::StlBinary,
        name: "stl",
        label: "binary STL",
        list_label: "STL",
        extensions: &["stl"],
        tests: &[(Evidence::ExactLength, stl::is_exact_binary), (Evidence::Plausible, stl::is_plausible_binary)],
        read: stl::read,
        ..PLAIN
    },
    FormatEntry {
        format: Format::StlAscii,
        name: "stl",
        label: "ASCII STL",
        list_label: "STL",
        extensions: &["stl"],
        tests: &[(Evidence::Keyword, stl::is_ascii)],
        read: stl::read,
        ..PLAIN
    },
    FormatEntry {
        format: Format::Ply,
        name: "ply",
        label: "PLY",
        list_label: "PLY",
        extensions: &["ply"],
        tests: &[(Evidence::Signature, ply::is_ply)],
        read: ply::read,
        ..PLAIN
    },
    FormatEntry {
        format: Format::Off,
        name: "off",
        label: "OFF",
        list_label: "OFF",
        extensions: &["off"],
        tests: &[(Evidence::Signature, off::is_off)],
        read: off::read,
        ..PLAIN
    },
    FormatEntry {
        format: Format::Fbx,
        name: "fbx",
        label: "FBX",
        list_label: "FBX",
        extensions: &["fbx"],
        tests: &[(Evidence::Signature, fbx::is_fbx)],
        read: fbx::read,
        ..PLAIN
    },
    FormatEntry {
        format: Format::ThreeMf,
        name: "3mf",
        label: "3MF",
        list_label: "3MF",
        extensions: &["3mf"],
        package_start: Some(three_mf::start_part),
        read: |_, cx| three_mf::read(cx),
        ..PLAIN
    },
];

impl Format {
    /// All names that [`Format::from_name`] knows.
    pub fn names() -> Vec<&'static str> {
        let mut names: Vec<_> = FORMATS.iter().map(|entry| entry.name).collect();
        names.dedup();
        names
    }

    /// All formats for a sentence: `OBJ, STL ... or GLB`.
    pub fn list() -> String {
        let mut entries: Vec<_> = FORMATS.iter().collect();
        // glTF and GLB are two containers of one format, and close the list.
        entries.sort_by_key(|entry| matches!(entry.format, Self::Gltf | Self::Glb));
        let mut labels: Vec<_> = entries.iter().map(|entry| entry.list_label).collect();
        labels.dedup();
        join(&labels)
    }

    /// The format with a name, in any letter case. `stl` may be either kind: its importer looks.
    pub fn from_name(name: &str) -> Option<Self> {
        FORMATS.iter().find(|entry| entry.name.eq_ignore_ascii_case(name)).map(|entry| entry.format)
    }

    /// The format of a file extension in lower case.
    pub fn from_extension(extension: &str) -> Option<Self> {
        FORMATS.iter().find(|entry| entry.extensions.contains(&extension)).map(|entry| entry.format)
    }

    /// Its name in requests and reports.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// Its row of the table.
    pub(crate) fn entry(self) -> &'static FormatEntry {
        // A test finds a row for each.
        FORMATS.iter().find(|entry| entry.format == self).unwrap_or(&FORMATS[0])
    }
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.entry().label)
    }
}

/// `a, b or c`
fn join(words: &[&str]) -> String {
    match words {
        [] => String::new(),
        [only] => (*only).to_owned(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_has_a_row_and_a_way_to_be_found() {
        use Format::{Fbx, Glb, Gltf, Obj, Off, Ply, StlAscii, StlBinary, ThreeMf};
        // Not exhaustive by itself: `format_number` below does not compile while a variant is
        // missing.
        let all = [Obj, Gltf, Glb, StlBinary, StlAscii, Ply, Off, Fbx, ThreeMf];
        let format_number = |format: Format| match format {
            Obj => 0,
            Gltf => 1,
            Glb => 2,
            StlBinary => 3,
            StlAscii => 4,
            Ply => 5,
            Off => 6,
            Fbx => 7,
            ThreeMf => 8,
        };
        assert_eq!(FORMATS.len(), all.len());
        for (i, format) in all.into_iter().enumerate() {
            assert_eq!((format_number(format), FORMATS[i].format, format.entry().format), (i, format, format));
            let entry = format.entry();
            assert!(!entry.tests.is_empty() || entry.package_start.is_some(), "{format}");
            assert_eq!(Format::from_name(&entry.name.to_uppercase()).map(Format::name), Some(entry.name));
            assert!(entry.extensions.contains(&entry.name) && !entry.label.is_empty() && !entry.list_label.is_empty());
        }
        assert!(Evidence::ORDER.is_sorted());
    }

    #[test]
    fn lists_are_sentences() {
        assert_eq!(Format::list(), "OBJ, STL, PLY, OFF, FBX, 3MF, glTF or GLB");
        assert_eq!((Format::from_name("dae"), Format::from_extension("")), (None, None));
    }

    #[test]
    fn the_api_document_has_the_same_names() {
        let document: serde_json::Value = serde_json::from_str(include_str!("../../../api/openapi.json")).unwrap();
        let parameters = document["components"]["parameters"].as_object().unwrap();
        let format_in = parameters.values().find(|parameter| parameter["name"] == "format_in").unwrap();
        assert_eq!(format_in["schema"]["enum"], serde_json::json!(Format::names()));
    }
}
