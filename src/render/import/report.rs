//! The report of an import: counts, repairs, warnings and the file's metadata.

use super::Format;
use crate::warning::Warning;

/// Counts, repairs and warnings of one import, and the file's metadata. `inspect` prints them.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct ImportReport {
    /// Format that was read.
    pub format: Format,
    /// The path of the mesh in its bundle.
    pub path: String,
    /// Bytes of all files of the bundle.
    pub file_bytes: u64,
    /// Vertices in the file, before welding.
    pub file_vertices: u64,
    /// Totals of the file's meshes, shown or not, each counted once. None for all formats but glTF,
    /// the only one whose files declare them.
    pub content: Option<FileContent>,
    /// Polygons in the file: `polygons_by_arity[k]` counts those with `k` corners (12 and more
    /// share the last place).
    pub polygons_by_arity: [u64; 13],
    /// Faces dropped because a corner is NaN or infinite.
    pub dropped_nonfinite_faces: u64,
    /// Faces dropped because two corners are equal or all lie on one line, exactly, in the file's
    /// own numbers.
    pub dropped_degenerate_faces: u64,
    /// The corners of the first of these faces, in the file's numbers.
    pub degenerate_places: Vec<[[f64; 3]; 3]>,
    /// Faces dropped because welding merged two of their corners: they are too small beside the
    /// whole mesh for 24 bits.
    pub dropped_collapsed_faces: u64,
    /// Line segments and points dropped: those with NaN or infinite ends, and segments without a
    /// length.
    pub dropped_lines_and_points: u64,
    /// Vertices of the file that no face, line or point refers to, if they were counted.
    pub loose_vertices: Option<u64>,
    /// Notes for the user, each with a stable code.
    pub warnings: Vec<Warning>,
    /// Metadata of the file.
    pub metadata: FileMetadata,
}

impl ImportReport {
    /// Memory of its lists and texts, bytes.
    pub fn bytes(&self) -> u64 {
        let FileMetadata { generator, extensions_used, extensions_required, .. } = &self.metadata;
        let texts = extensions_used.iter().chain(extensions_required).chain(generator);
        let of_texts = texts.map(|text| size_of::<String>() + text.len()).sum::<usize>() + self.path.len();
        let of_warnings = self.warnings.iter().map(Warning::bytes).sum::<usize>();
        (of_texts + of_warnings + size_of_val(&self.degenerate_places[..])) as u64
    }

    /// Adds loose vertices of a part of the file, if they were counted.
    pub fn add_loose(&mut self, count: Option<u64>) {
        if let Some(count) = count {
            *self.loose_vertices.get_or_insert(0) += count;
        }
    }
}

/// A warning for each kind of thing that occurred: its count, its code, and a sentence that the
/// count ends.
pub fn counted_warnings<const N: usize>(kinds: [(u64, &'static str, &str); N]) -> impl Iterator<Item = Warning> {
    let occurred = kinds.into_iter().filter(|(count, ..)| *count > 0);
    occurred.map(|(count, code, what)| Warning { code, detail: format!("{what} {count})") })
}

/// Totals of a file's meshes, as its own accessors count them, each mesh once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct FileContent {
    /// Primitives: parts of a mesh with one material each.
    pub draw_calls: u64,
    /// Their vertices.
    pub vertices: u64,
    /// Their triangles.
    pub triangles: u64,
    /// Their line segments.
    pub segments: u64,
    /// Their points.
    pub points: u64,
}

/// Metadata of a file. Counts are None where the format has no such thing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct FileMetadata {
    /// The program that wrote the file, or the text of its first comment or header.
    pub generator: Option<String>,
    /// Scenes.
    pub scenes: Option<u64>,
    /// Nodes of all scenes, each counted once.
    pub nodes: Option<u64>,
    /// Meshes, shown or not.
    pub meshes: Option<u64>,
    /// Parts of those meshes with one material each.
    pub primitives: Option<u64>,
    /// Animations.
    pub animations: Option<u64>,
    /// Skins.
    pub skins: Option<u64>,
    /// Cameras, shown or not.
    pub cameras: Option<u64>,
    /// Extensions that the file declares as used.
    pub extensions_used: Vec<String>,
    /// Extensions that the file declares as required.
    pub extensions_required: Vec<String>,
}

impl FileMetadata {
    /// The metadata of a file that only has a generator.
    pub fn by(generator: Option<String>) -> Self {
        Self { generator, ..Self::default() }
    }
}
