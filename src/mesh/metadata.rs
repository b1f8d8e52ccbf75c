//! File metadata: what a file says of itself beside its mesh, for reports.

/// What a file says of itself. Counts are None where the format has no such thing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileMetadata {
    /// Who wrote it, or what its first comment or header says.
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
    /// Extensions that the file says it uses.
    pub extensions_used: Vec<String>,
    /// Extensions that the file demands of its reader.
    pub extensions_required: Vec<String>,
}

impl FileMetadata {
    /// The facts of a file that has a generator alone.
    pub fn by(generator: Option<String>) -> Self {
        Self { generator, ..Self::default() }
    }
}
