//! Sentences on the differences between two meshes, as a reviewer would write them: "one part moved by (0, 0, 1)".
//! They go from the most to the least important. Of a long list, five are written, and a last one counts the others.

use std::collections::BTreeMap;

use super::frame::in_file;
use super::materials::{ChangedMaterial, Materials};
use super::parts::{Changed, Fate, Part};
use super::whole::Whole;
use super::{Comparison, Difference, OneWay};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::pluralise::pluralise;

/// Most things of one kind that are told one by one; the rest is counted.
const TOLD_MAX: usize = 5;

/// Most characters of a name from a file.
const NAME_CHARS_MAX: usize = 60;

/// The sentences, the most important first.
pub fn summary(found: &Comparison<'_>, difference: &Difference) -> Vec<String> {
    let mut said = Vec::new();
    geometry(found, difference, &mut said);
    turned(found, &mut said);
    holes(found, &mut said);
    topology(found, difference, &mut said);
    materials(&difference.materials, &mut said);
    let (a, b) = (found.a.mesh(), found.b.mesh());
    said.extend(lost_attributes(a, b));
    let normals = [a, b].map(|mesh| !mesh.normals.is_empty());
    said.extend(presence(normals, "vertex normals"));
    if said.is_empty() && !difference.geometry.same {
        let distance = difference.geometry.hausdorff.unwrap_or_default();
        said.push(format!("the surface differs by up to {}", number(distance, distance)));
    }
    if said.is_empty() && !difference.same {
        said.push("the topology differs in ways that have no sentence of their own".to_owned());
    }
    said
}

/// What is said of the surfaces.
fn geometry(found: &Comparison<'_>, difference: &Difference, said: &mut Vec<String>) {
    let (a, b) = (found.a.mesh(), found.b.mesh());
    let formats = [found.a.report().format.name(), found.b.report().format.name()];
    let in_format = match formats[0] == formats[1] {
        true => String::new(),
        false => format!(" (as {}, before as {})", formats[1], formats[0]),
    };
    if difference.geometry.hausdorff.is_none() {
        said.push("the meshes are too far from each other for a distance".to_owned());
        return;
    }
    let is_near = [&found.ways[0], &found.ways[1]]
        .into_iter()
        .zip([b, a])
        .all(|(way, to)| way.as_ref().is_some_and(|way| way.max * to.to_file.scale <= found.tolerance));
    if found.faces.are_all_common() && is_near {
        if !found.faces.turned.is_empty() {
            return;
        }
        said.push(match found.has_same_order {
            true => format!("the geometry is unchanged{in_format}"),
            false => format!("the geometry is unchanged, with vertices or faces in another order{in_format}"),
        });
        return;
    }
    if is_near {
        let [now, before] = [b, a].map(|mesh| mesh.triangles.len());
        let faces = pluralise(now, "triangle", "triangles");
        said.push(format!("the surface is unchanged and divided otherwise: {faces}, before {before}{in_format}"));
        return;
    }
    match &found.whole {
        Some(whole) => said.push(of_whole(whole)),
        None => parts(found, said),
    }
    if !in_format.is_empty() {
        said.push(format!("the format is {}, before {}", formats[1], formats[0]));
    }
}

fn of_whole(whole: &Whole) -> String {
    match whole.factor == 1.0 {
        true => format!("the whole mesh moved by {}", shift(whole.by)),
        false => format!("the whole mesh is {} times as large", number(whole.factor, whole.factor)),
    }
}

/// What is said of parts that are not as they were.
fn parts(found: &Comparison<'_>, said: &mut Vec<String>) {
    let scale = found.a.mesh().to_file.scale;
    let mut moved: BTreeMap<String, u64> = BTreeMap::new();
    let mut order = Vec::new();
    for part in &found.parts.changed {
        let Fate::Moved(by) = part.fate else { continue };
        let by = shift(by.map(|value| value * scale));
        let count = moved.entry(by.clone()).or_default();
        *count += 1;
        if *count == 1 {
            order.push(by);
        }
    }
    let sentence = |by: &String| format!("{} moved by {by}", parts_in_words(moved[by]));
    tell(order.iter().map(sentence), order.len(), "more moves of parts", said);
    let of_fate = |fate: Fate| {
        let all: Vec<&Changed> = found.parts.changed.iter().filter(|part| part.fate == fate).collect();
        all
    };
    for (fate, word) in [(Fate::Turned, "was turned"), (Fate::Added, "was added"), (Fate::Removed, "was removed")] {
        let all = of_fate(fate);
        let sentence = |changed: &&Changed| {
            let part = changed.after.as_ref().or(changed.before.as_ref());
            let (faces, near) = part.map(|part| (part.faces, near(part, found))).unwrap_or_default();
            format!("one part with {} {word} near {near}", pluralise(faces, "triangle", "triangles"))
        };
        tell(all.iter().map(sentence), all.len(), &format!("more: each {word}"), said);
    }
    let all = of_fate(Fate::Changed);
    let sentences: Vec<String> = all.iter().filter_map(|changed| of_changed(changed, found)).collect();
    tell(sentences.iter().cloned(), sentences.len(), "more parts changed", said);
}

/// What is said of a part that both meshes have with other faces. None where a hole says it.
fn of_changed(changed: &Changed, found: &Comparison<'_>) -> Option<String> {
    let (before, after) = (changed.before.as_ref()?, changed.after.as_ref()?);
    let largest = |part: &Part, way: &Option<OneWay>, scale: f64| {
        let distances = way.as_ref().map_or(&[] as &[f64], |way| &way.of_vertices);
        let of_vertex = |vertex: &u32| distances.get(*vertex as usize).map_or(0.0, |distance| distance * scale);
        let farthest = part.vertices.iter().map(|vertex| (of_vertex(vertex), *vertex));
        farthest.fold((0.0, u32::MAX), |best, one| if one.0 > best.0 { one } else { best })
    };
    let there = largest(before, &found.ways[0], found.b.mesh().to_file.scale);
    let back = largest(after, &found.ways[1], found.a.mesh().to_file.scale);
    let ((distance, vertex), mesh) = if back.0 >= there.0 { (back, found.b.mesh()) } else { (there, found.a.mesh()) };
    if distance > found.tolerance {
        let position = mesh.positions.get(vertex as usize)?.map(f64::from);
        let at = place(in_file(&mesh.to_file, position), found.diagonal);
        return Some(format!("one part changed its shape by up to {} near {at}", number(distance, distance)));
    }
    let near = near(after, found);
    match (before.own_faces, after.own_faces) {
        (gone, 0) if !found.new_holes.is_empty() || gone == 0 => None,
        (gone, 0) => Some(format!("{} gone near {near}", pluralise(gone, "face is", "faces are"))),
        (0, _) if !found.closed_holes.is_empty() => None,
        (0, new) => Some(format!("{} new near {near}", pluralise(new, "face is", "faces are"))),
        _ => Some(format!("one part has other faces near {near}")),
    }
}

/// What is said of faces that look to the other side.
fn turned(found: &Comparison<'_>, said: &mut Vec<String>) {
    let turned = &found.faces.turned;
    let mesh = found.b.mesh();
    let Some(first) = turned.first() else { return };
    if turned.len() == mesh.triangles.len() && turned.len() > 1 {
        said.push("all faces look to the other side".to_owned());
        return;
    }
    let corners = mesh.triangles[*first as usize].map(|vertex| mesh.positions[vertex as usize].map(f64::from));
    let middle = std::array::from_fn(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
    let at = place(in_file(&mesh.to_file, middle), found.diagonal);
    said.push(match turned.len() {
        1 => format!("one face looks to the other side near {at}"),
        count => format!("{count} faces look to the other side, the first near {at}"),
    });
}

fn holes(found: &Comparison<'_>, said: &mut Vec<String>) {
    let new = found.new_holes.iter().map(|hole| {
        let edges = pluralise(hole.edges, "edge", "edges");
        format!("a hole with {edges} near {}", place(hole.at, found.diagonal))
    });
    tell(new, found.new_holes.len(), "more holes", said);
    let closed = found.closed_holes.iter().map(|hole| {
        let edges = pluralise(hole.edges, "edge", "edges");
        format!("the hole with {edges} near {} is closed", place(hole.at, found.diagonal))
    });
    tell(closed, found.closed_holes.len(), "more holes are closed", said);
}

fn topology(found: &Comparison<'_>, difference: &Difference, said: &mut Vec<String>) {
    let (a, b) = (&difference.topology.a, &difference.topology.b);
    match (a.is_watertight, b.is_watertight) {
        (true, false) => said.push("it is no longer watertight".to_owned()),
        (false, true) => said.push("it is watertight now".to_owned()),
        _ => {}
    }
    let counts = [
        (a.nonmanifold_edges, b.nonmanifold_edges, "edges with more than two faces"),
        (a.nonmanifold_vertices, b.nonmanifold_vertices, "vertices where surfaces touch"),
        (a.duplicate_faces, b.duplicate_faces, "faces that repeat others"),
        (a.components, b.components, "connected parts"),
        (a.boundary_loops, b.boundary_loops, "loops of open edges"),
    ];
    // Holes that are told one by one are no further news.
    let loops = b.boundary_loops as i128 - a.boundary_loops as i128;
    let is_told = loops == found.new_holes.len() as i128 - found.closed_holes.len() as i128;
    let told = if is_told { counts.len() - 1 } else { counts.len() };
    for (before, now, what) in counts.into_iter().take(told).filter(|(before, now, _)| before != now) {
        said.push(format!("{what}: {now}, before {before}"));
    }
    if let (Some(before), Some(now)) = (a.genus, b.genus)
        && before != now
    {
        said.push(format!("handles: {now}, before {before}"));
    }
}

fn materials(materials: &Materials, said: &mut Vec<String>) {
    let name = |name: &String| match name.is_empty() {
        true => "a material without a name".to_owned(),
        false => format!("the material \"{}\"", cut(name)),
    };
    let added = materials.added.iter().map(|one| format!("{} is new", name(one)));
    tell(added, materials.added_count as usize, "more materials are new", said);
    let removed = materials.removed.iter().map(|one| format!("{} is gone", name(one)));
    tell(removed, materials.removed_count as usize, "more materials are gone", said);
    let changed = |one: &ChangedMaterial| format!("{} changed: {}", name(&one.name), one.what.join(", "));
    tell(materials.changed.iter().map(changed), materials.changed_count as usize, "more materials changed", said);
    if materials.reassigned_faces > 0 {
        let (one, more) = ("face has another material", "faces have another material");
        said.push(pluralise(materials.reassigned_faces, one, more));
    }
    if materials.faces_with_other_uvs > 0 {
        let (one, more) = ("face has other texture coordinates", "faces have other texture coordinates");
        said.push(pluralise(materials.faces_with_other_uvs, one, more));
    }
}

/// What is said of texture coordinates and colours that only one mesh has.
pub fn lost_attributes(a: &Mesh, b: &Mesh) -> Vec<String> {
    let uvs = presence([a, b].map(|mesh| !mesh.uvs.is_empty()), "texture coordinates");
    uvs.into_iter().chain(presence([a, b].map(|mesh| !mesh.colors.is_empty()), "vertex colours")).collect()
}

fn presence(is_there: [bool; 2], what: &str) -> Option<String> {
    match is_there {
        [true, false] => Some(format!("{what} are gone")),
        [false, true] => Some(format!("{what} are new")),
        _ => None,
    }
}

/// The first sentences, and how many more there would be.
fn tell(sentences: impl Iterator<Item = String>, count: usize, more: &str, said: &mut Vec<String>) {
    said.extend(sentences.take(TOLD_MAX));
    if count > TOLD_MAX {
        said.push(format!("{} {more}", count - TOLD_MAX));
    }
}

fn parts_in_words(count: u64) -> String {
    if count == 1 { "one part".to_owned() } else { format!("{count} parts") }
}

/// The middle of a part.
fn near(part: &Part, found: &Comparison<'_>) -> String {
    place(in_file(&found.a.mesh().to_file, part.middle), found.diagonal)
}

/// A position, to about the ten-thousandth part of the diagonal.
pub fn place(position: [f64; 3], diagonal: f64) -> String {
    let [x, y, z] = position.map(|value| number(value, diagonal * 0.1));
    format!("({x}, {y}, {z})")
}

/// A shift, with four digits.
fn shift(by: [f64; 3]) -> String {
    let largest = by.into_iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    place(by, largest * 10.0)
}

/// A number with the digits that matter among numbers of this size: four.
fn number(value: f64, size: f64) -> String {
    let magnitude = libm::floor(libm::log10(size));
    let decimals = 3.0 - magnitude;
    if !(0.0..=12.0).contains(&decimals) {
        return match decimals < 0.0 {
            true => format!("{value:.0}"),
            false => format!("{value:.3e}"),
        };
    }
    let rounded: f64 = format!("{value:.*}", decimals as usize).parse().unwrap_or(value);
    // No minus before a zero.
    if rounded == 0.0 { "0".to_owned() } else { rounded.to_string() }
}

fn cut(name: &str) -> String {
    let plain = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let mut cut: String = name.chars().take(NAME_CHARS_MAX).map(plain).collect();
    if name.chars().count() > NAME_CHARS_MAX {
        cut.push('…');
    }
    cut
}
