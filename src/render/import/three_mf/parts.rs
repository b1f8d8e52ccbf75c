//! All model parts (XML files) of a 3MF package to which the first one leads, directly or through
//! others. Each is read once.

use super::model::{Model, Object, Placed};
use super::xml;
use crate::import::bundle::show;
use crate::import::context::Context;
use crate::import::raw::RawMesh;
use crate::import::report::counted_warnings;
use crate::import::{MeshError, MeshFault};
use rapidhash::RapidHashMap;

/// All parts, the first one first.
pub struct Parts {
    models: Vec<Model>,
    /// Indices of models by path.
    by_path: RapidHashMap<String, usize>,
}

/// An object of a part.
pub type Key = (usize, u32);

/// Reads all of them.
pub fn read(raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<Parts, MeshError> {
    let folder = cx.bundle;
    let first = folder.entry();
    let mut parts = Parts { models: vec![part(&first.path, &first.bytes, cx)?], by_path: RapidHashMap::default() };
    let mut of_file = RapidHashMap::default();
    of_file.insert(first.path.clone(), 0);
    let mut at = 0;
    while let Some(model) = parts.models.get(at) {
        cx.deadline.check()?;
        let placed = model.items.iter().chain(model.objects.values().flat_map(|object| &object.components));
        let mut paths: Vec<String> = placed.filter(|placed| !placed.path.is_empty()).map(|p| p.path.clone()).collect();
        paths.sort_unstable();
        paths.dedup();
        for path in paths {
            if parts.by_path.contains_key(&path) {
                continue;
            }
            let file = folder.at("", path.trim_start_matches('/'))?.map(|number| folder.file(number));
            let file = file.ok_or_else(|| {
                let detail = format!("the 3MF file refers to the part \"{}\", which it does not have", show(&path));
                MeshError::new(MeshFault::Broken, detail)
            })?;
            let number = match of_file.get(&file.path) {
                Some(&number) => number,
                None => {
                    parts.models.push(part(&file.path, &file.bytes, cx)?);
                    of_file.insert(file.path.clone(), parts.models.len() - 1);
                    parts.models.len() - 1
                }
            };
            parts.by_path.insert(path, number);
        }
        at += 1;
    }
    let sum = |of: fn(&Model) -> u64| parts.models.iter().map(of).sum::<u64>();
    let notes = [
        (
            sum(|model| model.unread_groups),
            "properties_ignored",
            "textures and mixed materials of 3MF are not drawn (groups in the file:",
        ),
        (sum(|model| model.beam_lattices), "beams_ignored", "beam lattices are not drawn (meshes in the file:"),
    ];
    raw.report.warnings.extend(counted_warnings(notes));
    Ok(parts)
}

fn part(path: &str, bytes: &[u8], cx: &mut Context<'_>) -> Result<Model, MeshError> {
    let mut model = Model::default();
    xml::walk(path, bytes, &mut model, cx)?;
    Ok(model)
}

impl Parts {
    /// The part with this number.
    pub fn model(&self, number: usize) -> &Model {
        &self.models[number]
    }

    /// Resolves a reference from within a part to an object.
    pub fn find(&self, part: usize, placed: &Placed) -> Result<(Key, &Object), MeshError> {
        let part = if placed.path.is_empty() { Some(part) } else { self.by_path.get(&placed.path).copied() };
        let found = part.and_then(|part| Some(((part, placed.object), self.models[part].objects.get(&placed.object)?)));
        found.ok_or_else(|| {
            MeshError::broken(format!("the 3MF file refers to object {}, which it does not have", placed.object))
        })
    }

    /// The items that are built. Without any, every object that is no component of another.
    pub fn roots(&self) -> Vec<Placed> {
        let first = &self.models[0];
        if !first.items.is_empty() {
            return first.items.clone();
        }
        let components = first.objects.values().flat_map(|object| &object.components);
        let used: rapidhash::RapidHashSet<u32> =
            components.filter(|placed| placed.path.is_empty()).map(|placed| placed.object).collect();
        let unused = first.order.iter().filter(|object| !used.contains(object));
        let place =
            |&object: &u32| Placed { object, path: String::new(), transform: crate::import::affine::Affine::IDENTITY };
        unused.map(place).collect()
    }
}
