//! The debug view `uv-layout`: the faces as they lie in the texture, instead of in space. It is a flat
//! mesh of its own, which is drawn like any other. Faces that are turned over, and faces that are found
//! to overlap others, have colours of their own.

mod overlaps;

pub use overlaps::{GRID_BYTES, overlapping};

use super::PlanError;
use crate::limits::{Budget, Deadline};
use crate::mesh::{LineOrPoint, Mesh, UpAxis};
use crate::spec::color::Rgba;
use crate::spec::{
    CameraSpec, DebugView, Ground, Layers, NamedView, ProjectionKind, Shading, Spec, Surface, Wire, WireEdges,
    WireThickness,
};
use crate::warning::Warning;

/// Colours of faces, and of the frame around the texture, by what they are.
const COLORS: [[u8; 4]; 4] =
    [[0xa9, 0xbf, 0xd6, 0xff], [0xe9, 0xa2, 0x3b, 0xff], [0xd1, 0x3b, 0x46, 0xff], [0x55, 0x5c, 0x66, 0xff]];
const PLAIN: u32 = 0;
const FLIPPED: u32 = 1;
const OVERLAPPING: u32 = 2;
const FRAME: u32 = 3;

/// Colour of the islands' borders.
const BORDER: [u8; 4] = [0x33, 0x3a, 0x44, 0xff];

/// Bytes per triangle: the lists of the mesh, three corners that are sorted, and the list of marks.
const TRIANGLE_BYTES: u64 = 12 + 12 + 12 + 4 + 1 + 3 * (24 + 12) + 36 + 1;

/// A picture of texture coordinates: what is drawn, and how.
#[derive(Debug)]
pub struct UvLayout {
    /// The faces in the plane of the texture.
    pub mesh: Mesh,
    /// The request, looking at that plane.
    pub spec: Spec,
    /// Warnings of parts that the layout lacks.
    pub warnings: Vec<Warning>,
}

impl UvLayout {
    /// The layout of a mesh, if the request shows it.
    pub fn of(mesh: &Mesh, spec: &Spec, budget: &mut Budget, deadline: &Deadline) -> Result<Option<Self>, PlanError> {
        if spec.layers.surface.is_none_or(|surface| surface.debug != DebugView::UvLayout) {
            return Ok(None);
        }
        budget.spend("the layout of texture coordinates", mesh.triangles.len() as u64, TRIANGLE_BYTES)?;
        budget.spend("the layout of texture coordinates", GRID_BYTES, 1)?;
        let mut warnings = Vec::new();
        if mesh.uvs.is_empty() {
            let detail = "the mesh has no texture coordinates, and their layout is an empty frame";
            warnings.push(Warning { code: "uvs_missing", detail: detail.to_owned() });
        }
        let (flat, corners) = flat_mesh(mesh, deadline)?;
        let found = overlapping(&corners, deadline)?;
        if !found.is_complete {
            let detail = "the faces overlap so much in the texture that not all overlaps were looked for";
            warnings.push(Warning { code: "uv_overlaps_incomplete", detail: detail.to_owned() });
        }
        let mut flat = flat;
        for (attributes, is_overlapping) in flat.attribute_triangles.iter_mut().zip(&found.faces) {
            if *is_overlapping {
                *attributes = [OVERLAPPING; 3];
            }
        }
        Ok(Some(Self { mesh: flat, spec: spec_of(spec), warnings }))
    }
}

/// The request for the flat mesh: from the front, without light, with the borders of islands as lines unless
/// it has a wire of its own.
fn spec_of(spec: &Spec) -> Spec {
    let borders = Wire {
        color: Rgba::from_srgb8(BORDER),
        thickness: WireThickness::Given(1.0),
        edges: WireEdges::Boundary,
        ..Wire::default()
    };
    let layers = Layers {
        surface: Some(Surface { shading: Shading::Unlit, ..Surface::default() }),
        wire: Some(spec.layers.wire.unwrap_or(borders)),
        outline: None,
    };
    let camera = CameraSpec {
        view: NamedView::Front,
        projection: ProjectionKind::Orthographic,
        margin: spec.camera.margin,
        ..CameraSpec::default()
    };
    Spec { layers, materials: Vec::new(), topology: None, ground: Ground::None, camera, ..spec.clone() }
}

/// The corners of a face in the texture, u to the right and v upwards.
type Corners = [[f64; 2]; 3];

/// The faces that have an area in the texture, in a box around it and the texture's frame; and their
/// corners in that box.
fn flat_mesh(mesh: &Mesh, deadline: &Deadline) -> Result<(Mesh, Vec<Corners>), PlanError> {
    let uv = |v: u32| {
        let [u, v] = mesh.uvs[v as usize].map(f64::from);
        [u, 1.0 - v]
    };
    let is_used = |attributes: &[u32; 3]| !mesh.uvs.is_empty() && twice_area(attributes.map(uv)) != 0.0;
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for at in mesh.attribute_triangles.iter().filter(|face| is_used(face)).flatten().map(|&v| uv(v)) {
        low = [low[0].min(at[0]), low[1].min(at[1])];
        high = [high[0].max(at[0]), high[1].max(at[1])];
    }
    let frame = [frame_start(low[0], high[0]), frame_start(low[1], high[1])];
    let (low, high): ([f64; 2], [f64; 2]) =
        (std::array::from_fn(|k| low[k].min(frame[k])), std::array::from_fn(|k| high[k].max(frame[k] + 1.0)));
    let side = (high[0] - low[0]).max(high[1] - low[1]);
    let to_box =
        |at: [f64; 2]| -> [f64; 2] { std::array::from_fn(|k| (at[k] - (low[k] + (high[k] - low[k]) * 0.5)) / side) };
    let mut flat = Mesh { materials: vec![Default::default()], up: UpAxis::Y, ..Mesh::default() };
    let mut corners = Vec::new();
    // Corners are the same where the file's vertex and its place in the texture are.
    let mut keys: Vec<([u32; 3], u32)> = Vec::new();
    for (face, attributes) in mesh.attribute_triangles.iter().enumerate() {
        if face.is_multiple_of(1 << 16) {
            deadline.check()?;
        }
        if !is_used(attributes) {
            continue;
        }
        let at = attributes.map(|v| to_box(uv(v)));
        for (k, [u, v]) in at.map(|at| at.map(|v| (v as f32).to_bits())).into_iter().enumerate() {
            keys.push(([mesh.triangles[face][k], u, v], keys.len() as u32));
        }
        corners.push(at);
        flat.edge_masks.push(mesh.edge_masks.get(face).copied().unwrap_or(0b111));
        let kind = if twice_area(at) < 0.0 { FLIPPED } else { PLAIN };
        flat.attribute_triangles.push([kind; 3]);
    }
    flat.face_normals = vec![[0.0, 0.0, 1.0]; corners.len()];
    flat.triangle_materials = vec![0; corners.len()];
    number_corners(&mut flat, keys);
    add_frame(
        &mut flat,
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[u, v]| to_box([u + frame[0], v + frame[1]])),
    );
    flat.colors = COLORS.iter().map(|color| Rgba::from_srgb8(*color).0).collect();
    let half: [f32; 2] = std::array::from_fn(|k| ((high[k] - low[k]) * 0.5 / side) as f32);
    flat.bounds = [[-half[0], -half[1], 0.0], [half[0], half[1], 0.0]];
    Ok((flat, corners))
}

/// The lower left corner of the texture's frame: of the repetition that has all faces, or of the texture itself.
fn frame_start(low: f64, high: f64) -> f64 {
    const SLACK: f64 = 1e-3;
    let start = libm::floor(low + SLACK);
    if start.is_finite() && high <= start + 1.0 + SLACK { start } else { 0.0 }
}

/// Gives equal corners one position.
fn number_corners(flat: &mut Mesh, mut keys: Vec<([u32; 3], u32)>) {
    flat.triangles = vec![[0; 3]; keys.len() / 3];
    keys.sort_unstable();
    let mut last = None;
    for (key @ [_, u, v], corner) in keys {
        if last != Some(key) {
            flat.positions.push([f32::from_bits(u), f32::from_bits(v), 0.0]);
            last = Some(key);
        }
        flat.triangles[corner as usize / 3][corner as usize % 3] = flat.positions.len() as u32 - 1;
    }
}

/// Adds the border of the texture as lines.
fn add_frame(flat: &mut Mesh, corners: [[f64; 2]; 4]) {
    let first = flat.positions.len() as u32;
    flat.positions.extend(corners.map(|[x, y]| [x as f32, y as f32, 0.0]));
    for k in 0..4 {
        flat.lines_and_points.push(LineOrPoint { ends: [first + k, first + (k + 1) % 4], material: 0 });
        flat.line_point_attributes.push([FRAME; 2]);
    }
}

/// Twice the area, negative for a face that is turned over.
fn twice_area([a, b, c]: Corners) -> f64 {
    let twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    if twice.is_finite() { twice } else { 0.0 }
}
