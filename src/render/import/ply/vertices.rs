//! The vertices of a PLY file (its element `vertex`): positions, normals, colours and texture
//! coordinates. Binary records without lists have the same length, so several threads read them.

use super::conversion::{linearise, upright};
use super::header::{Element, Kind};
use super::layout::{Layout, Slot};
use super::source::{Columns, Cost, Meter, Source, each_record, ends_within};
use crate::import::MeshError;
use crate::import::context::Context;
use crate::limits::Stopped;
use crate::parallel::map_with;
use std::ops::Range;

/// Slots of a vertex's numbers.
const POSITION: Range<usize> = 0..3;
const NORMAL: Range<usize> = 3..6;
const COLOR: Range<usize> = 6..9;
const ALPHA: usize = 9;
const UV: Range<usize> = 10..12;

/// Vertices per block: few enough that their columns stay in the nearest caches.
const BLOCK: usize = 512;
/// Vertices handed to a thread at a time.
const VERTICES_PER_PIECE: usize = 32 * BLOCK;

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
    let mut vertices = Vertices::of_zeros(&layout, element.count, cx)?;
    let mut places = vertices.places();
    if let (Some(stride), true) = (layout.stride, source.is_in_columns()) {
        let bytes = usize::try_from(element.count).ok().and_then(|count| count.checked_mul(stride));
        let Some(records) = bytes.and_then(|bytes| source.block(bytes)) else {
            return Err(ends_within(source, element, stride, 0));
        };
        let pieces = records.chunks(VERTICES_PER_PIECE * stride).map(|records| {
            let rows = records.len() / stride;
            (records, places.next(rows))
        });
        let done = map_with(pieces.collect(), Columns::default, |columns, (records, mut places)| {
            cx.deadline.check()?;
            for records in records.chunks(BLOCK * stride) {
                S::columns(&layout, stride, records, columns);
                places.next(records.len() / stride).fill(&layout, columns);
            }
            Ok(())
        });
        done.into_iter().collect::<Result<(), Stopped>>()?;
    } else {
        let mut columns = Columns::default();
        each_record(source, element, &layout, (Cost::default(), meter), cx, |row| {
            for (column, value) in columns.iter_mut().zip(row.values) {
                column.push(value);
            }
            if columns[0].len() == BLOCK {
                places.next(BLOCK).fill(&layout, &columns);
                columns.iter_mut().for_each(Vec::clear);
            }
            Ok(0)
        })?;
        places.next(columns[0].len()).fill(&layout, &columns);
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
    /// Lists of zeros for all values of the layout. The count was checked against the length of the
    /// file.
    fn of_zeros(layout: &Layout, count: u64, cx: &mut Context<'_>) -> Result<Self, MeshError> {
        let room = |is_there: bool| if is_there { count as usize } else { 0 };
        let rooms = [room(layout.has(NORMAL)), room(layout.has(UV)), room(layout.has(COLOR))];
        cx.budget.spend("the PLY vertices", count, 24)?;
        for (room, bytes) in rooms.into_iter().zip([12, 8, 16]) {
            cx.budget.spend("what PLY vertices have beside positions", room as u64, bytes)?;
        }
        Ok(Self {
            positions: vec![[0.0; 3]; count as usize],
            is_f32: false,
            normals: vec![[0.0; 3]; rooms[0]],
            uvs: vec![[0.0; 2]; rooms[1]],
            colors: vec![[0.0; 4]; rooms[2]],
        })
    }

    fn places(&mut self) -> Places<'_> {
        let Self { positions, normals, uvs, colors, .. } = self;
        Places { positions, normals, uvs, colors }
    }
}

/// Places of vertices that follow each other.
struct Places<'a> {
    positions: &'a mut [[f64; 3]],
    normals: &'a mut [[f32; 3]],
    uvs: &'a mut [[f32; 2]],
    colors: &'a mut [[f32; 4]],
}

impl<'a> Places<'a> {
    /// Takes the first places, of so many vertices.
    fn next(&mut self, rows: usize) -> Self {
        fn cut<'a, T>(list: &mut &'a mut [T], rows: usize) -> &'a mut [T] {
            // Vertices may lack an attribute.
            list.split_off_mut(..rows).unwrap_or_default()
        }
        Self {
            positions: cut(&mut self.positions, rows),
            normals: cut(&mut self.normals, rows),
            uvs: cut(&mut self.uvs, rows),
            colors: cut(&mut self.colors, rows),
        }
    }

    fn fill(self, layout: &Layout, columns: &Columns) {
        let [x, y, z] = triple(columns, POSITION);
        (0..).zip(self.positions).for_each(|(i, place): (usize, _)| *place = [x[i], y[i], z[i]]);
        let [x, y, z] = triple(columns, NORMAL);
        (0..).zip(self.normals).for_each(|(i, place): (usize, _)| *place = [x[i] as f32, y[i] as f32, z[i] as f32]);
        let [u, v] = [&columns[UV.start], &columns[UV.start + 1]];
        (0..).zip(self.uvs).for_each(|(i, place): (usize, _)| *place = upright([u[i], v[i]]));
        let [r, g, b] = triple(columns, COLOR);
        let a = layout.kinds[ALPHA].map(|_| &columns[ALPHA]);
        let alpha = |i: usize| a.map_or(1.0, |a| a[i] as f32);
        (0..)
            .zip(self.colors)
            .for_each(|(i, place): (usize, _)| *place = [r[i] as f32, g[i] as f32, b[i] as f32, alpha(i)]);
    }
}

fn triple(columns: &Columns, slots: Range<usize>) -> [&[f64]; 3] {
    std::array::from_fn(|k| columns[slots.start + k].as_slice())
}
