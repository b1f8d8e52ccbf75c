//! The report on a mesh: what its file contains, its topology, its area and its volume, found
//! without drawing it. If they are asked for, it also has figures for 3D printing, the connected
//! parts, and the UV charts.
//!
//! `meshsnap inspect --json` prints it and HTTP answers with it, in one shape. The names of the
//! fields of a `Report` and of its parts are those of the JSON, and so part of the public
//! interface.

mod bounds;
mod charts;
mod parts;
mod print;
#[cfg(test)]
mod tests;
mod text;
mod topology;

pub use self::bounds::{Bounds, significant, without_rounding};
pub use self::charts::ChartsReport;
pub use self::parts::PartsReport;
pub use self::print::PrintReport;
pub use self::topology::TopologyReport;
use crate::geometry::intersections;
use crate::geometry::measure::Measures;
use crate::images::checked_header;
use meshsnap_render::import::{self, Bundle, FileContent, FileMetadata, ImportReport, MeshError};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::edges::EdgeList;
use meshsnap_render::mesh::material::{FileLens, ImageContent, ImageSource};
use meshsnap_render::mesh::topology::Topology;
use meshsnap_render::pipeline::Stage;
use meshsnap_render::spec::words::word_for;
use meshsnap_render::texture::{TextureError, fault_warnings};
use serde::Serialize;

/// Reports what is in a file.
pub fn inspect(
    bundle: &Bundle,
    options: impl Into<import::Options>,
    extras: Extras,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Report, MeshError> {
    let (mesh, report) = import::import(bundle, options, limits, budget, deadline)?;
    ended(Stage::Parse);
    Report::of(&mesh, &report, extras, budget, deadline)
}

/// The contents of a file. Counts are null where the format has no such thing.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    format: &'static str,
    generator: Option<String>,
    file_bytes: u64,
    up: &'static str,
    scenes: Option<u64>,
    nodes: Option<u64>,
    meshes: Option<u64>,
    primitives: Option<u64>,
    /// The totals that other readers of the format give: each mesh of the file once, shown or not.
    file_content: Option<ContentReport>,
    file_vertices: u64,
    positions: u64,
    triangles: u64,
    polygons: u64,
    /// The numbers of polygons with 3, 4, ... corners. The last entry counts all larger ones.
    polygons_by_arity: Vec<Arity>,
    /// Line segments.
    lines: u64,
    points: u64,
    /// Names; empty for a material without one.
    materials: Vec<String>,
    /// The images that drawn materials use.
    textures: Vec<TextureReport>,
    animations: Option<u64>,
    skins: Option<u64>,
    cameras: Option<u64>,
    /// The cameras of the drawn scene, in its order. A request can choose one of them.
    scene_cameras: Vec<CameraReport>,
    extensions_used: Vec<String>,
    extensions_required: Vec<String>,
    has_normals: bool,
    has_uvs: bool,
    has_colors: bool,
    bounds: Bounds,
    topology: TopologyReport,
    /// Square file units; null where an f64 cannot hold the number.
    area: Option<f64>,
    /// Cubic file units, negative where the surface is inside out; null unless the mesh is
    /// watertight.
    volume: Option<f64>,
    dropped_nonfinite_faces: u64,
    dropped_degenerate_faces: u64,
    dropped_collapsed_faces: u64,
    dropped_loose: u64,
    warnings: Vec<WarningReport>,
    /// The figures for printing, if they are asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    print: Option<PrintReport>,
    /// The parts and loops, if they are asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    parts: Option<PartsReport>,
    /// The charts of the texture, if they are asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    uv: Option<ChartsReport>,
}

/// Sections that not every report has.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extras {
    /// The figures for printing.
    pub print: bool,
    /// The parts, and the loops of edges.
    pub parts: bool,
    /// The charts of the texture.
    pub uv: bool,
}

#[derive(Clone, Debug, Serialize)]
struct Arity {
    corners: usize,
    count: u64,
}

/// An image by its header. Fields are null where the upload lacks the image or it cannot be read.
#[derive(Clone, Debug, Serialize)]
struct TextureReport {
    name: String,
    format: Option<&'static str>,
    width_px: Option<u32>,
    height_px: Option<u32>,
    file_bytes: Option<u64>,
}

/// [`FileContent`], under the names that clients read.
#[derive(Clone, Debug, Serialize)]
struct ContentReport {
    draw_calls: u64,
    vertices: u64,
    triangles: u64,
    lines: u64,
    points: u64,
}

impl From<FileContent> for ContentReport {
    fn from(content: FileContent) -> Self {
        let FileContent { draw_calls, vertices, triangles, segments, points } = content;
        Self { draw_calls, vertices, triangles, lines: segments, points }
    }
}

#[derive(Clone, Debug, Serialize)]
struct CameraReport {
    name: String,
    projection: &'static str,
    /// Vertical field of view of a perspective camera, degrees.
    fov_deg: Option<f64>,
    /// Height of the view of an orthographic camera, file units.
    height: Option<f64>,
}

#[derive(Clone, Debug, Serialize)]
struct WarningReport {
    code: &'static str,
    detail: String,
}

impl Report {
    /// On a mesh and its import.
    pub fn of(
        mesh: &Mesh,
        import: &ImportReport,
        extras: Extras,
        budget: &mut Budget,
        deadline: &Deadline,
    ) -> Result<Self, MeshError> {
        deadline.check()?;
        let edges = EdgeList::of(mesh, budget)?;
        deadline.check()?;
        let topology = Topology::of(mesh, &edges, budget, deadline)?;
        drop(edges);
        let t_junctions = intersections::t_junctions(mesh, budget, deadline)?;
        let names = mesh.materials.iter().map(|m| m.name.len() + size_of::<String>());
        let images = mesh.images.iter().map(|image| image.name.len() + size_of::<TextureReport>());
        let cameras = mesh.cameras.iter().map(|camera| camera.name.len() + size_of::<CameraReport>());
        // A name is copied once into the report, and JSON may escape each of its bytes as six.
        budget.spend("the report", names.chain(images).chain(cameras).sum::<usize>() as u64, 1 + 6)?;
        // A sentence for each image that cannot be read.
        budget.spend("the report", mesh.images.len() as u64, 512)?;
        deadline.check()?;
        let print = extras.print.then(|| PrintReport::of(mesh, &mut budget.clone(), deadline)).transpose()?;
        let parts = extras.parts.then(|| PartsReport::of(mesh, budget, deadline)).transpose()?;
        let uv = extras.uv.then(|| ChartsReport::of(mesh, budget, deadline)).transpose()?;
        Ok(Self { print, parts, uv, ..Self::new(mesh, import, (topology, t_junctions)) })
    }

    /// The report as JSON, byte for byte as `inspect --json` prints it and HTTP answers.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// For a person to read: a line for each thing that there is.
    pub fn text(&self) -> String {
        let more = [
            self.print.as_ref().map(PrintReport::text),
            self.parts.as_ref().map(PartsReport::text),
            self.uv.as_ref().map(ChartsReport::text),
        ];
        text::text(self) + &more.into_iter().flatten().collect::<String>()
    }

    fn new(mesh: &Mesh, import: &ImportReport, (topology, t_junctions): (Topology, Option<u64>)) -> Self {
        let FileMetadata {
            generator,
            scenes,
            nodes,
            meshes,
            primitives,
            animations,
            skins,
            cameras,
            extensions_used,
            extensions_required,
        } = import.metadata.clone();
        let arities = import.polygons_by_arity.iter().enumerate().filter(|&(_, &count)| count > 0);
        let (textures, faults): (Vec<_>, Vec<_>) = mesh.images.iter().map(texture).unzip();
        let faults: Vec<_> = faults.into_iter().flatten().collect();
        let warnings = import.warnings.iter().cloned().chain(fault_warnings(&faults));
        let measures = Measures::of(mesh);
        let points = mesh.lines_and_points.iter().filter(|one| one.is_point()).count() as u64;
        Self {
            format: import.format.name(),
            generator,
            file_bytes: import.file_bytes,
            up: word_for(mesh.up),
            scenes,
            nodes,
            meshes,
            primitives,
            file_content: import.content.map(ContentReport::from),
            file_vertices: import.file_vertices,
            positions: mesh.positions.len() as u64,
            triangles: mesh.triangles.len() as u64,
            polygons: import.polygons_by_arity.iter().sum(),
            polygons_by_arity: arities.map(|(corners, &count)| Arity { corners, count }).collect(),
            lines: mesh.lines_and_points.len() as u64 - points,
            points,
            materials: mesh.materials.iter().map(|m| m.name.clone()).collect(),
            textures,
            animations,
            skins,
            cameras,
            scene_cameras: mesh.cameras.iter().map(|c| camera(c.name.clone(), c.lens)).collect(),
            extensions_used,
            extensions_required,
            has_normals: !mesh.normals.is_empty(),
            has_uvs: !mesh.uvs.is_empty(),
            has_colors: !mesh.colors.is_empty(),
            bounds: Bounds::of(mesh),
            area: measures.area,
            volume: measures.volume.filter(|_| topology.is_watertight),
            topology: TopologyReport::new(
                topology,
                t_junctions,
                import.dropped_degenerate_faces + import.dropped_collapsed_faces,
            ),
            dropped_nonfinite_faces: import.dropped_nonfinite_faces,
            dropped_degenerate_faces: import.dropped_degenerate_faces,
            dropped_collapsed_faces: import.dropped_collapsed_faces,
            dropped_loose: import.dropped_lines_and_points,
            warnings: warnings.map(|w| WarningReport { code: w.code, detail: w.detail }).collect(),
            print: None,
            parts: None,
            uv: None,
        }
    }
}

/// An image, and why it cannot be read.
fn texture(image: &ImageSource) -> (TextureReport, Option<TextureError>) {
    let name = image.name.clone();
    let none = TextureReport { name, format: None, width_px: None, height_px: None, file_bytes: None };
    let ImageContent::Encoded(bytes) = &image.content else { return (none, None) };
    let file_bytes = Some(bytes.len() as u64);
    match checked_header(&image.name, bytes) {
        Ok(header) => {
            let [width_px, height_px] = [header.width, header.height].map(Some);
            (TextureReport { format: Some(header.encoding_name()), width_px, height_px, file_bytes, ..none }, None)
        }
        Err(fault) => (TextureReport { file_bytes, ..none }, Some(fault)),
    }
}

fn camera(name: String, lens: FileLens) -> CameraReport {
    match lens {
        FileLens::Perspective { fov_deg } => {
            CameraReport { name, projection: "perspective", fov_deg: Some(fov_deg), height: None }
        }
        FileLens::Orthographic { height } => {
            CameraReport { name, projection: "orthographic", fov_deg: None, height: Some(height) }
        }
    }
}
