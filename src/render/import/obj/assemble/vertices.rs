//! The vertices of an OBJ mesh. A corner of an OBJ face has separate indices of a position, a
//! texture coordinate and a normal. Each combination of them becomes a vertex, anew in each run of
//! faces with one material and one form of corner.
//!
//! The file's lists are taken as they are where corners have positions alone, and where
//! (`uses_of_vertices`) the lists are equally long, all corners have one form and equal indices,
//! and no texture coordinate or normal is broken.

use super::{Names, Room};
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::obj::face::MISSING;
use crate::import::obj::parse::Part;
use crate::import::raw::RawMesh;
use crate::parallel::map;
use rapidhash::RapidHashMap;

/// Combinations of one position that are compared one by one. More are looked up by their hash:
/// a file may have any number of them.
const CHAIN_MAX: usize = 16;
/// Corners between two payments.
const CORNERS_PER_PAYMENT: u64 = 65_536;
/// Bytes of a combination and its vertex, in lists that double as they grow, and its place in a hash
/// table.
const VERTEX_BYTES: u64 = 2 * (16 + 24 + 8 + 12 + 16) + 2 * (12 + 4 + 1);

/// Fills in positions and attributes, and makes the corners of all `parts` refer to them.
pub fn fill(
    parts: &mut [Part<'_>],
    corners: &mut [u32],
    names: &Names,
    lists: Room,
    raw: &mut RawMesh,
    cx: &mut Context<'_>,
) -> Result<(), MeshError> {
    let mut forms = parts.iter().flat_map(|part| &part.groups).map(|group| group.form);
    let (has_uvs, has_normals) = (!lists.uvs.is_empty(), !lists.normals.is_empty());
    if !forms.any(|(vt, vn)| vt && has_uvs || vn && has_normals) {
        (raw.positions, raw.colors) = (lists.positions, lists.colors);
        return Ok(());
    }
    if let Some(uses) = uses_of_vertices(parts, corners, &lists) {
        cx.deadline.check()?;
        (raw.positions, raw.colors) = (lists.positions, lists.colors);
        raw.uvs = if uses.0 { lists.uvs } else { Vec::new() };
        raw.normals = if uses.1 { lists.normals } else { Vec::new() };
        return Ok(());
    }
    cx.budget.spend("the vertices of the OBJ file", lists.positions.len() as u64, 4)?;
    let mut combinations = Combinations::new(lists.positions.len());
    let mut uses = [false; 2];
    let mut last = None;
    let mut unpaid = 0;
    let mut corners = corners.iter_mut();
    for (number, part) in parts.iter_mut().enumerate() {
        let mut at = 0;
        for group in &part.groups {
            // Vertices are shared by faces of one kind that follow each other.
            let run = (group.form, names.material(number, group));
            if last.replace(run) != Some(run) {
                combinations.begin_run();
            }
            let form = (group.form.0 && has_uvs, group.form.1 && has_normals);
            uses = [uses[0] | form.0, uses[1] | form.1];
            for v in corners.by_ref().take(group.faces as usize * group.arity as usize) {
                if unpaid == 0 {
                    cx.deadline.check()?;
                    cx.budget.spend("the vertices of the OBJ file", CORNERS_PER_PAYMENT, VERTEX_BYTES)?;
                    unpaid = CORNERS_PER_PAYMENT;
                }
                unpaid -= 1;
                let vt = if form.0 { part.corner_uvs[at] } else { MISSING };
                let vn = if form.1 { part.corner_normals[at] } else { MISSING };
                *v = combinations.number([*v, vt, vn]);
                at += 1;
            }
        }
        (part.corner_uvs, part.corner_normals) = (Vec::new(), Vec::new());
    }
    if cx.counts_loose {
        let loose = combinations.newest.iter().filter(|newest| **newest == MISSING).count();
        raw.report.loose_vertices = Some(loose as u64);
    }
    let all = &combinations.all;
    if all.len() >= u32::MAX as usize {
        return Err(MeshError::broken("the OBJ file has more than 4 billion vertices"));
    }
    raw.positions = all.iter().map(|one| lists.positions[one.key[0] as usize]).collect();
    if uses[0] {
        raw.uvs = all.iter().map(|one| lists.uvs.get(one.key[1] as usize).copied().unwrap_or_default()).collect();
    }
    if uses[1] {
        raw.normals =
            all.iter().map(|one| lists.normals.get(one.key[2] as usize).copied().unwrap_or_default()).collect();
    }
    if !lists.colors.is_empty() {
        raw.colors = all.iter().map(|one| lists.colors[one.key[0] as usize]).collect();
    }
    Ok(())
}

/// Use of texture coordinates and of normals by faces, if both belong to vertices: each corner has those
/// with the number of its position, as many programs write them. Then the lists are those of a mesh
/// already.
fn uses_of_vertices(parts: &[Part<'_>], corners: &[u32], lists: &Room) -> Option<(bool, bool)> {
    let mut groups = parts.iter().flat_map(|part| &part.groups);
    let form = groups.next()?.form;
    let is_whole = |has: bool, count: usize| !has || count == lists.positions.len();
    if !is_whole(form.0, lists.uvs.len()) || !is_whole(form.1, lists.normals.len()) {
        return None;
    }
    // Corners of more than one kind share nothing, and repairs count what is used.
    if groups.any(|group| group.form != form) || lists.uvs.iter().flatten().any(|c| !c.is_finite()) {
        return None;
    }
    // A normal without direction is repaired from the faces of its own run.
    let has_direction = |n: &[f32; 3]| n.iter().all(|c| c.is_finite()) && *n != [0.0; 3];
    if form.1 && !lists.normals.iter().all(has_direction) {
        return None;
    }
    let mut rest = corners;
    let own_corners = parts.iter().map(|part| {
        let count = part.groups.iter().map(|group| group.faces as usize * group.arity as usize).sum();
        (part, rest.split_off(..count).unwrap_or_default())
    });
    let is_same = map(own_corners.collect(), |(part, corners): (&Part<'_>, &[u32])| {
        (!form.0 || part.corner_uvs == corners) && (!form.1 || part.corner_normals == corners)
    });
    is_same.into_iter().all(|same| same).then_some(form)
}

/// Numbers the distinct combinations of indices, separately for each run of faces.
struct Combinations {
    all: Vec<Combination>,
    /// The newest combination of each position, which begins a chain.
    newest: Vec<u32>,
    run_begin: usize,
    /// Those of the run whose chains are full.
    far: RapidHashMap<[u32; 3], u32>,
}

struct Combination {
    key: [u32; 3],
    /// The next older one of the same position.
    older: u32,
}

impl Combinations {
    fn new(positions: usize) -> Self {
        Self { all: Vec::new(), newest: vec![MISSING; positions], run_begin: 0, far: RapidHashMap::default() }
    }

    fn begin_run(&mut self) {
        self.run_begin = self.all.len();
        if !self.far.is_empty() {
            self.far = RapidHashMap::default();
        }
    }

    fn number(&mut self, key: [u32; 3]) -> u32 {
        let newest = &mut self.newest[key[0] as usize];
        let mut at = *newest;
        let mut steps = 0;
        while let Some(one) = self.all.get(at as usize).filter(|_| at as usize >= self.run_begin) {
            if one.key == key {
                return at;
            }
            steps += 1;
            if steps == CHAIN_MAX {
                break;
            }
            at = one.older;
        }
        let number = self.all.len() as u32;
        if steps < CHAIN_MAX {
            self.all.push(Combination { key, older: *newest });
            *newest = number;
            return number;
        }
        let known = *self.far.entry(key).or_insert(number);
        if known == number {
            self.all.push(Combination { key, older: MISSING });
        }
        known
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_are_numbered_once_a_run_however_many() {
        let mut combinations = Combinations::new(3);
        let key = |i: u32| [i % 3, i % 300, i % 7];
        let mut expected: RapidHashMap<[u32; 3], u32> = RapidHashMap::default();
        for run in 0..3 {
            let before = combinations.all.len() as u32;
            for i in (0..5000).chain(0..5000) {
                let next = before + expected.len() as u32;
                let number = *expected.entry(key(i)).or_insert(next);
                assert_eq!(combinations.number(key(i)), number, "{run} {i}");
            }
            assert_eq!(combinations.all.len() as u32 - before, 2100);
            combinations.begin_run();
            expected.clear();
        }
    }
}
