//! KHR_draco_mesh_compression: a primitive's triangles and attributes, decoded by the `draco-core`
//! crate.
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_draco_mesh_compression>

use crate::guard::guarded;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::{Reader, Shape};
use crate::import::gltf::data::attribute::{INDICES, Rule};
use crate::import::gltf::document::schema::{Draco, Primitive, mode};
use crate::import::{MeshError, text};
use draco_core::draco_types::DataType;
use draco_core::geometry_attribute::PointAttribute;
use draco_core::geometry_indices::PointIndex;
use draco_core::{DecodeLimits, DecoderBuffer, MeshDecoder};

/// A decoded primitive.
pub struct Unpacked<'a> {
    what: String,
    json: &'a Draco,
    mesh: draco_core::Mesh,
}

/// Bytes that the decoder needs per face, corner tables included, and per point.
const FACE_BYTES: u64 = 256;
const POINT_BYTES: u64 = 512;
/// Bytes of attributes per point: eight attributes of four floats.
const POINT_VALUE_BYTES: u64 = 128;

impl<'a> Unpacked<'a> {
    /// Decodes the compressed data of primitive `what`. The accessors declare the size, and no more
    /// than that is decoded.
    pub fn decode(
        what: &str,
        primitive: &Primitive,
        json: &'a Draco,
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<Self, MeshError> {
        let what = format!("the compressed data of {what}");
        let (Some(indices), Some(position)) = (primitive.indices, primitive.attributes.get("POSITION")) else {
            return Err(broken(&what, "has no accessor for its indices or its positions, which would tell its size"));
        };
        let corners = reader.shape(indices.0, &INDICES)?.count;
        let faces = super::triangles::count(primitive.mode(), corners);
        let points = reader.count(position.0)?;
        cx.check_triangles(faces)?;
        cx.budget.spend("compressed glTF data", faces, FACE_BYTES)?;
        cx.budget.spend("compressed glTF data", points, POINT_BYTES)?;
        cx.deadline.check()?;
        let view = reader.view(json.buffer_view.0, cx)?;
        let limits = DecodeLimits::default()
            .with_max_faces(faces)
            .with_max_points(points)
            .with_max_decoded_bytes(points.saturating_mul(POINT_VALUE_BYTES));
        let mut buffer = DecoderBuffer::new(view.bytes()).with_limits(limits);
        let mut mesh = draco_core::Mesh::new();
        guarded("Draco", || MeshDecoder::new().decode(&mut buffer, &mut mesh))?
            .map_err(|error| broken(&what, &format!("cannot be decompressed: {}", text::foreign(error))))?;
        cx.deadline.check()?;
        let has = [mesh.num_faces() as u64, mesh.num_points() as u64];
        // A strip repeats corners where it jumps. Those triangles have no area and are missing in
        // the compressed data.
        let is_strip = primitive.mode() == mode::TRIANGLE_STRIP;
        if has[1] != points || if is_strip { has[0] > faces } else { has[0] != faces } {
            let detail =
                format!("has {} triangles and {} vertices, where accessors say {faces} and {points}", has[0], has[1]);
            return Err(broken(&what, &detail));
        }
        Ok(Self { what, json, mesh })
    }

    /// Vertex indices, unchecked like those of an accessor.
    pub fn indices(&self, cx: &mut Context<'_>) -> Result<Vec<u32>, MeshError> {
        cx.budget.spend("glTF indices", self.mesh.num_faces() as u64, 12)?;
        Ok(self.mesh.faces().iter().flatten().map(|point| point.0).collect())
    }

    /// True if an attribute is compressed.
    pub fn has(&self, name: &str) -> bool {
        self.json.attributes.contains_key(name)
    }

    /// The values of an attribute, converted by the type of its accessor.
    pub fn vectors<const N: usize>(
        &self,
        name: &str,
        shape: &Shape,
        rule: &Rule,
        cx: &mut Context<'_>,
    ) -> Result<Vec<[f64; N]>, MeshError> {
        let id = self.json.attributes.get(name).map_or(usize::MAX, |id| id.0);
        let attribute = u32::try_from(id).ok().and_then(|id| self.mesh.attribute_by_unique_id(id));
        let attribute =
            attribute.ok_or_else(|| broken(&self.what, &format!("has no attribute {id}, which should be {name}")))?;
        let components = usize::from(attribute.num_components());
        if components != N || shape.kind.components() != N {
            let detail = format!("has {components} components of {name}, and {} is {:?}", rule.name, shape.kind);
            return Err(broken(&self.what, &detail));
        }
        let points = self.mesh.num_points();
        cx.budget.spend("glTF vertices", points as u64, N as u64 * 8)?;
        (0..points)
            .map(|point| value(attribute, point as u32, shape.normalised))
            .collect::<Option<_>>()
            .ok_or_else(|| broken(&self.what, &format!("has values of {name} that are missing or of an unknown type")))
    }
}

/// A point's value, through the attribute's own indices.
fn value<const N: usize>(attribute: &PointAttribute, point: u32, normalised: bool) -> Option<[f64; N]> {
    let kind = attribute.data_type();
    let width = kind.byte_length();
    let stride = usize::try_from(attribute.byte_stride()).ok()?;
    let start = stride.checked_mul(attribute.mapped_index(PointIndex(point)).0 as usize)?;
    let bytes = attribute.buffer().data().get(start..start.checked_add(width * N)?)?;
    let mut out = [0.0; N];
    for (out, bytes) in out.iter_mut().zip(bytes.chunks_exact(width)) {
        *out = number(kind, bytes, normalised)?;
    }
    Some(out)
}

fn number(kind: DataType, b: &[u8], normalised: bool) -> Option<f64> {
    use crate::import::gltf::data::attribute::Component;
    let component = match kind {
        DataType::Int8 => Component::I8,
        DataType::Uint8 => Component::U8,
        DataType::Int16 => Component::I16,
        DataType::Uint16 => Component::U16,
        DataType::Uint32 => Component::U32,
        DataType::Float32 => Component::F32,
        _ => return None,
    };
    Some(component.decode(b, normalised))
}

fn broken(what: &str, detail: &str) -> MeshError {
    MeshError::broken(format!("{what} of the glTF file {detail}"))
}
