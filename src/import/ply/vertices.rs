//! The element `vertex`.

use super::conversion::{linearise, upright};
use super::header::{Element, Kind};
use super::layout::{Layout, Slot};
use super::source::{Columns, Cost, Meter, Source, each_record, ends_within};
use crate::import::MeshError;
use crate::import::context::Context;
use std::ops::Range;

/// Slots of a vertex's numbers.
const POSITION: Range<usize> = 0..3;
const NORMAL: Range<usize> = 3..6;
const COLOR: Range<usize> = 6..9;
const ALPHA: usize = 9;
const UV: Range<usize> = 10..12;

/// Vertices per block: few enough that their columns stay in the nearest caches.
const BLOCK: usize = 512;
/// Blocks between two deadline checks.
const BLOCKS_PER_POLL: u64 = 128;

/// The vertices read so far, each list as in [`crate::import::raw::RawMesh`].
#[derive(Debug, Default)]
pub struct Vertices {
    /// One per vertex.
    pub positions: Vec<[f64; 3]>,
    /// True if positions are stored as f32.
    pub is_f32: bool,
    /// One per vertex, or empty.
    pub normals: Vec<[f32; 3]>,
    /// One per vertex, or empty.
    pub uvs: Vec<[f32; 2]>,
    /// One per vertex, or empty.
    pub colors: Vec<[f32; 4]>,
}

/// Reads the vertices.
pub fn read<S: Source>(
    source: &mut S,
    element: &Element,
    meter: &mut Meter,
    cx: &mut Context<'_>,
) -> Result<Vertices, MeshError> {
    let layout = Layout::new(element, slot);
    if element.count == 0 {
        return Ok(Vertices::default());
    }
    if !layout.has(POSITION) {
        return Err(MeshError::broken("the vertices of the PLY file lack one of the numbers x, y and z"));
    }
    let mut vertices = Vertices::reserve(&layout, element.count, cx)?;
    let mut columns = Columns::default();
    if let (Some(stride), true) = (layout.stride, source.is_in_columns()) {
        let mut left = element.count;
        for block in 0.. {
            if block % BLOCKS_PER_POLL == 0 {
                cx.deadline.check()?;
            }
            let rows = left.min(BLOCK as u64);
            if rows == 0 {
                break;
            }
            source
                .columns(&layout, rows as usize, &mut columns)
                .ok_or_else(|| ends_within(source, element, stride, element.count - left))?;
            vertices.append(&layout, &columns);
            left -= rows;
        }
    } else {
        each_record(source, element, &layout, (Cost::default(), meter), cx, |row| {
            for (column, value) in columns.iter_mut().zip(row.values) {
                column.push(value);
            }
            if columns[0].len() == BLOCK {
                vertices.append(&layout, &columns);
                columns.iter_mut().for_each(Vec::clear);
            }
            Ok(0)
        })?;
        vertices.append(&layout, &columns);
    }
    vertices.is_f32 = layout.kinds[POSITION].iter().all(|kind| *kind == Some(Kind::F32));
    let kinds = &layout.kinds[COLOR.start..=ALPHA];
    linearise(&mut vertices.colors, kinds);
    Ok(vertices)
}

fn slot(name: &str) -> Option<Slot> {
    let slot = match name {
        "x" => POSITION.start,
        "y" => POSITION.start + 1,
        "z" => POSITION.start + 2,
        "nx" => NORMAL.start,
        "ny" => NORMAL.start + 1,
        "nz" => NORMAL.start + 2,
        "red" | "r" | "diffuse_red" => COLOR.start,
        "green" | "g" | "diffuse_green" => COLOR.start + 1,
        "blue" | "b" | "diffuse_blue" => COLOR.start + 2,
        "alpha" | "a" | "diffuse_alpha" => ALPHA,
        "s" | "u" | "texture_u" | "texture_s" => UV.start,
        "t" | "v" | "texture_v" | "texture_t" => UV.start + 1,
        _ => return None,
    };
    Some(Slot::Value(slot))
}

impl Vertices {
    /// Reserves room for all values of the layout. The count was checked against the length of the
    /// file.
    fn reserve(layout: &Layout, count: u64, cx: &mut Context<'_>) -> Result<Self, MeshError> {
        let room = |is_there: bool| if is_there { count as usize } else { 0 };
        let rooms = [room(layout.has(NORMAL)), room(layout.has(UV)), room(layout.has(COLOR))];
        cx.budget.spend("the PLY vertices", count, 24)?;
        for (room, bytes) in rooms.into_iter().zip([12, 8, 16]) {
            cx.budget.spend("what PLY vertices have beside positions", room as u64, bytes)?;
        }
        Ok(Self {
            positions: Vec::with_capacity(count as usize),
            is_f32: false,
            normals: Vec::with_capacity(rooms[0]),
            uvs: Vec::with_capacity(rooms[1]),
            colors: Vec::with_capacity(rooms[2]),
        })
    }

    fn append(&mut self, layout: &Layout, columns: &Columns) {
        let rows = 0..columns[POSITION.start].len();
        let [x, y, z] = triple(columns, POSITION);
        self.positions.extend(rows.clone().map(|i| [x[i], y[i], z[i]]));
        if layout.has(NORMAL) {
            let [x, y, z] = triple(columns, NORMAL);
            self.normals.extend(rows.clone().map(|i| [x[i] as f32, y[i] as f32, z[i] as f32]));
        }
        if layout.has(UV) {
            let [u, v] = [&columns[UV.start], &columns[UV.start + 1]];
            self.uvs.extend(rows.clone().map(|i| upright([u[i], v[i]])));
        }
        if layout.has(COLOR) {
            let [r, g, b] = triple(columns, COLOR);
            let a = layout.kinds[ALPHA].map(|_| &columns[ALPHA]);
            let alpha = |i: usize| a.map_or(1.0, |a| a[i] as f32);
            self.colors.extend(rows.map(|i| [r[i] as f32, g[i] as f32, b[i] as f32, alpha(i)]));
        }
    }
}

fn triple(columns: &Columns, slots: Range<usize>) -> [&[f64]; 3] {
    std::array::from_fn(|k| columns[slots.start + k].as_slice())
}
