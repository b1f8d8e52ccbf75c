//! The element `edge` of PLY files. A file without faces is drawn as its edges. One that has no
//! edges either is drawn as its vertices, as points.

use super::faces::vertex;
use super::header::Element;
use super::layout::{Layout, Slot};
use super::source::{Cost, Meter, Source, each_record};
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::raw::RawMesh;
use crate::mesh::LineOrPoint;
use std::ops::Range;

/// Slots of an edge's ends.
const ENDS: Range<usize> = 0..2;

/// The edges so far.
#[derive(Debug, Default)]
pub struct Edges {
    /// Vertices, all in range.
    pub ends: Vec<[u32; 2]>,
}

impl Edges {
    /// Reads the element. Indices must be below `vertices`.
    pub fn read<S: Source>(
        &mut self,
        source: &mut S,
        element: &Element,
        vertices: u32,
        meter: &mut Meter,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let layout = Layout::new(element, slot);
        let has_ends = layout.has(ENDS);
        // Lists double when they grow.
        let cost = Cost { record: if has_ends { 2 * 8 } else { 0 }, item: 0 };
        each_record(source, element, &layout, (cost, meter), cx, |row| {
            if has_ends {
                let [a, b] = [row.values[ENDS.start], row.values[ENDS.start + 1]];
                self.ends.push([vertex(a, vertices)?, vertex(b, vertices)?]);
            }
            Ok(0)
        })
    }

    /// Gives a mesh without faces its edges, or, without edges, its vertices as points.
    pub fn apply(&self, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let count = if self.ends.is_empty() { raw.positions.len() } else { self.ends.len() };
        cx.budget.spend("lines and points", count as u64, size_of::<LineOrPoint>() as u64)?;
        raw.lines_and_points.reserve_exact(count);
        if self.ends.is_empty() {
            raw.lines_and_points.extend((0..raw.positions.len() as u32).map(|vertex| LineOrPoint::point(vertex, 0)));
        } else {
            let proper = self.ends.iter().filter(|[a, b]| a != b);
            raw.lines_and_points.extend(proper.map(|&ends| LineOrPoint { ends, material: 0 }));
        }
        Ok(())
    }
}

fn slot(name: &str) -> Option<Slot> {
    match name {
        "vertex1" => Some(Slot::Value(ENDS.start)),
        "vertex2" => Some(Slot::Value(ENDS.start + 1)),
        _ => None,
    }
}
