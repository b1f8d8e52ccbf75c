//! The section of a report on the connected parts of a mesh, each with figures such as its area and,
//! if it is watertight, its volume, and on the mesh's loops. A loop is a set of connected edges that
//! are all open (have one face) or all sharp (their two faces are turned by more than 30 degrees
//! against each other). All are counted; the largest 50 of each kind are listed.

use serde::Serialize;

use super::without_rounding;
use meshsnap_render::import::MeshError;
use meshsnap_render::limits::{Budget, Deadline};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::edges::{Edge, EdgeList};
use meshsnap_render::mesh::union_find::UnionFind;
use meshsnap_render::mesh::vector::{cross, dot, sub};

/// Most parts and loops that are listed: the largest.
const LISTED_MAX: usize = 50;

/// Edges between faces that are turned by more than this are sharp.
const SHARP_DEG: f64 = 30.0;

/// Memory per vertex (sets, marks, numbers) and per face (its part).
const BYTES_PER_VERTEX: u64 = 4 + 4 + 4 + 4;
const BYTES_PER_FACE: u64 = 4 + size_of::<Part>() as u64;

const NONE: u32 = u32::MAX;

/// Parts and loops, in the file's units. All are counted, and the largest are listed.
#[derive(Clone, Debug, Serialize)]
pub struct PartsReport {
    /// Sets of faces that share no vertex with others.
    components: u64,
    /// The largest by area.
    largest: Vec<PartReport>,
    /// Chains of open edges.
    boundary_loops: LoopsReport,
    /// Chains of edges between faces that are turned by more than 30 degrees.
    sharp_loops: LoopsReport,
}

/// A connected part.
#[derive(Clone, Debug, Serialize)]
struct PartReport {
    triangles: u64,
    area: f64,
    /// Null unless it is closed.
    volume: Option<f64>,
    /// Null unless it is closed and touches itself nowhere.
    genus: Option<u64>,
    open_edges: u64,
    /// The middle of its box.
    middle: [f64; 3],
}

/// Chains of edges.
#[derive(Clone, Debug, Serialize)]
struct LoopsReport {
    count: u64,
    edges: u64,
    length: f64,
    /// The longest.
    longest: Vec<LoopReport>,
}

/// Edges that are connected.
#[derive(Clone, Debug, Serialize)]
struct LoopReport {
    edges: u64,
    length: f64,
    /// True if each of its vertices has two of its edges.
    closed: bool,
    /// The middle of its vertices.
    middle: [f64; 3],
}

#[derive(Clone, Debug)]
struct Part {
    triangles: u64,
    vertices: u64,
    edges: u64,
    open_edges: u64,
    /// An edge has more than two faces, or two that run along it in the same direction.
    is_irregular: bool,
    area: f64,
    volume: f64,
    origin: [f64; 3],
    low: [f64; 3],
    high: [f64; 3],
}

impl PartsReport {
    /// On a mesh.
    pub fn of(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Self, MeshError> {
        let mut budget = budget.clone();
        budget.spend("the parts of a mesh", mesh.positions.len() as u64, BYTES_PER_VERTEX)?;
        budget.spend("the parts of a mesh", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
        let edges = EdgeList::of(mesh, &mut budget)?;
        deadline.check()?;
        let mut parts = parts(mesh, &edges);
        deadline.check()?;
        let components = parts.len() as u64;
        let scale = mesh.to_file.scale;
        let whole = scale * scale;
        parts.sort_by(|a, b| b.area.total_cmp(&a.area));
        parts.truncate(LISTED_MAX);
        let of_part = |part: &Part| {
            let is_closed = part.open_edges == 0 && !part.is_irregular;
            let characteristic = part.vertices as i64 - part.edges as i64 + part.triangles as i64;
            let genus = (is_closed && characteristic <= 2 && characteristic % 2 == 0).then(|| (2 - characteristic) / 2);
            PartReport {
                triangles: part.triangles,
                area: without_rounding(part.area * scale * scale, whole),
                volume: is_closed.then(|| without_rounding(part.volume / 6.0 * scale * scale * scale, whole * scale)),
                genus: genus.map(i64::unsigned_abs),
                open_edges: part.open_edges,
                middle: in_file(mesh, std::array::from_fn(|k| (part.low[k] + part.high[k]) / 2.0)),
            }
        };
        let is_sharp = |edge: &meshsnap_render::mesh::edges::MeshEdge| {
            edge.face_count == 2 && turn_deg(mesh, edge.faces) > SHARP_DEG
        };
        Ok(Self {
            components,
            largest: parts.iter().map(of_part).collect(),
            boundary_loops: loops(mesh, edges.iter().filter(|edge| edge.face_count == 1).map(|edge| edge.vertices)),
            sharp_loops: loops(mesh, edges.iter().filter(is_sharp).map(|edge| edge.vertices)),
        })
    }

    /// For a person to read.
    pub fn text(&self) -> String {
        let mut text = format!("parts      {}\n", self.components);
        for part in &self.largest {
            let PartReport { triangles, area, volume, genus, open_edges, middle: [x, y, z] } = part;
            text += &format!("  {triangles} triangles near ({x}, {y}, {z}): area {area}");
            text += &volume.map(|volume| format!(", volume {volume}")).unwrap_or_default();
            text += &genus.map(|genus| format!(", genus {genus}")).unwrap_or_default();
            text += &if *open_edges > 0 { format!(", {open_edges} open edges\n") } else { "\n".to_owned() };
        }
        for (name, loops) in [("open loops", &self.boundary_loops), ("sharp loops", &self.sharp_loops)] {
            let LoopsReport { count, edges, length, longest } = loops;
            text += &format!("{name:<10} {count}, of {edges} edges, {length} long\n");
            for LoopReport { edges, length, closed, middle: [x, y, z] } in longest {
                let open = if *closed { "" } else { ", not a simple loop" };
                text += &format!("  {edges} edges near ({x}, {y}, {z}): {length} long{open}\n");
            }
        }
        text
    }
}

fn in_file(mesh: &Mesh, at: [f64; 3]) -> [f64; 3] {
    let to_file = &mesh.to_file;
    std::array::from_fn(|k| without_rounding(to_file.centre[k] + to_file.scale * at[k], to_file.scale))
}

/// The parts, in the order of their first faces.
fn parts(mesh: &Mesh, edges: &EdgeList) -> Vec<Part> {
    let mut sets = UnionFind::new(mesh.positions.len());
    for [a, b, c] in &mesh.triangles {
        sets.unite(*a, *b);
        sets.unite(*a, *c);
    }
    let mut numbers = vec![NONE; mesh.positions.len()];
    let mut parts: Vec<Part> = Vec::new();
    let mut is_met = vec![false; mesh.positions.len()];
    for corners in &mesh.triangles {
        let points = corners.map(|vertex| mesh.positions[vertex as usize].map(f64::from));
        let number = &mut numbers[sets.find(corners[0]) as usize];
        if *number == NONE {
            *number = parts.len() as u32;
            parts.push(Part::at(points[0]));
        }
        let part = &mut parts[*number as usize];
        let [a, b, c] = points.map(|point| sub(point, part.origin));
        let normal = cross(sub(b, a), sub(c, a));
        part.triangles += 1;
        part.area += dot(normal, normal).sqrt() / 2.0;
        part.volume += dot(a, cross(b, c));
        for (vertex, point) in corners.iter().zip(points) {
            part.vertices += u64::from(!std::mem::replace(&mut is_met[*vertex as usize], true));
            part.low = std::array::from_fn(|k| part.low[k].min(point[k]));
            part.high = std::array::from_fn(|k| part.high[k].max(point[k]));
        }
    }
    for edge in edges.iter() {
        let number = numbers[sets.find(edge.vertices[0]) as usize];
        if let Some(part) = parts.get_mut(number as usize) {
            part.edges += 1;
            part.open_edges += u64::from(edge.face_count == 1);
            part.is_irregular |= edge.face_count > 2 || edge.has_inconsistent_winding;
        }
    }
    parts
}

impl Part {
    fn at(origin: [f64; 3]) -> Self {
        let (low, high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let (triangles, vertices, edges, open_edges) = (0, 0, 0, 0);
        Self { triangles, vertices, edges, open_edges, is_irregular: false, area: 0.0, volume: 0.0, origin, low, high }
    }
}

/// The angle between the normals of two faces.
fn turn_deg(mesh: &Mesh, faces: [u32; 2]) -> f64 {
    if faces[1] == Edge::NO_FACE {
        return 0.0;
    }
    let [a, b] = faces.map(|face| {
        let [a, b, c] = mesh.triangles[face as usize].map(|vertex| mesh.positions[vertex as usize].map(f64::from));
        cross(sub(b, a), sub(c, a))
    });
    let across = cross(a, b);
    libm::atan2(dot(across, across).sqrt(), dot(a, b)).to_degrees()
}

/// Edges by what is connected.
fn loops(mesh: &Mesh, edges: impl Iterator<Item = [u32; 2]>) -> LoopsReport {
    let edges: Vec<[u32; 2]> = edges.collect();
    let mut sets = UnionFind::new(mesh.positions.len());
    let mut degrees = vec![0_u32; mesh.positions.len()];
    for [a, b] in &edges {
        sets.unite(*a, *b);
        degrees[*a as usize] += 1;
        degrees[*b as usize] += 1;
    }
    let mut numbers = vec![NONE; mesh.positions.len()];
    let mut all: Vec<(LoopReport, [f64; 3])> = Vec::new();
    for ends in &edges {
        let number = &mut numbers[sets.find(ends[0]) as usize];
        if *number == NONE {
            *number = all.len() as u32;
            all.push((LoopReport { edges: 0, length: 0.0, closed: true, middle: [0.0; 3] }, [0.0; 3]));
        }
        let (one, sum) = &mut all[*number as usize];
        let points = ends.map(|vertex| mesh.positions[vertex as usize].map(f64::from));
        let way = sub(points[1], points[0]);
        one.edges += 1;
        one.length += dot(way, way).sqrt();
        one.closed &= ends.iter().all(|vertex| degrees[*vertex as usize] == 2);
        *sum = std::array::from_fn(|k| sum[k] + (points[0][k] + points[1][k]) / 2.0);
    }
    let scale = mesh.to_file.scale;
    let count = all.len() as u64;
    let length: f64 = all.iter().map(|(one, _)| one.length).sum();
    all.sort_by(|(a, _), (b, _)| b.length.total_cmp(&a.length));
    all.truncate(LISTED_MAX);
    let listed = all.into_iter().map(|(one, sum)| {
        let middle = in_file(mesh, sum.map(|value| value / one.edges as f64));
        LoopReport { length: without_rounding(one.length * scale, scale), middle, ..one }
    });
    let longest = listed.collect();
    LoopsReport { count, edges: edges.len() as u64, length: without_rounding(length * scale, scale), longest }
}
