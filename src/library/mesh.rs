//! The [`Mesh`], and its reader: it reads one file, or several that belong together, such as a mesh
//! and its textures, from memory.

use std::sync::Arc;

use bytes::Bytes;

use crate::Error;
use meshsnap_render::import::{self, Bundle, BundleFile, Format, MeshError, MeshFault, Options, Origin};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::pipeline::Model;
use meshsnap_render::warning::Warning;

/// A mesh, imported once and drawn as often as needed: welded, finite, in a unit box.
/// Edges, textures and vertex normals that a picture needs are kept for the next one. Clones share
/// them.
#[derive(Clone, Debug)]
pub struct Mesh {
    pub(crate) model: Arc<Model>,
}

impl Mesh {
    /// Reads the bytes of one file, or of a zip archive. The format is told from the bytes.
    ///
    /// Bytes from strangers are safe to read: nothing is allocated by a count that the file itself
    /// claims, and [`Limits`] bound what a file may become.
    pub fn read(bytes: &[u8]) -> Result<Self, Error> {
        Self::reader().file("", bytes.to_vec()).read()
    }

    /// A reader for several files, another format, a moment of an animation or other limits.
    pub fn reader() -> MeshReader {
        MeshReader::default()
    }

    /// Triangles after triangulation.
    pub fn triangle_count(&self) -> usize {
        self.model.mesh().triangles.len()
    }

    /// Different positions.
    pub fn position_count(&self) -> usize {
        self.model.mesh().positions.len()
    }

    /// Smallest and largest corner of the bounding box, in the file's own units.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let mesh = self.model.mesh();
        let to_file = &mesh.to_file;
        mesh.bounds
            .map(|corner| std::array::from_fn(|axis| to_file.centre[axis] + to_file.scale * f64::from(corner[axis])))
    }

    /// The asset's own names of its materials, in the file's order; an empty name where it gives
    /// none.
    pub fn material_names(&self) -> impl Iterator<Item = &str> {
        self.model.mesh().materials.iter().map(|material| material.name.as_str())
    }

    /// Warnings: faults of the file that were tolerated.
    pub fn warnings(&self) -> &[Warning] {
        &self.model.report().warnings
    }
}

/// Reads a [`Mesh`] from files in memory. No file system and no network is touched: a name inside a
/// file means one of the files given here.
///
/// ```
/// use meshsnap::Mesh;
///
/// let mesh = Mesh::reader()
///     .file("sign.obj", "mtllib sign.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
///     .file("sign.mtl", "newmtl red\nKd 0.8 0 0\n")
///     .read()?;
/// assert_eq!(mesh.material_names().collect::<Vec<_>>(), ["red"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct MeshReader {
    files: Vec<(String, Bytes)>,
    entry: Option<String>,
    options: Options,
    limits: Limits,
    deadline: Deadline,
}

impl MeshReader {
    /// Adds a file under its relative path; a single file may have an empty one.
    #[must_use]
    pub fn file(mut self, path: &str, bytes: impl Into<Bytes>) -> Self {
        self.files.push((path.to_owned(), bytes.into()));
        self
    }

    /// Names the mesh among the files, where more than one of them is a mesh.
    #[must_use]
    pub fn entry(mut self, path: &str) -> Self {
        self.entry = Some(path.to_owned());
        self
    }

    /// Sets the format, instead of telling it from the bytes.
    #[must_use]
    pub fn format(mut self, format: Format) -> Self {
        self.options.format = Some(format);
        self
    }

    /// Sets the moment of the file's first animation, seconds. Without it the mesh is in its rest
    /// pose.
    #[must_use]
    pub fn time_s(mut self, time_s: f64) -> Self {
        self.options.time_s = Some(time_s);
        self
    }

    /// Sets what the mesh may cost.
    #[must_use]
    pub fn limits(mut self, limits: Limits) -> Self {
        self.limits = limits;
        self
    }

    /// Sets a flag that stops the reading from another thread.
    #[must_use]
    pub fn deadline(mut self, deadline: &Deadline) -> Self {
        self.deadline = deadline.clone();
        self
    }

    /// Reads the mesh.
    pub fn read(self) -> Result<Mesh, Error> {
        let bundle = bundle(self.files)?.with_entry(self.entry).given_by(Origin::Library);
        let budget = Budget::new(&self.limits);
        let model = Model::read(&bundle, self.options, &self.limits, budget, &self.deadline)?;
        Ok(Mesh { model: Arc::new(model) })
    }
}

fn bundle(files: Vec<(String, Bytes)>) -> Result<Bundle, MeshError> {
    let bad = |error: import::BadPath| MeshError::new(MeshFault::BundleBroken, error.to_string());
    if let [(path, bytes)] = files.as_slice()
        && path.is_empty()
    {
        return Ok(Bundle::of_one(bytes.clone()));
    }
    let mut named: Vec<BundleFile> = Vec::with_capacity(files.len());
    for (path, bytes) in files {
        let file = BundleFile::new(&path, bytes).map_err(bad)?;
        file.check_new(&named).map_err(bad)?;
        named.push(file);
    }
    Ok(Bundle::of_files(named))
}
