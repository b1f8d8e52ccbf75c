//! The triangles, line segments and points of an OBJ mesh. Polygons of four and more corners are
//! split into triangles by several threads. If that takes more work than a file may (`WORK_MAX`),
//! one thread does it again. Otherwise the order of the threads would decide for which polygons the
//! work suffices.

use super::Names;
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::obj::parse::{Group, Part};
use crate::import::polygon::{ALL_EDGES, Triangulator, WORK_MAX};
use crate::import::raw::RawMesh;
use crate::limits::{Deadline, Stopped};
use crate::mesh::LineOrPoint;
use crate::parallel::{concat, map};
use bytemuck::allocation::try_cast_vec;
use std::sync::atomic::{AtomicU64, Ordering};

/// Faces between two deadline checks.
const FACES_PER_POLL: u32 = 65_536;

/// Fills in triangles, segments and points.
pub fn fill(
    parts: &[Part<'_>],
    corners: Vec<u32>,
    names: &Names,
    raw: &mut RawMesh,
    cx: &Context<'_>,
) -> Result<(), MeshError> {
    if parts.iter().flat_map(|part| &part.groups).all(|group| group.arity == 3) {
        return fill_triangles(parts, corners, names, raw, cx);
    }
    let mut rest = corners.as_slice();
    let corners = parts.iter().map(|part| {
        let of_group = |group: &Group| group.faces as usize * group.arity as usize;
        let (own, after) = rest.split_at(part.groups.iter().map(of_group).sum());
        rest = after;
        own
    });
    let corners: Vec<&[u32]> = corners.collect();
    let splitter = Splitter { parts, corners: &corners, names, positions: &raw.positions, deadline: cx.deadline };
    let side_by_side = if parts.len() > 1 { splitter.side_by_side()? } else { None };
    let (mut pieces, triangulator) = match side_by_side {
        Some(done) => done,
        None => splitter.one_by_one()?,
    };
    for piece in &pieces {
        let counts = raw.report.polygons_by_arity.iter_mut().zip(piece.polygons_by_arity);
        counts.for_each(|(count, more)| *count += more);
    }
    raw.report.warnings.extend(triangulator.warning());
    raw.triangles = concat(pieces.iter_mut().map(|piece| std::mem::take(&mut piece.triangles)).collect());
    raw.edge_masks = concat(pieces.iter_mut().map(|piece| std::mem::take(&mut piece.edge_masks)).collect());
    raw.triangle_materials = concat(pieces.iter_mut().map(|piece| std::mem::take(&mut piece.materials)).collect());
    raw.lines_and_points = pieces.into_iter().flat_map(|piece| piece.lines_and_points).collect();
    Ok(())
}

/// As [`fill`], for triangles and nothing else: their corners are them already.
fn fill_triangles(
    parts: &[Part<'_>],
    corners: Vec<u32>,
    names: &Names,
    raw: &mut RawMesh,
    cx: &Context<'_>,
) -> Result<(), MeshError> {
    raw.triangles = match try_cast_vec(corners) {
        Ok(triangles) => triangles,
        Err((_, corners)) => corners.as_chunks().0.to_vec(),
    };
    let count = raw.triangles.len();
    raw.edge_masks = vec![ALL_EDGES; count];
    // Most files have one material, or none. Memory from the system is zero, so nothing has to be written.
    raw.triangle_materials = vec![0; count];
    let mut at = 0;
    for (number, part) in parts.iter().enumerate() {
        cx.deadline.check()?;
        for group in &part.groups {
            let end = at + group.faces as usize;
            let material = names.material(number, group);
            if material > 0 {
                raw.triangle_materials[at..end].fill(material);
            }
            at = end;
        }
    }
    raw.report.polygons_by_arity[3] += count as u64;
    Ok(())
}

struct Splitter<'a> {
    parts: &'a [Part<'a>],
    /// Those of each part.
    corners: &'a [&'a [u32]],
    names: &'a Names,
    positions: &'a [[f64; 3]],
    deadline: &'a Deadline,
}

impl Splitter<'_> {
    /// Splits the faces of all parts at once. None if that takes more work than a file may: then
    /// which polygons are fanned would depend on threads.
    fn side_by_side(&self) -> Result<Option<(Vec<Piece>, Triangulator)>, Stopped> {
        let work = AtomicU64::new(0);
        let done = map((0..self.parts.len()).collect(), |number| {
            let mut triangulator = Triangulator::default();
            let mut counted = 0;
            let piece = self.split(number, &mut triangulator, |triangulator| {
                let more = triangulator.work() - counted;
                counted += more;
                work.fetch_add(more, Ordering::Relaxed) + more < WORK_MAX
            });
            Ok(piece?.map(|piece| (piece, triangulator)))
        });
        let mut all = Triangulator::default();
        let mut pieces = Vec::with_capacity(done.len());
        for piece in done {
            let Some((piece, triangulator)) = piece? else { return Ok(None) };
            all.add_work_of(&triangulator);
            pieces.push(piece);
        }
        Ok((all.work() < WORK_MAX).then_some((pieces, all)))
    }

    fn one_by_one(&self) -> Result<(Vec<Piece>, Triangulator), Stopped> {
        let mut triangulator = Triangulator::default();
        let mut pieces = Vec::with_capacity(self.parts.len());
        for number in 0..self.parts.len() {
            pieces.extend(self.split(number, &mut triangulator, |_| true)?);
        }
        Ok((pieces, triangulator))
    }

    /// Splits the faces of one part. None once `goes_on` says no, which is asked after every
    /// polygon that takes work.
    fn split(
        &self,
        number: usize,
        triangulator: &mut Triangulator,
        mut goes_on: impl FnMut(&Triangulator) -> bool,
    ) -> Result<Option<Piece>, Stopped> {
        let part = &self.parts[number];
        let mut piece = Piece::default();
        piece.reserve(&part.groups);
        let mut corners = self.corners[number];
        for group in &part.groups {
            let material = self.names.material(number, group);
            let (own, after) = corners.split_at(group.faces as usize * group.arity as usize);
            corners = after;
            piece.count(group);
            match group.arity {
                3 => {
                    self.deadline.check()?;
                    piece.triangles.extend(own.chunks_exact(3).map(|face| [face[0], face[1], face[2]]));
                }
                1 | 2 => {
                    self.deadline.check()?;
                    let ends = own.chunks_exact(group.arity as usize).map(|face| [face[0], face[face.len() - 1]]);
                    piece.lines_and_points.extend(ends.map(|ends| LineOrPoint { ends, material }));
                }
                arity => {
                    for (i, face) in (0..).zip(own.chunks_exact(arity as usize)) {
                        if i % FACES_PER_POLL == 0 {
                            self.deadline.check()?;
                        }
                        triangulator.split(face, self.positions, &mut |triangle, mask| {
                            piece.triangles.push(triangle);
                            piece.edge_masks.push(mask);
                        });
                        if arity > 4 && !goes_on(triangulator) {
                            return Ok(None);
                        }
                    }
                }
            }
            piece.edge_masks.resize(piece.triangles.len(), ALL_EDGES);
            piece.materials.resize(piece.triangles.len(), material);
        }
        Ok(Some(piece))
    }
}

/// Triangles of the faces of one part of the file.
#[derive(Default)]
struct Piece {
    triangles: Vec<[u32; 3]>,
    edge_masks: Vec<u8>,
    materials: Vec<u32>,
    lines_and_points: Vec<LineOrPoint>,
    polygons_by_arity: [u64; 13],
}

impl Piece {
    /// Makes room for all that the faces of some groups can become.
    fn reserve(&mut self, groups: &[Group]) {
        let triangles = groups.iter().map(|group| group.arity.saturating_sub(2) as usize * group.faces as usize).sum();
        self.triangles.reserve_exact(triangles);
        self.edge_masks.reserve_exact(triangles);
        self.materials.reserve_exact(triangles);
        let lines = groups.iter().filter(|group| group.arity < 3).map(|group| group.faces as usize).sum();
        self.lines_and_points.reserve_exact(lines);
    }

    fn count(&mut self, group: &Group) {
        if group.arity > 2 {
            self.polygons_by_arity[group.arity.min(12) as usize] += u64::from(group.faces);
        }
    }
}
