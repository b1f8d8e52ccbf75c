//! The faces of a PLY file: its elements `face` (polygons) and `tristrips` (strips of triangles).

use super::conversion::{WHITE, linearise, upright};
use super::header::Element;
use super::layout::{Layout, Slot};
use super::source::{Cost, Meter, Source, each_record, each_record_from, leading_triangles};
use crate::import::MeshError;
use crate::import::context::Context;
use std::ops::Range;

/// Slots of a face's numbers.
const COLOR: Range<usize> = 0..3;
const ALPHA: usize = 3;
const TEXTURE: usize = 4;
/// Slots of a face's lists.
const CORNERS: usize = 0;
const UVS: usize = 1;

/// The texture of faces that declare none.
pub const NO_TEXTURE: u32 = u32::MAX;

/// The faces so far, of both elements.
#[derive(Debug, Default)]
pub struct Faces {
    /// Vertex indices, face by face, all in range.
    pub corners: Vec<u32>,
    /// Corners of each face.
    pub arities: Arities,
    /// Texture coordinates per corner, up to the last face that has any; or empty.
    pub uvs: Vec<[f32; 2]>,
    /// Linear RGBA per face, up to the last one that has any; or empty.
    pub colors: Vec<[f32; 4]>,
    /// Index of a texture per face, up to the last one that has any; or empty.
    pub textures: Vec<u32>,
    /// Skipped faces with fewer than three corners.
    pub short_faces: u64,
    /// Faces whose list of texture coordinates is not two numbers per corner.
    pub odd_uvs: u64,
}

/// Corners of each face: at least three. Most files have triangles alone, which take no list.
#[derive(Debug, Default)]
pub struct Arities {
    /// Triangles before the first other face.
    triangles: usize,
    /// Corners of the faces from there on.
    others: Vec<u32>,
}

impl Arities {
    /// Adds a face.
    pub fn push(&mut self, corners: u32) {
        if corners == 3 && self.others.is_empty() {
            self.triangles += 1;
        } else {
            self.others.push(corners);
        }
    }

    /// Adds triangles.
    pub fn push_triangles(&mut self, count: usize) {
        if self.others.is_empty() {
            self.triangles += count;
        } else {
            self.others.resize(self.others.len() + count, 3);
        }
    }

    /// Number of faces.
    pub fn len(&self) -> usize {
        self.triangles + self.others.len()
    }

    /// True without a face.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// True if all faces are triangles.
    pub fn are_triangles(&self) -> bool {
        self.others.iter().all(|&corners| corners == 3)
    }

    /// The corners of each face.
    pub fn iter(&self) -> impl Iterator<Item = u32> {
        std::iter::repeat_n(3, self.triangles).chain(self.others.iter().copied())
    }
}

impl Faces {
    /// Reads the element `face`. Indices must be below `vertices`.
    pub fn read<S: Source>(
        &mut self,
        source: &mut S,
        element: &Element,
        vertices: u32,
        meter: &mut Meter,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let layout = Layout::new(element, slot);
        if element.count > 0 && !layout.lists[CORNERS] {
            return Err(MeshError::broken("the faces of the PLY file have no list \"vertex_indices\""));
        }
        let (has_colors, has_texture) = (layout.has(COLOR), layout.kinds[TEXTURE].is_some());
        if has_colors {
            // Strips may have been read before.
            self.colors.resize(self.arities.len(), WHITE);
        }
        if has_texture {
            self.textures.resize(self.arities.len(), 0);
        }
        let first = self.colors.len();
        // Lists double when they grow.
        let cost = Cost { record: 2 * (4 + 16 + 4), item: 2 * (4 + 8) };
        let run = leading_triangles(source, element, &layout, vertices, (cost, meter), &mut self.corners, cx)?;
        self.arities.push_triangles(run as usize);
        each_record_from(run, source, element, &layout, (cost, meter), cx, |row| {
            let corners = &row.lists[CORNERS];
            let before = self.corners.len();
            for &item in corners {
                self.corners.push(vertex(item, vertices)?);
            }
            if corners.len() < 3 {
                self.corners.truncate(before);
                self.short_faces += 1;
                return Ok(0);
            }
            self.arities.push(corners.len() as u32);
            self.keep_uvs(before, corners.len(), &row.lists[UVS]);
            if has_colors {
                let alpha = layout.kinds[ALPHA].map_or(1.0, |_| row.values[ALPHA] as f32);
                let [r, g, b] = [0, 1, 2].map(|k| row.values[COLOR.start + k] as f32);
                self.colors.push([r, g, b, alpha]);
            }
            if has_texture {
                let number = row.values[TEXTURE] as u32;
                let is_one = f64::from(number) == row.values[TEXTURE];
                self.textures.push(if is_one { number } else { NO_TEXTURE });
            }
            Ok(corners.len() as u64 - 2)
        })?;
        linearise(&mut self.colors[first..], &layout.kinds[COLOR.start..=ALPHA]);
        Ok(())
    }

    /// Reads the element `tristrips`: lists in which every corner from the third on makes a
    /// triangle with the two before it, and -1 begins a new strip.
    pub fn read_strips<S: Source>(
        &mut self,
        source: &mut S,
        element: &Element,
        vertices: u32,
        meter: &mut Meter,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let layout = Layout::new(element, slot);
        if element.count > 0 && !layout.lists[CORNERS] {
            return Err(MeshError::broken("the strips of the PLY file have no list \"vertex_indices\""));
        }
        let cost = Cost { record: 0, item: 2 * (3 * 4 + 4) };
        each_record(source, element, &layout, (cost, meter), cx, |row| {
            let before = self.arities.len();
            let (mut a, mut b, mut length) = (0, 0, 0_u64);
            for &item in &row.lists[CORNERS] {
                if item == -1.0 {
                    length = 0;
                    continue;
                }
                let c = vertex(item, vertices)?;
                length += 1;
                // Strips are joined by triangles without area, which are skipped.
                if length > 2 && a != b && b != c && c != a {
                    let corners = if length % 2 == 1 { [a, b, c] } else { [b, a, c] };
                    self.corners.extend(corners);
                    self.arities.push(3);
                }
                (a, b) = (b, c);
            }
            Ok((self.arities.len() - before) as u64)
        })
    }

    /// The texture coordinates of the face whose first corner is `before`.
    fn keep_uvs(&mut self, before: usize, corners: usize, list: &[f64]) {
        if list.len() == 2 * corners {
            self.uvs.resize(before, [0.0; 2]);
            self.uvs.extend(list.chunks_exact(2).map(|uv| upright([uv[0], uv[1]])));
        } else if !list.is_empty() {
            self.odd_uvs += 1;
        }
    }
}

fn slot(name: &str) -> Option<Slot> {
    Some(match name {
        "vertex_indices" | "vertex_index" => Slot::List(CORNERS),
        "texcoord" => Slot::List(UVS),
        "red" => Slot::Value(COLOR.start),
        "green" => Slot::Value(COLOR.start + 1),
        "blue" => Slot::Value(COLOR.start + 2),
        "alpha" => Slot::Value(ALPHA),
        "texnumber" => Slot::Value(TEXTURE),
        _ => return None,
    })
}

/// A vertex index that is one. Lists may be of any type, so it may be negative, a fraction or NaN.
pub fn vertex(item: f64, vertices: u32) -> Result<u32, String> {
    let index = item as u32;
    if f64::from(index) == item && index < vertices {
        return Ok(index);
    }
    Err(format!("refers to vertex {item}, and there are {vertices}, the first of them 0"))
}
