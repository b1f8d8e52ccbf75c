//! The differences between two meshes: their surfaces, parts, faces, topology and materials, in numbers and in
//! sentences as a reviewer would write them. Vertex order, face order and the format of the file do not make two
//! meshes different.
//!
//! A `Difference` is written as JSON, so the names of its fields are part of the public interface. Nothing here reads
//! a file.

mod distance;
mod faces;
mod frame;
mod heat;
mod holes;
mod materials;
mod parts;
pub mod pictures;
#[cfg(test)]
mod tests;
mod text;
mod vertices;
mod whole;
mod words;

pub use heat::{PICTURE_KEYS, framing, legend, painted};
pub use materials::{ChangedMaterial, Materials};

use serde::Serialize;

use crate::geometry::intersections;
use crate::geometry::measure::Measures;
use crate::report::{Bounds, TopologyReport, without_rounding};
use distance::{Measured, OneWay};
use faces::Faces;
use holes::{Hole, Numbered};
use meshsnap_render::import::MeshError;
use meshsnap_render::limits::{Budget, Deadline};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::edges::EdgeList;
use meshsnap_render::mesh::topology::Topology;
use meshsnap_render::pipeline::Model;
use parts::Parts;

/// The error of the largest distance at which its search ends, in diagonals of the larger box.
const ERROR: f64 = 1e-4;

/// The differences between two meshes, `a` and `b`.
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// True if surface, topology and materials are the same.
    pub same: bool,
    /// The surfaces.
    pub geometry: Geometry,
    /// Numbers of things.
    pub counts: Sides<Counts>,
    /// Box, area and volume.
    pub measures: Sides<Size>,
    /// Faces by their corners.
    pub faces: FaceCounts,
    /// Parts, which are connected by edges.
    pub parts: PartCounts,
    /// The topology.
    pub topology: TopologyDifference,
    /// Materials, textures and texture coordinates.
    pub materials: Materials,
    /// What a reviewer would say, in sentences.
    pub summary: Vec<String>,
}

impl Difference {
    /// Its JSON.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self).map(|json| json + "\n")
    }
}

/// The same of both meshes.
#[derive(Clone, Debug, Serialize)]
pub struct Sides<T> {
    /// Of the first mesh.
    pub a: T,
    /// Of the second.
    pub b: T,
}

/// How far the surfaces are from each other. Null where an f64 cannot hold a number.
#[derive(Clone, Debug, Serialize)]
pub struct Geometry {
    /// True if no point of either surface is farther from the other than `tolerance`, and no face is turned over.
    pub same: bool,
    /// The largest distance of a point of either surface from the other (the Hausdorff distance). Exact at
    /// vertices.
    pub hausdorff: Option<f64>,
    /// The mean distance, over both surfaces.
    pub mean: Option<f64>,
    /// Always `file`: the units of the files.
    pub unit: &'static str,
    /// What the largest distance may be more, between vertices.
    pub stated_error: Option<f64>,
    /// What the mean may be off.
    pub mean_error: Option<f64>,
    /// The largest distance that counts as the same.
    pub tolerance: f64,
    /// From the first surface to the second.
    pub a_to_b: Option<Way>,
    /// From the second surface to the first.
    pub b_to_a: Option<Way>,
}

/// The distances from one surface to the other.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Way {
    /// The largest.
    pub max: f64,
    /// Its place.
    pub at: [f64; 3],
    /// The mean.
    pub mean: f64,
}

/// Numbers of things.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Counts {
    /// Triangles.
    pub triangles: u64,
    /// Positions, each once.
    pub vertices: u64,
    /// Lines and points.
    pub lines_and_points: u64,
    /// Materials.
    pub materials: u64,
}

/// The extent of a mesh.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Size {
    /// The bounding box.
    pub bounds: Bounds,
    /// Square file units; null where an f64 cannot hold the number.
    pub area: Option<f64>,
    /// Cubic file units; null unless the mesh is watertight.
    pub volume: Option<f64>,
}

/// Faces of both meshes by their corners, in any order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FaceCounts {
    /// Both have them.
    pub common: u64,
    /// Of these, those that look to the other side.
    pub turned: u64,
    /// Only the first has them.
    pub removed: u64,
    /// Only the second has them.
    pub added: u64,
}

/// Connected parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PartCounts {
    /// As they were.
    pub unchanged: u64,
    /// Elsewhere.
    pub moved: u64,
    /// Elsewhere, and turned.
    pub turned: u64,
    /// In both, with other faces.
    pub changed: u64,
    /// Only the second mesh has them.
    pub added: u64,
    /// Only the first mesh has them.
    pub removed: u64,
}

/// The topology of both meshes.
#[derive(Clone, Debug, Serialize)]
pub struct TopologyDifference {
    /// True if both have the same parts, loops, holes and faults.
    pub same: bool,
    /// Of the first mesh.
    pub a: TopologyReport,
    /// Of the second.
    pub b: TopologyReport,
}

/// A difference, with what a picture of it needs.
#[derive(Debug)]
pub struct Compared {
    /// The difference.
    pub difference: Difference,
    /// The distance of each vertex of `a` from the surface of `b`, and of each of `b` from `a`, file units. Empty
    /// where an f64 cannot hold them.
    pub of_vertices: [Vec<f64>; 2],
}

impl Compared {
    /// The place of a side's largest distance, if the distances of its vertices do not tell of it: a hole has none of
    /// its own.
    pub fn hidden_place(&self, side: usize) -> Option<[f64; 3]> {
        let way = self.way(side)?;
        let of_vertices = self.of_vertices[side].iter().copied().filter(|distance| distance.is_finite());
        let told = of_vertices.fold(self.difference.geometry.tolerance, f64::max);
        (way.max > 1.5 * told).then_some(way.at)
    }

    /// True if the older side has what is farther from the newer one than the other way round: a part that was removed.
    pub fn is_seen_before(&self) -> bool {
        let [a, b] = [0, 1].map(|side| self.way(side).map_or(0.0, |way| way.max));
        a > 2.0 * b
    }

    fn way(&self, side: usize) -> Option<Way> {
        let Geometry { a_to_b, b_to_a, .. } = self.difference.geometry;
        [a_to_b, b_to_a][side]
    }
}

/// All that a comparison found, from which the summary in words is written.
struct Comparison<'a> {
    a: &'a Model,
    b: &'a Model,
    diagonal: f64,
    tolerance: f64,
    /// True if vertices and faces have the same numbers in both.
    has_same_order: bool,
    faces: Faces,
    parts: Parts,
    whole: Option<whole::Whole>,
    new_holes: Vec<Hole>,
    closed_holes: Vec<Hole>,
    /// The distances from `a` to `b`, and back.
    ways: [Option<OneWay>; 2],
}

/// Compares two meshes, of which `b` is the newer one. `max_distance` is the largest distance between the surfaces that
/// counts as the same, in file units; None: what encodings round away.
pub fn compare(a: &Model, b: &Model, max_distance: Option<f64>, deadline: &Deadline) -> Result<Compared, MeshError> {
    let budget = &mut a.budget_beside(Some(b))?;
    let meshes = [a.mesh(), b.mesh()];
    let (diagonal, rounding) = (frame::diagonal(meshes), frame::rounding(meshes));
    let tolerance = max_distance.unwrap_or(rounding);
    let in_a = rounding / a.mesh().to_file.scale;
    let numbers = vertices::numbers(a.mesh(), b.mesh(), in_a, budget)?;
    deadline.check()?;
    let has_same_order =
        a.mesh().triangles == b.mesh().triangles && numbers.iter().zip(0..).all(|(number, own)| *number == own);
    let faces = Faces::of(a.mesh(), b.mesh(), &numbers, budget)?;
    deadline.check()?;
    let [edges_a, edges_b] = [EdgeList::of(a.mesh(), budget)?, EdgeList::of(b.mesh(), budget)?];
    deadline.check()?;
    let parts = parts::compare([(a.mesh(), &edges_a), (b.mesh(), &edges_b)], &faces, in_a, budget)?;
    deadline.check()?;
    let whole = whole::find(a.mesh(), b.mesh(), &faces, in_a, budget)?;
    let error = (ERROR * diagonal).max(rounding);
    let decided_by = max_distance.unwrap_or(f64::INFINITY);
    let way = |from, faces, to, budget: &mut Budget| {
        Measured { from, faces, to, error, decided_by }.one_way(budget, deadline)
    };
    let there = way(a.mesh(), faces.removed.as_slice(), b.mesh(), &mut budget.clone())?;
    let back = way(b.mesh(), faces.added.as_slice(), a.mesh(), &mut budget.clone())?;
    deadline.check()?;
    let topologies =
        [Topology::of(a.mesh(), &edges_a, budget, deadline)?, Topology::of(b.mesh(), &edges_b, budget, deadline)?];
    let [junctions_a, junctions_b] = meshes.map(|mesh| intersections::t_junctions(mesh, budget, deadline));
    let t_junctions = [junctions_a?, junctions_b?];
    let of_a = Numbered { mesh: a.mesh(), edges: &edges_a, numbers: None };
    let of_b = Numbered { mesh: b.mesh(), edges: &edges_b, numbers: Some(&numbers) };
    let new_holes = holes::only_in(of_b, of_a, budget)?;
    let closed_holes = holes::only_in(of_a, of_b, budget)?;
    let materials = materials::compare(a.mesh(), b.mesh(), &faces.common, budget)?;
    let ways = [there, back];
    let found =
        Comparison { a, b, diagonal, tolerance, has_same_order, faces, parts, whole, new_holes, closed_holes, ways };
    Ok(found.compared(topologies, t_junctions, materials))
}

impl Comparison<'_> {
    fn compared(mut self, topologies: [Topology; 2], t_junctions: [Option<u64>; 2], materials: Materials) -> Compared {
        let [of_a, of_b] =
            [(self.a, &topologies[0]), (self.b, &topologies[1])].map(|(side, topology)| size(side, topology));
        let geometry = self.geometry();
        let is_same_topology = has_same_faults(&topologies[0], &topologies[1]);
        let has_same_attributes = words::lost_attributes(self.a.mesh(), self.b.mesh()).is_empty();
        let report = |side: &Model, topology: &Topology, t_junctions: Option<u64>| {
            let degenerate = side.report().dropped_degenerate_faces + side.report().dropped_collapsed_faces;
            TopologyReport::new(topology.clone(), t_junctions, degenerate)
        };
        let topology = TopologyDifference {
            same: is_same_topology,
            a: report(self.a, &topologies[0], t_junctions[0]),
            b: report(self.b, &topologies[1], t_junctions[1]),
        };
        let mut difference = Difference {
            same: geometry.same && topology.same && materials.same && has_same_attributes,
            geometry,
            counts: Sides { a: counts(self.a.mesh()), b: counts(self.b.mesh()) },
            measures: Sides { a: of_a, b: of_b },
            faces: self.face_counts(),
            parts: self.part_counts(),
            topology,
            materials,
            summary: Vec::new(),
        };
        difference.summary = words::summary(&self, &difference);
        let scales = [self.b, self.a].map(|side| side.mesh().to_file.scale);
        let [there, back] = self.ways.each_mut().map(|way| way.take().unwrap_or_default().of_vertices);
        let in_file = |distances: Vec<f64>, scale| distances.into_iter().map(|distance| distance * scale).collect();
        let of_vertices = [in_file(there, scales[0]), in_file(back, scales[1])];
        Compared { difference, of_vertices }
    }

    fn geometry(&self) -> Geometry {
        let tidy = |value: f64| without_rounding(value, self.diagonal);
        let scales = [self.b, self.a].map(|side| side.mesh().to_file.scale);
        let held = |value: f64| value.is_finite().then_some(value);
        let way = |index: usize| -> Option<Way> {
            let found = self.ways[index].as_ref()?;
            let (max, mean) = (held(found.max * scales[index])?, held(found.mean * scales[index])?);
            Some(Way { max: tidy(max), at: found.at.map(tidy), mean: tidy(mean) })
        };
        let (a_to_b, b_to_a) = (way(0), way(1));
        let largest = |of: fn(&OneWay) -> f64| {
            let of_way = |index: usize| self.ways[index].as_ref().map(|found| of(found) * scales[index]);
            held(of_way(0)?.max(of_way(1)?))
        };
        // Both errors are to the larger of the two distances.
        let bound = largest(|found| found.max + found.max_error);
        let exact = largest(|found| found.max);
        let stated_error = bound.zip(exact).map(|(bound, max)| tidy((bound - max).max(0.0)));
        let areas = [self.a, self.b].map(|side| Measures::of(side.mesh()).area.unwrap_or(0.0).max(f64::MIN_POSITIVE));
        let share = areas[0] / (areas[0] + areas[1]);
        let mean = a_to_b.zip(b_to_a).map(|(there, back)| tidy(share * there.mean + (1.0 - share) * back.mean));
        let hausdorff = a_to_b.zip(b_to_a).map(|(there, back)| there.max.max(back.max));
        let is_near = exact.is_some_and(|max| max <= self.tolerance);
        Geometry {
            same: is_near && self.faces.turned.is_empty(),
            hausdorff,
            mean,
            unit: "file",
            stated_error,
            mean_error: largest(|found| found.mean_error).map(tidy),
            tolerance: self.tolerance,
            a_to_b,
            b_to_a,
        }
    }

    fn face_counts(&self) -> FaceCounts {
        let Faces { common, turned, removed, added } = &self.faces;
        let [common, turned, removed, added] =
            [common.len(), turned.len(), removed.len(), added.len()].map(|count| count as u64);
        FaceCounts { common, turned, removed, added }
    }

    fn part_counts(&self) -> PartCounts {
        let mut counts = PartCounts { unchanged: self.parts.unchanged, ..PartCounts::default() };
        for part in &self.parts.changed {
            *match part.fate {
                parts::Fate::Moved(_) => &mut counts.moved,
                parts::Fate::Turned => &mut counts.turned,
                parts::Fate::Changed => &mut counts.changed,
                parts::Fate::Added => &mut counts.added,
                parts::Fate::Removed => &mut counts.removed,
            } += 1;
        }
        counts
    }
}

fn counts(mesh: &Mesh) -> Counts {
    Counts {
        triangles: mesh.triangles.len() as u64,
        vertices: mesh.positions.len() as u64,
        lines_and_points: mesh.lines_and_points.len() as u64,
        materials: mesh.materials.len() as u64,
    }
}

fn size(side: &Model, topology: &Topology) -> Size {
    let Measures { area, volume } = Measures::of(side.mesh());
    Size { bounds: Bounds::of(side.mesh()), area, volume: volume.filter(|_| topology.is_watertight) }
}

/// True if both surfaces have the same parts, loops and faults. Counts that depend on how a surface is divided
/// into faces do not matter, only whether there are any.
fn has_same_faults(a: &Topology, b: &Topology) -> bool {
    let of = |t: &Topology| {
        (
            (t.components, t.boundary_loops, t.nonmanifold_vertices, t.duplicate_faces, t.genus),
            (t.open_edges > 0, t.nonmanifold_edges > 0, t.inconsistent_edges > 0),
            (t.is_watertight, t.is_orientable),
        )
    };
    of(a) == of(b)
}
