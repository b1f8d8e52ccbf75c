//! Differences between the materials, the textures and the texture coordinates of two meshes: materials that were
//! added, removed or changed, and the number of faces that are in both meshes but with another material or other
//! texture coordinates.

use rapidhash::RapidHashMap;
use serde::Serialize;

use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::material::{ImageContent, ImageSource, MaterialSlot, TextureRef};

/// Most names that a list has; all are counted.
pub const NAMES_MAX: usize = 20;

/// The largest difference between two texture coordinates that count as the same.
const UV_ROUNDING: f32 = 1e-5;

/// Memory of a material: its place, and its entry in a map.
const BYTES_PER_MATERIAL: u64 = 96;

/// Materials that differ. An empty name is that of a material without one.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Materials {
    /// True if nothing differs.
    pub same: bool,
    /// Materials that only the second mesh has: the first names.
    pub added: Vec<String>,
    /// How many there are.
    pub added_count: u64,
    /// Materials that only the first mesh has: the first names.
    pub removed: Vec<String>,
    /// How many there are.
    pub removed_count: u64,
    /// Materials that look otherwise: the first.
    pub changed: Vec<ChangedMaterial>,
    /// How many there are.
    pub changed_count: u64,
    /// Faces of both meshes that have another material.
    pub reassigned_faces: u64,
    /// Faces of both meshes that have other texture coordinates.
    pub faces_with_other_uvs: u64,
}

/// A material that looks otherwise.
#[derive(Clone, Debug, Serialize)]
pub struct ChangedMaterial {
    /// Its name.
    pub name: String,
    /// What differs.
    pub what: Vec<String>,
}

/// Compares the materials, and those of the faces that both meshes have. Of a mesh without faces of a material,
/// the material counts as well.
pub fn compare(a: &Mesh, b: &Mesh, common: &[[u32; 2]], budget: &mut Budget) -> Result<Materials, LimitExceeded> {
    budget.spend("materials to compare", (a.materials.len() + b.materials.len()) as u64, BYTES_PER_MATERIAL)?;
    let mut found = Materials::default();
    let of_a: RapidHashMap<(&str, u32), u32> = keys(a).zip(0..).collect();
    // By material of `b`, the same of `a`.
    let mut same = vec![None; b.materials.len()];
    let mut is_met = vec![false; a.materials.len()];
    for (index, key) in keys(b).enumerate() {
        let name = b.materials[index].name.clone();
        let Some(before) = of_a.get(&key).copied() else {
            push(&mut found.added, &mut found.added_count, name);
            continue;
        };
        (same[index], is_met[before as usize]) = (Some(before), true);
        let what = changes((a, &a.materials[before as usize]), (b, &b.materials[index]));
        if !what.is_empty() {
            push(&mut found.changed, &mut found.changed_count, ChangedMaterial { name, what });
        }
    }
    let unmet = a.materials.iter().zip(&is_met).filter(|(_, is_met)| !**is_met);
    unmet.for_each(|(material, _)| push(&mut found.removed, &mut found.removed_count, material.name.clone()));
    let material = |mesh: &Mesh, face: u32| mesh.triangle_materials.get(face as usize).copied().unwrap_or(0);
    // Where a material is new under its name, its faces are no further change.
    let is_reassigned = |pair: &&[u32; 2]| {
        let after = same.get(material(b, pair[1]) as usize).copied().flatten();
        after.is_some_and(|after| after != material(a, pair[0]))
    };
    found.reassigned_faces = common.iter().filter(is_reassigned).count() as u64;
    if !a.uvs.is_empty() && !b.uvs.is_empty() {
        let moved = common.iter().filter(|pair| have_other_uvs(a, b, **pair));
        found.faces_with_other_uvs = moved.count() as u64;
    }
    let counts = [found.added_count, found.removed_count, found.changed_count];
    found.same = counts == [0; 3] && found.reassigned_faces == 0 && found.faces_with_other_uvs == 0;
    Ok(found)
}

fn push<T>(list: &mut Vec<T>, count: &mut u64, item: T) {
    *count += 1;
    if list.len() < NAMES_MAX {
        list.push(item);
    }
}

/// Names, each with how often it came before.
fn keys(mesh: &Mesh) -> impl Iterator<Item = (&str, u32)> {
    let mut met: RapidHashMap<&str, u32> = RapidHashMap::default();
    mesh.materials.iter().map(move |material| {
        let count = met.entry(&material.name).or_default();
        *count += 1;
        (material.name.as_str(), *count)
    })
}

/// What differs between two materials.
fn changes((a, before): (&Mesh, &MaterialSlot), (b, after): (&Mesh, &MaterialSlot)) -> Vec<String> {
    let mut what = Vec::new();
    let mut check = |name: &str, differs: bool| {
        if differs {
            what.push(name.to_owned());
        }
    };
    check("colour", before.base_color != after.base_color);
    check("metallic", before.metallic != after.metallic);
    check("roughness", before.roughness != after.roughness);
    check("emission", before.emissive != after.emissive);
    check("transparency", before.alpha != after.alpha);
    check("light", before.unlit != after.unlit);
    let textures = [
        ("texture", before.base_texture, after.base_texture),
        ("texture of metallic and roughness", before.metallic_roughness_texture, after.metallic_roughness_texture),
        ("normal texture", before.normal_texture, after.normal_texture),
        ("emissive texture", before.emissive_texture, after.emissive_texture),
        ("occlusion texture", before.occlusion_texture, after.occlusion_texture),
    ];
    for (name, before, after) in textures {
        match (before, after) {
            (None, None) => {}
            (None, Some(_)) => what.push(format!("{name} (new)")),
            (Some(_), None) => what.push(format!("{name} (gone)")),
            (Some(before), Some(after)) => {
                let images = [(a, before), (b, after)].map(|(mesh, texture)| mesh.images.get(texture.image as usize));
                if !have_same_content(images) {
                    what.push(format!("{name} (another image)"));
                } else if (TextureRef { image: 0, ..before }) != (TextureRef { image: 0, ..after }) {
                    what.push(format!("{name} (placed otherwise)"));
                }
            }
        }
    }
    what
}

fn have_same_content(images: [Option<&ImageSource>; 2]) -> bool {
    match images.map(|image| image.map(|image| &image.content)) {
        [Some(ImageContent::Encoded(before)), Some(ImageContent::Encoded(after))] => before == after,
        // Not there in either: the names tell.
        [Some(ImageContent::Absent), Some(ImageContent::Absent)] => {
            images[0].map(|image| &image.name) == images[1].map(|image| &image.name)
        }
        [before, after] => before.is_none() && after.is_none(),
    }
}

/// True if a corner of one face has other texture coordinates than the same corner of the other.
fn have_other_uvs(a: &Mesh, b: &Mesh, [face_a, face_b]: [u32; 2]) -> bool {
    let (Some(before), Some(after)) =
        (a.attribute_triangles.get(face_a as usize), b.attribute_triangles.get(face_b as usize))
    else {
        return false;
    };
    let uv = |mesh: &Mesh, index: u32| mesh.uvs.get(index as usize).copied().unwrap_or_default();
    let (before, after) = (before.map(|index| uv(a, index)), after.map(|index| uv(b, index)));
    let is_same = |one: [f32; 2], other: [f32; 2]| (0..2).all(|k| (one[k] - other[k]).abs() <= UV_ROUNDING);
    // Either may begin at another corner, and run the other way if it is turned.
    let fits = |order: [usize; 3]| (0..3).all(|k| is_same(before[k], after[order[k]]));
    ![[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]].into_iter().any(fits)
}
