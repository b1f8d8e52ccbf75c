//! `meshsnap inspect`.

use std::fmt::Write as _;

use clap::Args;
use serde::Serialize;

use super::complaint::Complaint;
use super::progress::Progress;
use super::render::format_in;
use super::settings::LimitSettings;
use super::{bundle, files};
use crate::limits::{Budget, Deadline};
use crate::mesh::edges::EdgeList;
use crate::mesh::topology::Topology;
use crate::mesh::{self, Mesh, counted};
use crate::pipeline::PlanError;
use crate::pipeline::RenderError;

/// Arguments of `inspect`.
#[derive(Args)]
pub struct InspectArgs {
    /// Mesh file (OBJ, STL, PLY, glTF, GLB) and the files it refers to, or a .zip of them; `-` for standard input
    #[arg(required = true, value_name = "MESH")]
    meshes: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Format of the mesh, where its bytes do not tell: obj, gltf, glb, stl or ply
    #[arg(long, value_name = "FORMAT")]
    format_in: Option<String>,
    /// Which of several files is the mesh, where more than one could be
    #[arg(long, value_name = "FILE")]
    entry: Option<String>,
    #[command(flatten)]
    limits: LimitSettings,
}

/// What is in a file.
#[derive(Serialize)]
struct Report {
    format: &'static str,
    file_bytes: u64,
    file_vertices: u64,
    positions: u64,
    triangles: u64,
    polygons: u64,
    /// How many polygons have 3, 4, ... corners; the last place holds all larger ones.
    polygons_by_arity: Vec<Arity>,
    materials: Vec<String>,
    has_normals: bool,
    has_uvs: bool,
    has_colors: bool,
    bounds: Bounds,
    topology: TopologyEntry,
    dropped_nonfinite_faces: u64,
    dropped_degenerate_faces: u64,
    dropped_collapsed_faces: u64,
    warnings: Vec<WarningEntry>,
}

/// How the triangles hang together, after welding.
#[derive(Serialize)]
struct TopologyEntry {
    components: u64,
    edges: u64,
    open_edges: u64,
    nonmanifold_edges: u64,
    inconsistent_edges: u64,
    euler_characteristic: i64,
    is_watertight: bool,
}

#[derive(Serialize)]
struct Arity {
    corners: usize,
    count: u64,
}

#[derive(Serialize)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
    size: [f64; 3],
}

#[derive(Serialize)]
struct WarningEntry {
    code: &'static str,
    detail: String,
}

/// Prints what is in a file.
pub fn run(arguments: &InspectArgs) -> Result<(), Complaint> {
    let limits = arguments.limits.config().limits;
    let format = format_in(arguments.format_in.as_deref())?;
    let progress = Progress::start("reading");
    let mesh_name = bundle::name(&arguments.meshes);
    let bundle = bundle::read(&arguments.meshes, arguments.entry.clone(), &limits)?;
    progress.next("parsing");
    let mut budget = Budget::new(&limits);
    let mesh = mesh::import(&bundle, format, &limits, &mut budget, &Deadline::default())
        .map_err(|error| Complaint::from(error).about(mesh_name))?;
    progress.next("counting edges");
    let edges = EdgeList::of(&mesh, &mut budget)
        .map_err(|limit| Complaint::from(RenderError::from(PlanError::from(limit))).about(mesh_name))?;
    let report = Report::new(&mesh, Topology::of(&mesh, &edges), bundle.bytes_len());
    drop(progress);
    let text = if arguments.json {
        let json = serde_json::to_string_pretty(&report);
        json.map_err(|error| Complaint::ours(error.to_string()))? + "\n"
    } else {
        report.text()
    };
    files::print(text.as_bytes())
}

impl TopologyEntry {
    fn new(topology: Topology) -> Self {
        let Topology {
            components,
            edges,
            open_edges,
            nonmanifold_edges,
            inconsistent_edges,
            euler_characteristic,
            is_watertight,
        } = topology;
        Self {
            components,
            edges,
            open_edges,
            nonmanifold_edges,
            inconsistent_edges,
            euler_characteristic,
            is_watertight,
        }
    }

    fn text(&self) -> String {
        let Self { components, edges, open_edges, nonmanifold_edges, inconsistent_edges, .. } = self;
        let parts = counted(*components, "part", "parts");
        let edges = counted(*edges, "edge", "edges");
        if self.is_watertight {
            return format!("{parts}, watertight, {edges}, Euler characteristic {}", self.euler_characteristic);
        }
        format!(
            "{parts}, {edges}: {open_edges} open, {nonmanifold_edges} non-manifold, \
             {inconsistent_edges} between faces of opposite winding"
        )
    }
}

impl Report {
    fn new(mesh: &Mesh, topology: Topology, file_bytes: u64) -> Self {
        let import = &mesh.report;
        let arities = import.polygons_by_arity.iter().enumerate().filter(|&(_, &count)| count > 0);
        let warnings = import.warnings.iter();
        Self {
            format: import.format.name(),
            file_bytes,
            file_vertices: import.file_vertices,
            positions: mesh.positions.len() as u64,
            triangles: mesh.triangles.len() as u64,
            polygons: import.polygons_by_arity.iter().sum(),
            polygons_by_arity: arities.map(|(corners, &count)| Arity { corners, count }).collect(),
            materials: mesh.materials.iter().map(|m| m.name.clone()).collect(),
            has_normals: !mesh.normals.is_empty(),
            has_uvs: !mesh.uvs.is_empty(),
            has_colors: !mesh.colors.is_empty(),
            bounds: bounds(mesh),
            topology: TopologyEntry::new(topology),
            dropped_nonfinite_faces: import.dropped_nonfinite_faces,
            dropped_degenerate_faces: import.dropped_degenerate_faces,
            dropped_collapsed_faces: import.dropped_collapsed_faces,
            warnings: warnings.map(|w| WarningEntry { code: w.code, detail: w.detail.clone() }).collect(),
        }
    }

    /// Which faces are not drawn, and why; None where all are.
    fn dropped(&self) -> Option<String> {
        let reasons = [
            (self.dropped_nonfinite_faces, "with NaN or infinite corners"),
            (self.dropped_degenerate_faces, "without area"),
            (self.dropped_collapsed_faces, "too small beside the whole mesh"),
        ];
        let said = reasons.into_iter().filter(|(count, _)| *count > 0);
        let said: Vec<String> = said.map(|(count, why)| format!("{} {why}", counted(count, "face", "faces"))).collect();
        (!said.is_empty()).then(|| said.join(", "))
    }

    fn text(&self) -> String {
        let mut out = String::new();
        let mut line = |name: &str, value: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(out, "{name:<12} {value}");
        };
        let arity = |a: &Arity| format!("{} x {}{}", a.count, a.corners, if a.corners == 12 { "+" } else { "" });
        let point = |p: [f64; 3]| format!("{} {} {}", p[0], p[1], p[2]);
        let have = |(has, name)| if has { Some(name) } else { None };
        let attributes = [(self.has_normals, "normals"), (self.has_uvs, "UVs"), (self.has_colors, "colours")];
        let attributes: Vec<&str> = attributes.into_iter().filter_map(have).collect();
        line("format", format!("{} ({} bytes)", self.format, self.file_bytes));
        line("vertices", format!("{} in the file, {} different positions", self.file_vertices, self.positions));
        line("triangles", self.triangles.to_string());
        let arities: Vec<String> = self.polygons_by_arity.iter().map(arity).collect();
        line("polygons", format!("{} ({} corners)", self.polygons, arities.join(", ")));
        line("attributes", if attributes.is_empty() { "none".into() } else { attributes.join(", ") });
        let names: Vec<&str> = self.materials.iter().map(|m| if m.is_empty() { "(unnamed)" } else { m }).collect();
        line("materials", names.join(", "));
        line("bounds", format!("{} to {}", point(self.bounds.min), point(self.bounds.max)));
        line("size", point(self.bounds.size));
        line("topology", self.topology.text());
        if let Some(dropped) = self.dropped() {
            line("dropped", dropped);
        }
        for warning in &self.warnings {
            line("warning", format!("{} ({})", warning.detail, warning.code));
        }
        out
    }
}

/// In the file's own space.
fn bounds(mesh: &Mesh) -> Bounds {
    let to_file = |unit: [f32; 3]| {
        std::array::from_fn(|axis| mesh.to_file.centre[axis] + mesh.to_file.scale * f64::from(unit[axis]))
    };
    let [min, max]: [[f64; 3]; 2] = mesh.bounds.map(to_file);
    let size: [f64; 3] = std::array::from_fn(|axis| max[axis] - min[axis]);
    let largest = size.into_iter().fold(0.0, f64::max);
    let tidy = |point: [f64; 3]| point.map(|v| without_rounding(v, largest));
    Bounds { min: tidy(min), max: tidy(max), size: tidy(size) }
}

/// Without the digits that mean nothing in a mesh this large: positions are kept in 24 bits.
fn without_rounding(value: f64, largest: f64) -> f64 {
    let magnitude = |v: f64| libm::floor(libm::log10(v.abs()));
    let digits = magnitude(value) - magnitude(largest) + 6.0;
    if !digits.is_finite() || digits > 16.0 {
        return value;
    }
    if digits < 0.0 { 0.0 } else { format!("{value:.*e}", digits as usize).parse().unwrap_or(value) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_that_are_rounding_are_not_shown() {
        let cases = [
            (-2.779_299_906_158_447, 6.5, -2.7793),
            (0.1 + 1e-9, 1.0, 0.1),
            (1e9 + 0.25, 1e9, 1e9),
            (5.0, 0.0, 5.0),
            (0.0, 1.0, 0.0),
            (1e-9, 1.0, 0.0),
            (1e-31, 1e-30, 1e-31),
            (f64::MAX, 1.0, f64::MAX),
        ];
        for (value, largest, expected) in cases {
            assert_eq!(without_rounding(value, largest), expected, "{value} {largest}");
        }
    }
}
