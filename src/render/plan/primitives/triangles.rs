//! Lines and points whose material has a filled surface, as triangles that face the camera: a quad per
//! line, a hexagon per point, of a width in pixels. They have no polygon edges, outlines or topology.

use glam::{DVec2, DVec3};

use super::depth_cue::{self, Grid, Seen};
use super::is_filled;
use crate::limits::LimitExceeded;
use crate::mesh::primitives::triangles;
use crate::mesh::{LineOrPoint, Mesh};
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::geometry::Geometry;
use crate::plan::{CornerValues, PlanError};
use crate::scene::camera::Camera;
use crate::scene::{LINE_PX, Scene};
use crate::spec::Layers;

/// Radius of a circle over the circumradius of the hexagon that has its area: sqrt(3 sqrt(3) / (2
/// pi)).
const HEXAGON: f64 = 0.909_388_9;

/// Distance by which the triangles are moved towards the viewer, pixels, so that a line on a
/// surface is drawn over it.
const LIFT_PX: f64 = 1.0;

/// Bytes per triangle: corners, normal, material, attributes, edge mask, and up to two positions.
const TRIANGLE_BYTES: u64 = 12 + 12 + 4 + 12 + 1 + 24;

/// The mesh's triangles, and after them those of its filled lines and points.
///
/// A mesh without filled lines and points is borrowed whole.
pub fn geometry<'m>(scene: &Scene<'m, '_>, cx: &mut PlanContext<'_>) -> Result<Geometry<'m>, PlanError> {
    let Scene { mesh, groups, camera, .. } = scene;
    let filled = || mesh.lines_and_points.iter().enumerate().filter(|(_, one)| is_filled(groups, one));
    if filled().next().is_none() {
        return Ok(Geometry::of_mesh(mesh));
    }
    let triangle_count = triangles(filled().map(|(_, one)| one));
    cx.budget.spend("lines and points", triangle_count, TRIANGLE_BYTES)?;
    spend_copies(mesh, cx)?;
    let colors = Colors::of(scene, triangle_count, cx)?;
    let corner_count = filled().map(|(_, one)| if one.is_point() { 6 } else { 4 }).sum();
    let px = 2.0 * camera.half_size.y / f64::from(scene.size_px()[1]);
    let mut builder = Builder::new(scene, px, triangle_count as usize, corner_count);
    builder.colors = colors;
    for (n, (i, _)) in filled().enumerate() {
        if n % CHECK_EVERY == 0 {
            cx.deadline.check()?;
        }
        builder.append(i);
    }
    Ok(builder.finish())
}

/// Spends the copies of the mesh's arrays to which the triangles are appended.
fn spend_copies(mesh: &Mesh, cx: &mut PlanContext<'_>) -> Result<(), LimitExceeded> {
    let per_triangle = [12, 12, 4, if mesh.attribute_triangles.is_empty() { 0 } else { 12 }];
    cx.budget.spend("lines and points", mesh.triangles.len() as u64, per_triangle.iter().sum())?;
    cx.budget.spend("lines and points", (mesh.positions.len() + mesh.normals.len()) as u64, 12)
}

/// Colours of triangles, if points have a depth cue.
struct Colors {
    /// White, the mesh's colours, then one for each point that is drawn.
    values: Vec<[f32; 4]>,
    triangles: Vec<[u32; 3]>,
    /// The points' shares of light, in their order, and how many of them are in use.
    shades: Vec<f32>,
    used: usize,
    /// By material, whether it shows the mesh's colours.
    shows_file: Vec<bool>,
    is_cued: Vec<bool>,
}

impl Colors {
    /// The colours of the mesh's triangles. None if no point has the cue.
    fn of(scene: &Scene<'_, '_>, triangle_count: u64, cx: &mut PlanContext<'_>) -> Result<Option<Self>, PlanError> {
        let Scene { mesh, groups, .. } = scene;
        let materials = || mesh.materials.iter().zip(&groups.by_material);
        let is_cued: Vec<bool> = materials().map(|(slot, layers)| depth_cue::is_cued(slot, layers)).collect();
        let is_cued_point = |one: &LineOrPoint| one.is_point() && is_cued.get(one.material as usize) == Some(&true);
        if !mesh.lines_and_points.iter().any(is_cued_point) {
            return Ok(None);
        }
        let points = mesh.lines_and_points.iter().filter(|one| one.is_point() && is_filled(groups, one));
        let count = points.clone().count() as u64;
        let grid = Grid::new(scene.size_px(), point_px(scene));
        cx.budget.spend("the depth cue of points", count, 16 + depth_cue::POINT_BYTES)?;
        cx.budget.spend("the depth cue of points", grid.bytes(), 1)?;
        cx.budget.spend("the colours of points", mesh.triangles.len() as u64 + triangle_count, 12)?;
        cx.budget.spend("the colours of points", mesh.colors.len() as u64 + 1, 16)?;
        let seen: Vec<Seen> = points.map(|point| seen(scene, point)).collect();
        let shades = grid.shades(&seen, cx.deadline)?;
        let shows_file = |layers: &Layers| !mesh.colors.is_empty() && layers.surface.is_some_and(|s| s.color.is_none());
        let shows_file: Vec<bool> = groups.by_material.iter().map(|layers| shows_file(layers)).collect();
        let mut values = Vec::with_capacity(1 + mesh.colors.len() + shades.len());
        values.push([1.0; 4]);
        values.extend_from_slice(&mesh.colors);
        let triangles = Vec::with_capacity(mesh.triangles.len() + triangle_count as usize);
        let mut colors = Self { values, triangles, shades, used: 0, shows_file, is_cued };
        for (i, &material) in mesh.triangle_materials.iter().enumerate() {
            let corners = mesh.attribute_triangles.get(i).copied().unwrap_or_default();
            colors.push(corners, material);
        }
        Ok(Some(colors))
    }

    /// Adds a triangle with the mesh's colours.
    fn push(&mut self, attributes: [u32; 3], material: u32) {
        let shows_file = self.shows_file.get(material as usize) == Some(&true);
        self.triangles.push(attributes.map(|v| if shows_file { v + 1 } else { 0 }));
    }

    /// Adds the color of the next point.
    fn next_point(&mut self, attribute: u32, material: u32) {
        let is_cued = self.is_cued.get(material as usize) == Some(&true);
        let shade = self.shades.get(self.used).copied().filter(|_| is_cued).unwrap_or(1.0);
        self.used += 1;
        let shows_file = self.shows_file.get(material as usize) == Some(&true);
        let of_file = if shows_file { self.values.get(attribute as usize + 1).copied() } else { None };
        let [r, g, b, a] = of_file.unwrap_or([1.0; 4]);
        self.values.push([r * shade, g * shade, b * shade, a]);
    }
}

/// The width of points in pixels.
fn point_px(scene: &Scene<'_, '_>) -> f64 {
    f64::from(scene.spec.points.size_px)
}

/// A point's place on screen.
fn seen(scene: &Scene<'_, '_>, point: &LineOrPoint) -> Seen {
    let Scene { mesh, camera, .. } = scene;
    let [width_px, height_px] = scene.size_px().map(f64::from);
    let at = camera.in_axes(mesh.positions[point.ends[0] as usize]);
    let w = camera.w(at);
    let px = 2.0 * camera.half_size.y / height_px * w;
    let from_center = (at.truncate() - camera.center) / px;
    // What is behind the viewer is nowhere on screen.
    let at_px = if w > 0.0 { DVec2::new(from_center.x, -from_center.y) } else { DVec2::NAN };
    Seen { at_px: at_px + DVec2::new(width_px, height_px) * 0.5, depth: -at.z, px }
}

/// The arrays of a [`Geometry`] while triangles are appended.
struct Builder<'m> {
    mesh: &'m Mesh,
    camera: Camera,
    /// A pixel at W = 1, units of the box.
    px: f64,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    face_normals: Vec<[f32; 3]>,
    triangle_materials: Vec<u32>,
    attribute_triangles: Vec<[u32; 3]>,
    normals: Vec<[f32; 3]>,
    point_px: f64,
    colors: Option<Colors>,
}

/// An end in camera axes.
#[derive(Clone, Copy)]
struct End {
    at: DVec3,
    /// A pixel there, units of the box.
    px: f64,
    attribute: u32,
}

/// A copy of a list with room for exactly `more` items: a list that grows by itself would double.
fn copied<T: Copy>(list: &[T], more: usize) -> Vec<T> {
    let mut copy = Vec::with_capacity(list.len() + more);
    copy.extend_from_slice(list);
    copy
}

impl<'m> Builder<'m> {
    fn new(scene: &Scene<'m, '_>, px: f64, triangle_count: usize, corner_count: usize) -> Self {
        let (mesh, camera) = (scene.mesh, scene.camera);
        let attributes = if mesh.line_point_attributes.is_empty() { 0 } else { triangle_count };
        Self {
            mesh,
            camera,
            px,
            positions: copied(&mesh.positions, corner_count),
            triangles: copied(&mesh.triangles, triangle_count),
            face_normals: copied(&mesh.face_normals, triangle_count),
            triangle_materials: copied(&mesh.triangle_materials, triangle_count),
            attribute_triangles: copied(&mesh.attribute_triangles, attributes),
            normals: mesh.normals.clone(),
            point_px: point_px(scene),
            colors: None,
        }
    }

    fn finish(self) -> Geometry<'m> {
        Geometry {
            positions: self.positions.into(),
            triangles: self.triangles.into(),
            face_normals: self.face_normals.into(),
            triangle_materials: self.triangle_materials.into(),
            attribute_triangles: self.attribute_triangles.into(),
            normals: self.normals.into(),
            colors: self
                .colors
                .map(|colors| CornerValues { values: colors.values.into(), triangles: colors.triangles.into() }),
            mesh_triangle_count: self.mesh.triangles.len(),
        }
    }

    /// Appends the triangles of the line or point with this index.
    fn append(&mut self, i: usize) {
        let primitive = self.mesh.lines_and_points[i];
        let attributes = self.mesh.line_point_attributes.get(i).copied().unwrap_or_default();
        self.face_viewer(attributes);
        let [a, b] = primitive.ends.map(|v| self.camera.in_axes(self.mesh.positions[v as usize]));
        if primitive.is_point() {
            if let Some(colors) = &mut self.colors {
                colors.next_point(attributes[0], primitive.material);
            }
            if self.camera.w(a) >= self.camera.near {
                self.point(self.end(a, attributes[0]), primitive);
            }
        } else if let Some([a, b]) = self.in_front(a, b) {
            self.segment([self.end(a, attributes[0]), self.end(b, attributes[1])], primitive);
        }
    }

    /// Turns the normals that the file leaves at zero towards the viewer.
    fn face_viewer(&mut self, attributes: [u32; 2]) {
        let viewer = self.camera.axes[2].as_vec3().to_array();
        for v in attributes {
            if let Some(normal) = self.normals.get_mut(v as usize).filter(|normal| **normal == [0.0; 3]) {
                *normal = viewer;
            }
        }
    }

    fn end(&self, at: DVec3, attribute: u32) -> End {
        End { at, px: self.px * self.camera.w(at), attribute }
    }

    /// The part of a segment in front of the near plane.
    fn in_front(&self, a: DVec3, b: DVec3) -> Option<[DVec3; 2]> {
        let [wa, wb] = [a, b].map(|at| self.camera.w(at) - self.camera.near);
        let cut = || a + (b - a) * (wa / (wa - wb));
        match (wa >= 0.0, wb >= 0.0) {
            (true, true) => Some([a, b]),
            (true, false) => Some([a, cut()]),
            (false, true) => Some([cut(), b]),
            (false, false) => None,
        }
    }

    fn point(&mut self, end: End, primitive: LineOrPoint) {
        // (cos, sin) of the corners' angles.
        const CORNERS: [[f64; 2]; 6] = [[1.0, 0.0], [0.5, H], [-0.5, H], [-1.0, 0.0], [-0.5, -H], [0.5, -H]];
        const H: f64 = 0.866_025_403_784_438_6;
        let radius_px = 0.5 * self.point_px / HEXAGON;
        let corners = CORNERS.map(|corner| self.corner(end, DVec2::from(corner) * radius_px));
        let normal = self.normals.get(end.attribute as usize).copied();
        for k in 1..5 {
            self.triangle([0, k, k + 1].map(|k| (corners[k], end.attribute)), normal, primitive.material, true);
        }
    }

    fn segment(&mut self, [a, b]: [End; 2], primitive: LineOrPoint) {
        let on_screen = |end: End| (end.at.truncate() - self.camera.center) / end.px;
        // Seen from its end, a segment is a square.
        let along = (on_screen(b) - on_screen(a)).try_normalize().unwrap_or(DVec2::X);
        let (along, across) = (along * (0.5 * LINE_PX), along.perp() * (0.5 * LINE_PX));
        let corners = [
            (self.corner(a, -along - across), a.attribute),
            (self.corner(b, along - across), b.attribute),
            (self.corner(b, along + across), b.attribute),
            (self.corner(a, across - along), a.attribute),
        ];
        for triangle in [[0, 1, 2], [0, 2, 3]] {
            self.triangle(triangle.map(|k| corners[k]), None, primitive.material, false);
        }
    }

    /// A new position some pixels beside an end.
    fn corner(&mut self, end: End, offset_px: DVec2) -> u32 {
        let at = end.at + (offset_px * end.px).extend(LIFT_PX * end.px);
        let [right, up, back] = self.camera.axes;
        self.positions.push((right * at.x + up * at.y + back * at.z).as_vec3().to_array());
        self.positions.len() as u32 - 1
    }

    fn triangle(&mut self, corners: [(u32, u32); 3], normal: Option<[f32; 3]>, material: u32, is_point: bool) {
        if let Some(colors) = &mut self.colors {
            match is_point {
                true => colors.triangles.push([colors.values.len() as u32 - 1; 3]),
                false => colors.push(corners.map(|(_, attribute)| attribute), material),
            }
        }
        self.triangles.push(corners.map(|(position, _)| position));
        self.face_normals.push(normal.unwrap_or(self.camera.axes[2].as_vec3().to_array()));
        self.triangle_materials.push(material);
        if !self.mesh.line_point_attributes.is_empty() {
            self.attribute_triangles.push(corners.map(|(_, attribute)| attribute));
        }
    }
}
