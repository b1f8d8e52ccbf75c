//! Where surfaces end in a view: the edges along which outlines run, and on which side of each nothing is.

use crate::limits::Stopped;
use crate::mesh::Mesh;
use crate::mesh::edges::EdgeList;
use crate::plan::PlanError;
use crate::plan::context::CHECK_EVERY;
use crate::plan::context::PlanContext;
use crate::plan::edges::silhouettes::Silhouettes;
use crate::plan::{Edge, Projection, Thickness};
use crate::scene::material_groups::{Fill, MaterialGroups};
use crate::spec::Cull;

/// An edge beside which an outline is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Rim {
    /// Its ends.
    pub vertices: [u32; 2],
    /// Its faces that are drawn.
    pub faces: [u32; 2],
    /// The side that is free, as the sign of `(end - start) x (point - end)` on screen, where y points down.
    pub free: i8,
    /// Whose outline it is.
    pub material: u32,
}

/// A mesh on screen.
pub struct View<'a> {
    /// What is seen.
    pub mesh: &'a Mesh,
    /// How it is seen.
    pub projection: &'a Projection,
    /// X, Y and W of each position.
    pub places: Vec<[f64; 3]>,
    /// Of each face: -1 front, 1 back, 0 edge on.
    facing: Vec<i8>,
    /// By material: the side that is left out.
    culls: Vec<Cull>,
}

impl<'a> View<'a> {
    /// Looks at a mesh.
    pub fn new(
        mesh: &'a Mesh,
        groups: &MaterialGroups<'_>,
        projection: &'a Projection,
        cx: &mut PlanContext<'_>,
    ) -> Result<Self, PlanError> {
        let PlanContext { budget, deadline } = cx;
        budget.spend("an outline", mesh.positions.len() as u64, size_of::<[f64; 3]>() as u64)?;
        budget.spend("an outline", mesh.triangles.len() as u64, 1)?;
        budget.spend("materials", groups.layers.len() as u64, 1)?;
        let mut places = Vec::with_capacity(mesh.positions.len());
        for positions in mesh.positions.chunks(CHECK_EVERY) {
            deadline.check()?;
            let rows = [&projection.x, &projection.y, &projection.w];
            places.extend(positions.iter().map(|p| rows.map(|row| row_dot(row, *p))));
        }
        let mut sides = Vec::with_capacity(mesh.triangles.len());
        for triangles in mesh.triangles.chunks(CHECK_EVERY) {
            deadline.check()?;
            sides.extend(triangles.iter().map(|triangle| facing(mesh, &places, *triangle)));
        }
        let culls = (0..groups.layers.len()).map(|m| cull(groups, m)).collect();
        Ok(Self { mesh, projection, places, facing: sides, culls })
    }

    /// The rims of the parts that have an outline, by material.
    pub fn rims(
        &self,
        outlines: &[Option<Thickness>],
        (list, silhouettes): (&EdgeList, &Silhouettes<'_>),
        cx: &mut PlanContext<'_>,
    ) -> Result<Vec<Rim>, PlanError> {
        let each = |each: &mut dyn FnMut(Rim)| {
            for (i, edge) in list.edges.iter().enumerate() {
                if i % CHECK_EVERY == 0 {
                    cx.deadline.check()?;
                }
                let edge = Edge::new(&self.mesh.positions, edge.vertices, edge.faces);
                let Some(edge) = silhouettes.edge(i as u32, edge) else { continue };
                let faces = self.drawn(edge.faces);
                let Some(material) = self.material(faces, outlines) else { continue };
                for &free in self.free_sides(edge.vertices, faces) {
                    each(Rim { vertices: edge.vertices, faces, free, material });
                }
            }
            Ok::<(), Stopped>(())
        };
        let mut count = 0;
        each(&mut |_| count += 1)?;
        cx.budget.spend("an outline's edges", count, size_of::<Rim>() as u64)?;
        let mut rims = Vec::with_capacity(count as usize);
        each(&mut |rim| rims.push(rim))?;
        Ok(rims)
    }

    /// Which side a face shows: -1 its front, 1 its back, 0 neither; None of one that is left out because of that side, or of no face.
    pub fn shown(&self, face: u32) -> Option<i8> {
        let facing = *self.facing.get(face as usize)?;
        let material = self.mesh.triangle_materials[face as usize] as usize;
        match self.culls.get(material) {
            Some(Cull::Back) if facing > 0 => None,
            Some(Cull::Front) if facing < 0 => None,
            _ => Some(facing),
        }
    }

    /// Those of two faces that are drawn, the first of them first.
    fn drawn(&self, faces: [u32; 2]) -> [u32; 2] {
        let [a, b] = faces.map(|face| self.shown(face).map_or(Edge::NO_FACE, |_| face));
        if a == Edge::NO_FACE { [b, a] } else { [a, b] }
    }

    /// The material with the lowest index that has an outline, of two faces.
    fn material(&self, faces: [u32; 2], outlines: &[Option<Thickness>]) -> Option<u32> {
        let of = |face: &u32| self.mesh.triangle_materials.get(*face as usize).copied();
        faces.iter().filter_map(of).filter(|&m| outlines.get(m as usize).is_some_and(Option::is_some)).min()
    }

    /// The sides of an edge on which its surface ends: both of an only face that is seen edge on.
    fn free_sides(&self, vertices: [u32; 2], faces: [u32; 2]) -> &'static [i8] {
        let [a, b] = faces.map(|face| self.side_of(vertices, face));
        match (a < 0 || b < 0, a > 0 || b > 0) {
            (true, false) => &[1],
            (false, true) => &[-1],
            (false, false) if faces[1] == Edge::NO_FACE => &[-1, 1],
            _ => &[],
        }
    }

    /// On which side of an edge a face lies.
    fn side_of(&self, [from, to]: [u32; 2], face: u32) -> i8 {
        let Some(&facing) = self.facing.get(face as usize) else { return 0 };
        let corners = self.mesh.triangles[face as usize];
        let runs_along = (0..3).any(|k| corners[k] == from && corners[(k + 1) % 3] == to);
        if runs_along { facing } else { -facing }
    }
}

/// `row . (p, 1)`, in f64.
pub fn row_dot(row: &[f32; 4], p: [f32; 3]) -> f64 {
    let (row, p) = (row.map(f64::from), p.map(f64::from));
    ((row[0] * p[0] + row[1] * p[1]) + row[2] * p[2]) + row[3]
}

/// Which side of a part is left out, if it is filled.
fn cull(groups: &MaterialGroups<'_>, material: usize) -> Cull {
    match groups.fill(material) {
        Fill::None => Cull::None,
        _ => groups.layers[material].surface.map_or(Cull::None, |surface| surface.cull),
    }
}

/// Which side a triangle shows: the sign of the volume that it spans with the eye, which is right for corners behind the eye too.
fn facing(mesh: &Mesh, places: &[[f64; 3]], triangle: [u32; 3]) -> i8 {
    // In an order of its own, so that it is rounded alike whichever corner comes first and whichever way it is wound.
    let mut sorted = triangle;
    let mut is_even = true;
    for (i, j) in [(0, 1), (1, 2), (0, 1)] {
        if mesh.positions[sorted[i] as usize] > mesh.positions[sorted[j] as usize] {
            sorted.swap(i, j);
            is_even = !is_even;
        }
    }
    let [a, b, c] = sorted.map(|v| places[v as usize]);
    let (x, y, w) = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
    let volume = (x * c[0] + y * c[1]) + w * c[2];
    let sign = i8::from(volume > 0.0) - i8::from(volume < 0.0);
    if is_even { sign } else { -sign }
}
