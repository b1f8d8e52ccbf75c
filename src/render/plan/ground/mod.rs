//! The ground: a soft contact shadow on the plane under the mesh, for `scene.ground`. It is a grid of
//! unlit black triangles, more or less transparent at each vertex, so back-ends draw it like any
//! transparent surface.
//!
//! The camera is not fitted to the shadow; only its depth range has room for it. The shadow has no edges,
//! no outlines and no topology.

mod shadow;

use self::shadow::Shadow;
use super::geometry::Geometry;
use super::shared_slice::SharedSlice;
use super::{CornerValues, PlanError, ShadedMaterial, SurfacePass, flags};
use crate::plan::context::PlanContext;
use crate::scene::{Fill, GroundPlane, Scene};
use crate::spec::Cull;

/// Bytes of a ground's own lists per cell of its grid: two triangles with materials and colours, and a
/// vertex.
const CELL_BYTES: u64 = 2 * (12 + 4 + 4 + 12 + 1) + 12 + 16 + 4;

/// Adds the ground to a geometry, and its material to the surface, where the picture has one. Returns the number of its triangles.
pub fn add<'m>(
    scene: &Scene<'m, '_>,
    geometry: &mut Geometry<'m>,
    surface: &mut Option<SurfacePass<'m>>,
    cx: &mut PlanContext<'_>,
) -> Result<usize, PlanError> {
    let Some(pass) = surface.as_mut().filter(|_| scene.groups.has_ground()) else { return Ok(0) };
    let plane = GroundPlane::new(scene.mesh, scene.spec.camera.up.unwrap_or(scene.mesh.up));
    let is_filled = |material: u32| scene.groups.fill(material as usize) != Fill::None;
    let Some(shadow) = Shadow::of(scene.mesh, is_filled, &plane, cx)? else { return Ok(0) };
    spend(geometry, pass, &shadow, cx)?;
    let is_turned = scene.groups.common_cull() == Cull::Front;
    let grid = Grid::of(&shadow, &plane, geometry.positions.len() as u32, is_turned);
    let count = grid.triangles.len();
    paint(pass, &grid, geometry.triangles.len());
    extend(&mut geometry.positions, grid.positions);
    extend(&mut geometry.triangles, grid.triangles);
    let material = scene.mesh.materials.len() as u32;
    extend(&mut geometry.triangle_materials, vec![material; count]);
    Ok(count)
}

/// Spends the copies of the lists to which the ground is appended, and what it appends.
fn spend(
    geometry: &Geometry<'_>,
    pass: &SurfacePass<'_>,
    shadow: &Shadow,
    cx: &mut PlanContext<'_>,
) -> Result<(), PlanError> {
    let colors = pass.colors.as_ref().map_or(0, |colors| colors.values.len());
    cx.budget.spend("the ground", shadow.alpha.len() as u64, CELL_BYTES)?;
    cx.budget.spend("the ground", geometry.positions.len() as u64, 12)?;
    cx.budget.spend("the ground", geometry.triangles.len() as u64, 12 + 4 + 4 + 12 + 1)?;
    cx.budget.spend("the ground", colors as u64, 16)?;
    Ok(())
}

/// The triangles of a ground.
struct Grid {
    positions: Vec<[f32; 3]>,
    /// Alpha by position.
    alpha: Vec<f32>,
    /// Over the plan's positions.
    triangles: Vec<[u32; 3]>,
    /// Over `alpha`.
    corners: Vec<[u32; 3]>,
}

impl Grid {
    /// The cells where there is shadow. Their upper sides are fronts, or backs if the grid is turned.
    fn of(shadow: &Shadow, plane: &GroundPlane, first_vertex: u32, is_turned: bool) -> Self {
        let mut grid = Self { positions: Vec::new(), alpha: Vec::new(), triangles: Vec::new(), corners: Vec::new() };
        let [columns, rows] = shadow.size;
        let mut vertices = vec![u32::MAX; shadow.alpha.len()];
        for (y, x) in (1..rows).flat_map(|y| (1..columns).map(move |x| (y, x))) {
            let places = [[x - 1, y - 1], [x - 1, y], [x, y], [x, y - 1]];
            if places.iter().all(|&[x, y]| shadow.alpha[y * columns + x] == 0.0) {
                continue;
            }
            let quad = places.map(|place| grid.vertex(shadow, plane, place, &mut vertices));
            for [a, b, c] in [[0, 1, 2], [0, 2, 3]].map(|corners: [usize; 3]| corners.map(|k| quad[k])) {
                let corners = if is_turned { [a, c, b] } else { [a, b, c] };
                grid.triangles.push(corners.map(|v| first_vertex + v));
                grid.corners.push(corners);
            }
        }
        grid
    }

    /// The number of the vertex in the middle of a cell.
    fn vertex(&mut self, shadow: &Shadow, plane: &GroundPlane, [x, y]: [usize; 2], vertices: &mut [u32]) -> u32 {
        let at = y * shadow.size[0] + x;
        if vertices[at] == u32::MAX {
            let [right, up, across] = plane.axes;
            let [u, v] = [shadow.middle(0, x), shadow.middle(1, y)];
            vertices[at] = self.positions.len() as u32;
            self.positions.push((right * u + up * plane.height + across * v).as_vec3().to_array());
            self.alpha.push(shadow.alpha[at]);
        }
        vertices[at]
    }
}

/// Gives the surface the ground's material and colours, after those of `before` triangles.
fn paint(pass: &mut SurfacePass<'_>, grid: &Grid, before: usize) {
    let count = grid.triangles.len();
    let black = ShadedMaterial::unlit([0.0, 0.0, 0.0, 1.0]);
    let material = pass.materials.len() as u32;
    pass.materials.push(ShadedMaterial { flags: flags::FILL | flags::BLEND | flags::VERTEX_COLORS, ..black });
    if pass.triangle_materials.is_empty() {
        pass.triangle_materials = vec![0; before].into();
    }
    extend(&mut pass.triangle_materials, vec![material; count]);
    if !pass.edge_masks.is_empty() {
        pass.edge_masks.to_mut().resize(before + count, 0);
    }
    let mut colors = pass
        .colors
        .take()
        .unwrap_or_else(|| CornerValues { values: Vec::new().into(), triangles: vec![[0; 3]; before].into() });
    let first = colors.values.len() as u32;
    extend(&mut colors.values, grid.alpha.iter().map(|&alpha| [1.0, 1.0, 1.0, alpha]).collect());
    extend(&mut colors.triangles, grid.corners.iter().map(|corners| corners.map(|v| first + v)).collect());
    pass.colors = Some(colors);
}

/// Appends to a list, which is copied.
fn extend<T: Copy>(list: &mut SharedSlice<'_, T>, more: Vec<T>) {
    let mut all = Vec::with_capacity(list.len() + more.len());
    all.extend_from_slice(list);
    all.extend(more);
    *list = all.into();
}
