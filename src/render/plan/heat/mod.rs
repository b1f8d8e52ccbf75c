//! Diagnostics as colours: the debug views `aspect`, `edge-length`, `curvature` and `uv-stretch`. The plan
//! computes a colour per face, or per position, and the back-ends draw it as vertex colours without light.

mod color_map;
mod legend;
mod measures;

pub use color_map::{DIVERGING, SEQUENTIAL, color};
pub use legend::Legend;
pub use measures::{curvatures, mean_edge, shape_quality, uv_stretch};

use super::context::PlanContext;
use super::geometry::Geometry;
use super::{CornerValues, PlanError};
use crate::limits::Deadline;
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::spec::{DebugView, Layers};
use crate::warning::Warning;

/// Faces between two looks at the deadline.
const CHECK_EVERY: usize = 1 << 16;

/// Bytes per triangle: a colour, three indices, a number, and room to find the scale.
const TRIANGLE_BYTES: u64 = 16 + 12 + 8 + 8;

/// Bytes per position: a colour, a curvature with its area, and room to find the scale.
const POSITION_BYTES: u64 = 16 + 16 + 8 + 8;

/// Shares of the numbers below the lowest and above the highest colour, so that a few outliers do not take
/// all contrast.
const TAIL: f64 = 0.02;

/// Powers of two between no stretch and the last colour.
const STRETCH_POWERS: f64 = 2.0;

/// True if a debug view is one of the diagnostics.
pub fn is_heat(debug: DebugView) -> bool {
    matches!(debug, DebugView::Aspect | DebugView::EdgeLength | DebugView::Curvature | DebugView::UvStretch)
}

/// The diagnostic of a material, if its surface shows one.
fn shown(layers: &Layers) -> Option<DebugView> {
    layers.surface.map(|surface| surface.debug).filter(|debug| is_heat(*debug))
}

/// Gives a geometry the colours of the diagnostics that its materials show, and tells what they mean. Of a mesh
/// without any, it keeps what it has.
pub fn paint(
    scene: &Scene<'_, '_>,
    geometry: &mut Geometry<'_>,
    cx: &mut PlanContext<'_>,
) -> Result<Vec<Legend>, PlanError> {
    let views: Vec<Option<DebugView>> = scene.groups.by_material.iter().map(|layers| shown(layers)).collect();
    let mut legends = Vec::new();
    if views.iter().all(Option::is_none) {
        return Ok(legends);
    }
    let mesh = scene.mesh;
    cx.budget.spend("the colours of a diagnostic", geometry.triangles.len() as u64, TRIANGLE_BYTES)?;
    cx.budget.spend("the colours of a diagnostic", mesh.positions.len() as u64, POSITION_BYTES)?;
    cx.budget.spend("the colours of a diagnostic", mesh.colors.len() as u64, 16)?;
    let mut painter = Painter::new(mesh, geometry);
    for view in [DebugView::Aspect, DebugView::EdgeLength, DebugView::Curvature, DebugView::UvStretch] {
        if !views.contains(&Some(view)) {
            continue;
        }
        let is_shown = |face: usize| views.get(mesh.triangle_materials[face] as usize) == Some(&Some(view));
        match view {
            DebugView::Curvature => {
                let edges = cx.edges(mesh)?;
                let numbers = curvatures(mesh, &edges, cx.deadline)?;
                let most = painter.by_position(&numbers, &mesh.triangles, is_shown) / mesh.to_file.scale;
                legends.push(Legend::new("mean curvature", [-most, most], &DIVERGING));
            }
            DebugView::UvStretch if mesh.uvs.is_empty() => {
                let detail = "the mesh has no texture coordinates, and the stretch of its texture is shown as grey";
                cx.warnings.push(Warning { code: "uvs_missing", detail: detail.to_owned() });
            }
            _ => {
                let (shares, legend) = face_shares(mesh, view, cx.deadline)?;
                painter.by_face(&shares, view, is_shown);
                legends.push(legend);
            }
        }
    }
    geometry.colors = Some(painter.finish());
    Ok(legends)
}

/// By face, the place of its number on the colour map, from 0 to 1; NaN for a face that has none. And what the
/// map's ends mean.
fn face_shares(mesh: &Mesh, view: DebugView, deadline: &Deadline) -> Result<(Vec<f32>, Legend), PlanError> {
    let mut numbers = Vec::with_capacity(mesh.triangles.len());
    let whole = if view == DebugView::UvStretch { measures::uv_scale(mesh) } else { 1.0 };
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        if face % CHECK_EVERY == 0 {
            deadline.check()?;
        }
        let corners = triangle.map(|v| mesh.positions[v as usize].map(f64::from));
        numbers.push(match view {
            DebugView::Aspect => 1.0 - shape_quality(corners),
            DebugView::EdgeLength => libm::log2(mean_edge(corners)),
            _ => {
                let uvs = mesh.attribute_triangles[face].map(|v| mesh.uvs[v as usize].map(f64::from));
                let powers = libm::log2(uv_stretch(corners, uvs) * whole);
                0.5 + 0.5 * (powers / STRETCH_POWERS).clamp(-1.0, 1.0)
            }
        } as f32);
    }
    let legend = match view {
        DebugView::EdgeLength => {
            let [low, high] = range(&numbers);
            // Edges of one length are in the middle.
            let span = if high > low { high - low } else { 1.0 };
            let low = if high > low { low } else { low - 0.5 };
            numbers.iter_mut().for_each(|number| *number = ((*number - low) / span).clamp(0.0, 1.0));
            let ends = [low, low + span].map(|power| libm::exp2(f64::from(power)) * mesh.to_file.scale);
            Legend::new("edge length", ends, &SEQUENTIAL)
        }
        DebugView::Aspect => Legend::new("1 - quality", [0.0, 1.0], &SEQUENTIAL),
        _ => Legend::new("uv stretch", [-STRETCH_POWERS, STRETCH_POWERS].map(libm::exp2), &DIVERGING),
    };
    Ok((numbers, legend))
}

/// The least and the largest of the numbers without their tails.
fn range(numbers: &[f32]) -> [f32; 2] {
    let mut finite: Vec<f32> = numbers.iter().copied().filter(|number| number.is_finite()).collect();
    if finite.is_empty() {
        return [0.0; 2];
    }
    let tail = (finite.len() as f64 * TAIL) as usize;
    let top = finite.len() - 1 - tail;
    let low = *finite.select_nth_unstable_by(tail, f32::total_cmp).1;
    let high = *finite.select_nth_unstable_by(top, f32::total_cmp).1;
    [low, high]
}

/// The colours of a geometry while they are chosen.
struct Painter {
    values: Vec<[f32; 4]>,
    triangles: Vec<[u32; 3]>,
}

impl Painter {
    /// The colours that the geometry has, or white, for the triangles that show no diagnostic.
    fn new(mesh: &Mesh, geometry: &mut Geometry<'_>) -> Self {
        if let Some(CornerValues { values, triangles }) = geometry.colors.take() {
            return Self { values: values.to_vec(), triangles: triangles.to_vec() };
        }
        let mut values = vec![[1.0; 4]];
        let mut triangles = vec![[0; 3]; geometry.triangles.len()];
        if !mesh.colors.is_empty() {
            values.extend_from_slice(&mesh.colors);
            for (corners, attributes) in triangles.iter_mut().zip(geometry.attribute_triangles.iter()) {
                *corners = attributes.map(|v| v + 1);
            }
        }
        Self { values, triangles }
    }

    /// A colour per face.
    fn by_face(&mut self, shares: &[f32], view: DebugView, is_shown: impl Fn(usize) -> bool) {
        let map = if view == DebugView::UvStretch { &*DIVERGING } else { &*SEQUENTIAL };
        for (face, share) in shares.iter().enumerate().filter(|(face, _)| is_shown(*face)) {
            self.triangles[face] = [self.values.len() as u32; 3];
            self.values.push(color(map, *share));
        }
    }

    /// A colour per position: the diverging map, zero in its middle. Returns the number of its last colour.
    fn by_position(&mut self, numbers: &[f32], faces: &[[u32; 3]], is_shown: impl Fn(usize) -> bool) -> f64 {
        let sizes: Vec<f32> = numbers.iter().map(|number| number.abs()).collect();
        let [_, most] = range(&sizes);
        let most = if most > 0.0 { most } else { 1.0 };
        let first = self.values.len() as u32;
        let share = |number: &f32| 0.5 + 0.5 * (number / most).clamp(-1.0, 1.0);
        self.values.extend(numbers.iter().map(|number| color(&DIVERGING, share(number))));
        for (face, corners) in faces.iter().enumerate().filter(|(face, _)| is_shown(*face)) {
            self.triangles[face] = corners.map(|v| v + first);
        }
        f64::from(most)
    }

    fn finish<'a>(self) -> CornerValues<'a, [f32; 4]> {
        CornerValues { values: self.values.into(), triangles: self.triangles.into() }
    }
}
