//! Lines and points of a file get an area: strips and hexagons that face the camera of one picture, as wide as they are in pixels. To
//! everything after this they are triangles, but without edges, outlines or a topology. Those of parts without a fill are lines instead, see
//! `plan/lines/primitives.rs`.

use glam::{DVec2, DVec3};

use super::PlanError;
use super::build::border;
use crate::limits::{Budget, Deadline};
use crate::mesh::primitives::triangles;
use crate::mesh::{LineOrPoint, Mesh, Thickened};
use crate::plan::lines::primitives::{is_filled, is_line};
use crate::scene::camera::Camera;
use crate::scene::material_groups::{GROUP_BYTES, MaterialGroups};
use crate::spec::{ProjectionKind, Spec};
use crate::warning::Warning;

/// Width of a line, pixels.
pub(crate) const LINE_PX: f64 = 1.5;

/// Diameter of a point, pixels.
pub(crate) const POINT_PX: f64 = 3.0;

/// A hexagon has the area of a circle whose radius is this share of its own: sqrt(3 sqrt(3) / (2 pi)).
const HEXAGON: f64 = 0.909_388_9;

/// How far towards the viewer they are moved, pixels: a line that lies on a surface is drawn on it.
const LIFT_PX: f64 = 1.0;

/// Bytes of a triangle: corners, normal, edge mask, material, attributes; and up to two positions.
const TRIANGLE_BYTES: u64 = 12 + 12 + 1 + 4 + 12 + 24;

/// Gives the mesh's lines and points, where they belong to a fill, an area in the picture that `spec` asks for; a warning where any are not
/// drawn at all.
pub fn thicken(
    mesh: &mut Mesh,
    spec: &Spec,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<Option<Warning>, PlanError> {
    if mesh.lines_and_points.is_empty() {
        return Ok(None);
    }
    budget.spend("materials", mesh.materials.len() as u64, GROUP_BYTES)?;
    budget.spend("lines and points", mesh.lines_and_points.len() as u64, 1)?;
    let groups = MaterialGroups::new(mesh, spec);
    let undrawn = mesh.lines_and_points.iter().any(|one| !is_filled(&groups, one) && !is_line(&groups, one));
    let warning = undrawn.then(|| {
        let detail =
            "lines and points are drawn with a surface, a wire or an outline, and the look has none".to_owned();
        Warning { code: "lines_not_drawn", detail }
    });
    let own: Vec<bool> = mesh.lines_and_points.iter().map(|one| is_filled(&groups, one)).collect();
    if !own.contains(&true) {
        return Ok(warning);
    }
    let filled = || mesh.lines_and_points.iter().zip(&own).filter(|(_, own)| **own).map(|(one, _)| one);
    budget.spend("lines and points", triangles(filled()), TRIANGLE_BYTES)?;
    let room = [triangles(filled()) as usize, filled().map(|one| if one.is_point() { 6 } else { 4 }).sum()];
    reserve(mesh, room);
    let size_px = [spec.image.width_px, spec.image.height_px];
    let camera = Camera::place(&spec.camera, mesh, size_px, border(mesh, &groups, spec));
    mesh.thickened = Some(Thickened { positions: mesh.positions.len(), triangles: mesh.triangles.len() });
    let mut brush = Brush { camera, px: 2.0 * camera.half_size.y / f64::from(size_px[1]), mesh };
    for (i, is_own) in own.into_iter().enumerate() {
        if i % 65_536 == 0 {
            deadline.check()?;
        }
        if is_own {
            brush.draw(i);
        }
    }
    Ok(warning)
}

/// Room for just what is added: lists that grow by themselves would double.
fn reserve(mesh: &mut Mesh, [added, corners]: [usize; 2]) {
    mesh.positions.reserve_exact(corners);
    mesh.triangles.reserve_exact(added);
    mesh.face_normals.reserve_exact(added);
    mesh.edge_masks.reserve_exact(added);
    mesh.triangle_materials.reserve_exact(added);
    if !mesh.line_point_attributes.is_empty() {
        mesh.attribute_triangles.reserve_exact(added);
    }
}

struct Brush<'m> {
    camera: Camera,
    /// A pixel at W = 1, units of the box.
    px: f64,
    mesh: &'m mut Mesh,
}

/// An end in camera axes.
#[derive(Clone, Copy)]
struct End {
    at: DVec3,
    /// A pixel there, units of the box.
    px: f64,
    attribute: u32,
}

impl Brush<'_> {
    fn draw(&mut self, i: usize) {
        let one = self.mesh.lines_and_points[i];
        let attributes = self.mesh.line_point_attributes.get(i).copied().unwrap_or_default();
        self.face_viewer(attributes);
        let [a, b] = [0, 1].map(|k| self.camera_space(one.ends[k]));
        if one.is_point() {
            if self.w(a) >= self.camera.near {
                self.point(self.end(a, attributes[0]), one);
            }
        } else if let Some([a, b]) = self.in_front(a, b) {
            self.segment([self.end(a, attributes[0]), self.end(b, attributes[1])], one);
        }
    }

    /// Vertices for which the file has no normal.
    fn face_viewer(&mut self, attributes: [u32; 2]) {
        let viewer = self.camera.axes[2].as_vec3().to_array();
        for v in attributes {
            if let Some(normal) = self.mesh.normals.get_mut(v as usize).filter(|normal| **normal == [0.0; 3]) {
                *normal = viewer;
            }
        }
    }

    fn camera_space(&self, v: u32) -> DVec3 {
        let p = DVec3::from(self.mesh.positions[v as usize].map(f64::from));
        DVec3::from(self.camera.axes.map(|axis| axis.dot(p)))
    }

    fn w(&self, at: DVec3) -> f64 {
        if self.camera.kind == ProjectionKind::Perspective { self.camera.distance - at.z } else { 1.0 }
    }

    fn end(&self, at: DVec3, attribute: u32) -> End {
        End { at, px: self.px * self.w(at), attribute }
    }

    /// What of a segment lies in front of the near plane.
    fn in_front(&self, a: DVec3, b: DVec3) -> Option<[DVec3; 2]> {
        let (wa, wb) = (self.w(a) - self.camera.near, self.w(b) - self.camera.near);
        let cut = || a + (b - a) * (wa / (wa - wb));
        match (wa >= 0.0, wb >= 0.0) {
            (true, true) => Some([a, b]),
            (true, false) => Some([a, cut()]),
            (false, true) => Some([cut(), b]),
            (false, false) => None,
        }
    }

    fn point(&mut self, end: End, one: LineOrPoint) {
        // (cos, sin) of the corners' angles.
        const CORNERS: [[f64; 2]; 6] = [[1.0, 0.0], [0.5, H], [-0.5, H], [-1.0, 0.0], [-0.5, -H], [0.5, -H]];
        const H: f64 = 0.866_025_403_784_438_6;
        let radius_px = 0.5 * POINT_PX / HEXAGON;
        let corners = CORNERS.map(|corner| self.corner(end, DVec2::from(corner) * radius_px));
        let normal = self.mesh.normals.get(end.attribute as usize).copied();
        for k in 1..5 {
            self.triangle([0, k, k + 1].map(|k| (corners[k], end.attribute)), normal, one.material);
        }
    }

    fn segment(&mut self, [a, b]: [End; 2], one: LineOrPoint) {
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
            self.triangle(triangle.map(|k| corners[k]), None, one.material);
        }
    }

    /// A new position some pixels beside an end.
    fn corner(&mut self, end: End, offset_px: DVec2) -> u32 {
        let at = end.at + (offset_px * end.px).extend(LIFT_PX * end.px);
        let [right, up, back] = self.camera.axes;
        self.mesh.positions.push((right * at.x + up * at.y + back * at.z).as_vec3().to_array());
        self.mesh.positions.len() as u32 - 1
    }

    fn triangle(&mut self, corners: [(u32, u32); 3], normal: Option<[f32; 3]>, material: u32) {
        let mesh = &mut *self.mesh;
        mesh.triangles.push(corners.map(|(position, _)| position));
        mesh.face_normals.push(normal.unwrap_or(self.camera.axes[2].as_vec3().to_array()));
        mesh.edge_masks.push(0);
        mesh.triangle_materials.push(material);
        if !mesh.line_point_attributes.is_empty() {
            mesh.attribute_triangles.push(corners.map(|(_, attribute)| attribute));
        }
    }
}
