//! The search for tips, corners that are visible though no sample of their pixel shows their face
//! (stage lines). Twin of `shaders/lines/holes/tips.wgsl`.
//!
//! A tip is a corner in a pixel whose samples all show faces without this corner. It lies in front
//! of these faces, and on screen inside one of them. An example is a spike that stands half a pixel
//! out of a wall. Its lines are visible, but [`holes`](super), which finds what lines leave free of
//! faces, knows only the faces that samples show and misses it. So in the pixels around a tip all
//! edges are drawn one by one.

use super::{Holes, MARKED, STROKED, looked_at};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::backend::cpu::geometry::visibility::Setup;
use crate::plan::{DrawPlan, LinePass};

/// A corner is in front of a face if it is nearer than the face's plane is anywhere up to this far away, across and
/// down, 1/256 px. Corners are rounded to 1, so that what stands on a face may seem to be in front by as much.
pub const TIP_SLACK: f32 = 2.0;

/// Columns and rows of pixels in which tips are looked for, and how far around them pixels are marked.
pub(in crate::backend::cpu::lines) struct TipRange {
    half: [i32; 2],
    looked_at: [[i32; 2]; 2],
    reach: i32,
}

impl TipRange {
    /// Those of a band.
    pub fn new(plan: &DrawPlan<'_>, pass: &LinePass, band: &SampleBand) -> Self {
        let reach = pass.hidden_reach_px() as i32;
        let half = [plan.width_px, plan.height_px].map(|size| size as i32 * 128);
        Self { half, looked_at: looked_at(band, reach), reach }
    }

    /// Marks the pixels around a face's tips: they get strokes.
    pub fn mark(&self, context: &RasterContext<'_>, band: &SampleBand, id: u32, holes: &mut Holes) {
        for vertex in context.triangle(id) {
            self.mark_vertex(context, band, (id, vertex), holes);
        }
    }

    /// The same, without the corners that were looked at last. The test depends on the corner alone, so one face of it is
    /// enough.
    #[inline(always)]
    pub fn mark_new(
        &self,
        context: &RasterContext<'_>,
        band: &SampleBand,
        (id, recent): (u32, &mut RecentVertices),
        holes: &mut Holes,
    ) {
        for vertex in context.triangle(id) {
            if recent.is_new(vertex) {
                self.mark_vertex(context, band, (id, vertex), holes);
            }
        }
    }

    /// Marks the pixels around a corner of a face if it is a tip.
    #[inline(always)]
    fn mark_vertex(&self, context: &RasterContext<'_>, band: &SampleBand, (id, vertex): (u32, u32), holes: &mut Holes) {
        let corner = &context.vertices[vertex as usize];
        let [x, y] = [corner.x + self.half[0], corner.y + self.half[1]].map(|v| v >> 8);
        let [columns, rows] = self.looked_at;
        if x < columns[0] || x >= columns[1] || y < rows[0] || y >= rows[1] {
            return;
        }
        let ids = band.pixel(x, y).0;
        // Most corners are seen, or those of what is seen, or hidden by all that is seen.
        let is_known = ids.contains(&id) || ids.iter().any(|&other| is_no_face_or_has(context, other, vertex));
        if !is_known && is_before_some_around(band, corner, [x, y]) && is_tip(context, ids, corner) {
            holes.mark_around([x, y], self.reach, MARKED | STROKED);
        }
    }
}

/// Vertices that are remembered: a power of two.
const RECENT: usize = 512;

/// Vertices that were looked at last: neighbouring faces share them.
pub(in crate::backend::cpu::lines) struct RecentVertices([u32; RECENT]);

impl RecentVertices {
    /// None.
    pub fn new() -> Self {
        Self([u32::MAX; RECENT])
    }

    /// True if a vertex is not among them. It is from then on.
    #[inline(always)]
    fn is_new(&mut self, vertex: u32) -> bool {
        let place = &mut self.0[vertex as usize % RECENT];
        std::mem::replace(place, vertex) != vertex
    }
}

/// True if an id is none of a face, or that of a face with this corner: no tip is in front of those.
#[inline(always)]
fn is_no_face_or_has(context: &RasterContext<'_>, id: u32, vertex: u32) -> bool {
    let Some([a, b, c]) = context.plan.triangles.get(id as usize) else { return true };
    (*a == vertex) | (*b == vertex) | (*c == vertex)
}

/// True if a corner is in front of all faces that its pixel shows, and on screen inside one of them.
#[inline(never)]
fn is_tip(context: &RasterContext<'_>, ids: &[u32], corner: &ScreenVertex) -> bool {
    let mut is_inside_any = false;
    for &other in ids {
        match relation_to(context, other, corner) {
            Relation::Behind => return false,
            Relation::Beside => {}
            Relation::Inside => is_inside_any = true,
        }
    }
    is_inside_any
}

/// True if a vertex is not behind all samples of its pixel and the eight around it.
fn is_before_some_around(band: &SampleBand, vertex: &ScreenVertex, [x, y]: [i32; 2]) -> bool {
    let around = (-1..=1).flat_map(|down| (-1..=1).map(move |right| [x + right, y + down]));
    around.filter(|&[x, y]| band.has(x, y)).any(|[x, y]| band.pixel(x, y).1.iter().any(|&depth| depth <= vertex.z))
}

/// A vertex's relation to a face.
enum Relation {
    /// Not in front of its plane, or not comparable.
    Behind,
    /// In front of its plane, and on screen not inside the face.
    Beside,
    /// In front of its plane, and on screen inside the face.
    Inside,
}

fn relation_to(context: &RasterContext<'_>, face: u32, vertex: &ScreenVertex) -> Relation {
    if face as usize >= context.plan.triangles.len() {
        return Relation::Behind;
    }
    let corners = context.screen_triangle(face);
    if corners.iter().any(|corner| corner.is_outside() || [corner.x, corner.y] == [vertex.x, vertex.y]) {
        return Relation::Behind;
    }
    let Some(setup) = Setup::new(&corners) else { return Relation::Behind };
    let [z, right, down] = setup.depth;
    let plane = (z + right * (vertex.x - setup.x[0]) as f32) + down * (vertex.y - setup.y[0]) as f32;
    if vertex.z <= plane + TIP_SLACK * (right.abs() + down.abs()) {
        return Relation::Behind;
    }
    let is_inside = (0..3).all(|k| {
        let next = (k + 1) % 3;
        let d = |a: i32, b: i32| i64::from(a) - i64::from(b);
        let along = [d(setup.x[next], setup.x[k]), d(setup.y[next], setup.y[k])];
        along[0] * d(vertex.y, setup.y[k]) - along[1] * d(vertex.x, setup.x[k]) > 0
    });
    if is_inside { Relation::Inside } else { Relation::Beside }
}
