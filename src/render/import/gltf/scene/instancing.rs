//! The transforms of a node's instances, read from EXT_mesh_gpu_instancing: one node shows its mesh
//! many times. The triangles of all instances are checked against the limit before a transform is
//! read.
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_mesh_gpu_instancing>

use super::transform::Trs;
use crate::import::MeshError;
use crate::import::affine::Affine;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::import::gltf::data::attribute::{INSTANCE_ROTATIONS, INSTANCE_VECTORS, Rule};
use crate::import::gltf::document::schema::Instancing;

/// Transforms of the instances, below that of their node. `triangles` is the count of one instance,
/// and `before` the count so far: the total is checked before any instance is read.
pub fn placements(
    node: usize,
    instancing: &Instancing,
    transform: &Affine,
    [before, triangles]: [u64; 2],
    reader: &mut Reader<'_>,
    cx: &mut Context<'_>,
) -> Result<Vec<Affine>, MeshError> {
    let mut count = None;
    for accessor in instancing.attributes.values() {
        let values = reader.count(accessor.0)?;
        if *count.get_or_insert(values) != values {
            let detail = "has attributes of instances that are not equally many";
            return Err(MeshError::broken(format!("node {node} of the glTF file {detail}")));
        }
    }
    // Without attributes the number of instances is unknown.
    let Some(count) = count else { return Ok(vec![*transform]) };
    cx.check_triangles(count.saturating_mul(triangles).saturating_add(before))?;
    cx.budget.spend("instances", count, size_of::<Affine>() as u64)?;
    let translations = values::<3>(instancing, "TRANSLATION", &INSTANCE_VECTORS, reader, cx)?;
    let rotations = values::<4>(instancing, "ROTATION", &INSTANCE_ROTATIONS, reader, cx)?;
    let scales = values::<3>(instancing, "SCALE", &INSTANCE_VECTORS, reader, cx)?;
    let placement = |i: usize| {
        let trs = Trs {
            translation: translations.get(i).copied().unwrap_or(Trs::IDENTITY.translation),
            rotation: rotations.get(i).copied().unwrap_or(Trs::IDENTITY.rotation),
            scale: scales.get(i).copied().unwrap_or(Trs::IDENTITY.scale),
        };
        transform.after(&trs.into())
    };
    Ok((0..count as usize).map(placement).collect())
}

fn values<const N: usize>(
    instancing: &Instancing,
    name: &str,
    rule: &Rule,
    reader: &mut Reader<'_>,
    cx: &mut Context<'_>,
) -> Result<Vec<[f64; N]>, MeshError> {
    match instancing.attributes.get(name) {
        Some(accessor) => reader.vectors(accessor.0, rule, cx),
        None => Ok(Vec::new()),
    }
}
