//! The faces of an OFF file and their colours. A mesh has its colours at vertices, so a vertex of
//! faces of different colours is duplicated. If the file has colours at vertices, those of faces
//! are ignored. A file without faces is drawn as points.

use super::colors::{COLOR_BYTES, Colors, WHITE};
use super::{Counts, Source};
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::corners::Polygons;
use crate::import::raw::RawMesh;
use crate::mesh::LineOrPoint;
use crate::warning::Warning;

/// Most bytes of a face's colour and of a vertex that only faces of one colour share.
const COLORED_BYTES: u64 = COLOR_BYTES + 4 + 16;
const VERTEX_BYTES: u64 = 2 * (24 + 12 + 8 + 16) + 4 + 4;

const UNSEEN: u32 = u32::MAX;

/// The faces read so far.
pub struct Faces {
    vertices: u32,
    count: u64,
    polygons: Polygons,
    short_faces: u64,
    colors: Option<Split>,
}

/// Vertices shared by faces of different colours are duplicated.
struct Split {
    colors: Colors,
    /// The colour index of each vertex.
    color_of: Vec<u32>,
    /// The vertex last made for each vertex of the file.
    last: Vec<u32>,
    unpaid: u64,
}

impl Faces {
    /// No faces yet.
    pub fn new(raw: &RawMesh, counts: Counts) -> Self {
        let vertices = raw.positions.len() as u32;
        Self { vertices, count: counts.faces, polygons: Polygons::default(), short_faces: 0, colors: None }
    }

    /// Reads all of them.
    pub fn read(&mut self, source: &mut impl Source, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let (mut numbers, mut color, mut corners) = (Vec::new(), Vec::new(), Vec::new());
        let has_vertex_colors = !raw.colors.is_empty();
        let mut passed = false;
        for _ in 0..self.count {
            numbers.clear();
            color.clear();
            corners.clear();
            source.face(&mut numbers, &mut color, cx)?;
            self.polygons.pay(numbers.len().max(3), cx)?;
            for &number in &numbers {
                corners.push(self.vertex(number).map_err(|what| source.broken(&what))?);
            }
            match corners[..] {
                [] => self.short_faces += 1,
                [vertex] => raw.lines_and_points.push(LineOrPoint::point(vertex, 0)),
                [a, b] if a != b => raw.lines_and_points.push(LineOrPoint { ends: [a, b], material: 0 }),
                [_, _] => self.short_faces += 1,
                _ => {}
            }
            if corners.len() < 3 {
                continue;
            }
            let is_color = matches!(color.len(), 3 | 4);
            passed |= is_color && has_vertex_colors;
            if is_color && !has_vertex_colors && self.colors.is_none() {
                self.colors = Some(Split::new(self.vertices, raw, cx)?);
            }
            if let Some(split) = &mut self.colors {
                split.pay(corners.len(), raw, cx)?;
                let number = split.colors.len() as u32;
                split.colors.push(&color);
                corners.iter_mut().for_each(|vertex| *vertex = split.vertex(*vertex, number, raw));
            }
            self.polygons.add(raw, &corners, 0);
        }
        if passed {
            raw.report.warnings.push(Warning {
                code: "face_colors_ignored",
                detail: "vertices and faces both have colours, and those of the vertices are drawn".into(),
            });
        }
        Ok(())
    }

    /// Gives vertices the colours of their faces, and a file without faces its points. Returns the
    /// number of degenerate faces.
    pub fn finish(self, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<u64, MeshError> {
        if self.count == 0 {
            cx.budget.spend("lines and points", u64::from(self.vertices), size_of::<LineOrPoint>() as u64)?;
            raw.lines_and_points.extend((0..self.vertices).map(|vertex| LineOrPoint::point(vertex, 0)));
        }
        self.polygons.finish(raw, cx)?;
        if let Some(split) = self.colors {
            cx.budget.spend("the colours of OFF faces", split.unpaid, VERTEX_BYTES)?;
            let colors: Vec<[f32; 4]> = split.colors.linear().collect();
            let of = |number: &u32| colors.get(*number as usize).copied().unwrap_or(WHITE);
            raw.colors = split.color_of.iter().map(of).collect();
        }
        Ok(self.short_faces)
    }

    fn vertex(&self, number: f64) -> Result<u32, String> {
        let index = number as u32;
        if f64::from(index) == number && index < self.vertices {
            return Ok(index);
        }
        Err(format!("the face refers to vertex {number}, and there are {}, the first of them 0", self.vertices))
    }
}

impl Split {
    /// Marks the vertices of earlier faces, which have no colour.
    fn new(vertices: u32, raw: &RawMesh, cx: &mut Context<'_>) -> Result<Self, MeshError> {
        cx.budget.spend("the colours of OFF faces", u64::from(vertices), 4 + 4 + 16)?;
        let count = vertices as usize;
        let mut last = vec![UNSEEN; count];
        raw.triangles.iter().flatten().for_each(|&vertex| last[vertex as usize] = vertex);
        Ok(Self { colors: Colors::default(), color_of: vec![UNSEEN; count], last, unpaid: 0 })
    }

    fn pay(&mut self, corners: usize, raw: &RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
        if corners >= (u32::MAX as usize).saturating_sub(raw.positions.len()) {
            return Err(MeshError::broken("the OFF file has more than 4 billion vertices, its colours' own included"));
        }
        self.unpaid += corners as u64 + 1;
        if self.unpaid > 65_536 {
            cx.budget.spend("the colours of OFF faces", self.unpaid, VERTEX_BYTES + COLORED_BYTES)?;
            self.unpaid = 0;
        }
        Ok(())
    }

    /// The vertex of a corner in a face with this colour.
    fn vertex(&mut self, vertex: u32, color: u32, raw: &mut RawMesh) -> u32 {
        let last = &mut self.last[vertex as usize];
        if *last == UNSEEN {
            *last = vertex;
        } else if !self.colors.are_same(self.color_of[*last as usize], color) {
            *last = raw.positions.len() as u32;
            copy(&mut raw.positions, vertex);
            copy(&mut raw.normals, vertex);
            copy(&mut raw.uvs, vertex);
            self.color_of.push(UNSEEN);
        }
        self.color_of[*last as usize] = color;
        *last
    }
}

/// Appends a copy of a vertex's value, if vertices have the attribute.
fn copy<T: Copy>(all: &mut Vec<T>, vertex: u32) {
    if let Some(&value) = all.get(vertex as usize) {
        all.push(value);
    }
}
