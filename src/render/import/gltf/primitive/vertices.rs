//! The vertex attributes and indices of a glTF primitive, read from accessors or from Draco data.

use super::draco;
use super::shape::Influences;
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::import::gltf::data::attribute::{COLOR, JOINTS, Kind, MORPH_NORMAL, MORPH_POSITION, Rule, WEIGHTS};
use crate::import::gltf::document::schema;
use crate::import::gltf::document::schema::mode;
use crate::import::gltf::primitive::{Source, Target};

/// Most sets of joints per vertex: more than any exporter writes.
const INFLUENCE_SETS_MAX: usize = 8;

/// Reads the attributes of one primitive.
pub struct Vertices<'s> {
    what: &'s str,
    json: &'s schema::Primitive,
    unpacked: Option<draco::Unpacked<'s>>,
    /// The number of vertices, known once positions are read.
    pub count: Option<usize>,
}

impl<'s> Vertices<'s> {
    /// Decompresses the primitive if it is Draco-compressed.
    pub fn new(source: &'s Source<'_>, reader: &mut Reader<'_>, cx: &mut Context<'_>) -> Result<Self, MeshError> {
        let (what, json) = (source.what.as_str(), source.json);
        let unpacked = match &json.extensions.draco {
            // A strip is compressed as a list of its triangles.
            Some(draco) if matches!(json.mode(), mode::TRIANGLES | mode::TRIANGLE_STRIP) => {
                Some(draco::Unpacked::decode(what, json, draco, reader, cx)?)
            }
            Some(_) => {
                let detail = "is compressed with Draco, and neither a list nor a strip of triangles";
                return Err(MeshError::broken(format!("{what} of the glTF file {detail}")));
            }
            None => None,
        };
        Ok(Self { what, json, unpacked, count: None })
    }

    /// The values of an attribute, one per position; None without the attribute.
    pub fn attribute<const N: usize>(
        &self,
        name: &str,
        rule: &Rule,
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<Option<Vec<[f64; N]>>, MeshError> {
        let Some(accessor) = self.json.attributes.get(name) else { return Ok(None) };
        let shape = reader.shape(accessor.0, rule)?;
        self.check_count(name, shape.count)?;
        let values = match self.unpacked.as_ref().filter(|unpacked| unpacked.has(name)) {
            Some(unpacked) => unpacked.vectors(name, &shape, rule, cx)?,
            None => reader.vectors(accessor.0, rule, cx)?,
        };
        Ok(Some(values))
    }

    /// COLOR_0 as RGBA; empty without it.
    pub fn colors(&self, reader: &mut Reader<'_>, cx: &mut Context<'_>) -> Result<Vec<[f64; 4]>, MeshError> {
        let Some(accessor) = self.json.attributes.get("COLOR_0") else { return Ok(Vec::new()) };
        if reader.shape(accessor.0, &COLOR)?.kind == Kind::Vec4 {
            return Ok(self.attribute("COLOR_0", &COLOR, reader, cx)?.unwrap_or_default());
        }
        let colors: Vec<[f64; 3]> = self.attribute("COLOR_0", &COLOR, reader, cx)?.unwrap_or_default();
        cx.budget.spend("glTF colours", colors.len() as u64, 32)?;
        Ok(colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect())
    }

    /// All sets of joints and weights.
    pub fn influences(&self, reader: &mut Reader<'_>, cx: &mut Context<'_>) -> Result<Vec<Influences>, MeshError> {
        let mut sets = Vec::new();
        for set in 0..INFLUENCE_SETS_MAX {
            let joints: Option<Vec<[f64; 4]>> = self.attribute(&format!("JOINTS_{set}"), &JOINTS, reader, cx)?;
            let Some(joints) = joints else { break };
            let weights = self.attribute(&format!("WEIGHTS_{set}"), &WEIGHTS, reader, cx)?.unwrap_or_default();
            cx.budget.spend("joints", joints.len() as u64, 8)?;
            sets.push(Influences { joints: joints.into_iter().map(|j| j.map(|j| j as u16)).collect(), weights });
        }
        Ok(sets)
    }

    /// The morph targets, of the right type and size.
    pub fn targets(&self, reader: &Reader<'_>) -> Result<Vec<Target>, MeshError> {
        let find = |target: &schema::Attributes, name: &str, rule: &Rule| -> Result<Option<usize>, MeshError> {
            let Some(accessor) = target.get(name) else { return Ok(None) };
            self.check_count(&format!("{name} of a morph target"), reader.shape(accessor.0, rule)?.count)?;
            Ok(Some(accessor.0))
        };
        let target = |target: &schema::Attributes| {
            let positions = find(target, "POSITION", &MORPH_POSITION)?;
            Ok(Target { positions, normals: find(target, "NORMAL", &MORPH_NORMAL)? })
        };
        self.json.targets.iter().map(target).collect()
    }

    /// Vertex indices, if the primitive has any.
    pub fn indices(&self, reader: &mut Reader<'_>, cx: &mut Context<'_>) -> Result<Option<Vec<u32>>, MeshError> {
        match (&self.unpacked, self.json.indices) {
            (Some(unpacked), _) => unpacked.indices(cx).map(Some),
            (None, Some(accessor)) => reader.indices(accessor.0, cx).map(Some),
            (None, None) => Ok(None),
        }
    }

    /// The topology of its indices. Decompressed ones are always a list.
    pub fn mode(&self) -> usize {
        if self.unpacked.is_some() { mode::TRIANGLES } else { self.json.mode() }
    }

    fn check_count(&self, name: &str, values: u64) -> Result<(), MeshError> {
        match self.count {
            Some(positions) if positions as u64 != values => Err(MeshError::broken(format!(
                "{} of the glTF file has {positions} positions and {values} values of {name}",
                self.what
            ))),
            _ => Ok(()),
        }
    }
}
