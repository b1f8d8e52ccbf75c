//! The default style: flat parts look as face normals make them, and a file's own normals are kept.

#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use std::collections::HashMap;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;

use crate::render::models::readable;
use crate::support::{data, scenes, shapes};

/// Cosine of the angle up to which two faces lie in a plane: 0.6 degrees.
const LEVEL: f32 = 0.99995;

/// Cosine of the angle from which an edge is surely a crease: the default is 30 degrees.
const SHARP: f32 = 0.85;

/// Largest difference from flat shading, bytes.
const DIFFERENCE_MAX: u8 = 1;

#[test]
fn flat_parts_of_generated_meshes_look_flat() {
    let meshes = [shapes::cube(), shapes::boxes_on_a_floor(), shapes::stacked_boxes(), shapes::gear(12)];
    for (i, obj) in meshes.iter().enumerate() {
        look_flat(&format!("mesh {i}"), &scenes::mesh(obj), 5_000);
    }
}

#[test]
fn flat_parts_of_machine_parts_look_flat() {
    let Some(folder) = data::large_folder("models") else { return };
    for (name, pixels_min) in [("fandisk.obj", 20_000), ("featuretype.STL", 20_000), ("angle_block.STL", 20_000)] {
        look_flat(name, &scenes::mesh_of(&std::fs::read(folder.join(name)).unwrap()).unwrap(), pixels_min);
    }
}

#[test]
fn normals_of_files_are_kept() {
    let mut meshes = readable(&data::folder("models"));
    meshes.extend(data::large_folder("models").map(|folder| readable(&folder)).unwrap_or_default());
    let mut compared = 0;
    for (name, mesh) in meshes.iter().filter(|(_, mesh)| !mesh.normals.is_empty()) {
        let plan = scenes::plan(mesh, &scenes::spec(&[("size", "64")]));
        let Some(surface) = plan.surface.as_ref().filter(|surface| surface.is_shaded) else { continue };
        let normals = surface.vertex_normals.as_ref().unwrap_or_else(|| panic!("{name} is drawn without its normals"));
        assert_eq!(normals.values[..], mesh.normals[..], "{name}");
        assert_eq!(normals.triangles[..], mesh.attribute_triangles[..], "{name}");
        compared += 1;
    }
    assert!(compared >= 4, "{compared}");
}

/// Compares the default style with `flat` in all pixels that show nothing but flat parts: at least so many.
fn look_flat(name: &str, mesh: &Mesh, pixels_min: usize) {
    let is_level = level_parts(mesh);
    let draw = |style: &str| {
        // In the same light, without hollows.
        let light = [("light.ambient", "0.3"), ("light.ambient_occlusion", "0")];
        let keys = [&light[..], &[("style", style), ("size", "512"), ("background", "transparent")]].concat();
        let plan = scenes::plan(mesh, &scenes::spec(&keys));
        let mut renderer = CpuRenderer::new(2);
        let picture = renderer.draw(&plan, &Deadline::default()).unwrap();
        let words = renderer.draw_visibility(&plan, &Deadline::default()).unwrap();
        (picture, words, plan.samples as usize)
    };
    let (own, words, samples) = draw("auto");
    let (flat, ..) = draw("flat");
    let shows_level = |word: &u64| is_level.get(!(*word as u32) as usize).is_some_and(|is| *is);
    let (mut compared, mut largest) = (0, 0);
    for (i, words) in words.chunks_exact(samples).enumerate() {
        if words.iter().all(shows_level) {
            compared += 1;
            for (a, b) in own.rgba[4 * i..4 * i + 4].iter().zip(&flat.rgba[4 * i..]) {
                largest = largest.max(a.abs_diff(*b));
            }
        }
    }
    println!("{name:<20} {compared} pixels of flat parts, largest difference from flat shading {largest}/255");
    assert!(compared >= pixels_min, "{name}: only {compared} pixels show flat parts");
    assert!(largest <= DIFFERENCE_MAX, "{name}: {largest}");
}

/// By triangle: true if it belongs to a part that lies in a plane and has sharp edges alone around it.
fn level_parts(mesh: &Mesh) -> Vec<bool> {
    let mut sides: HashMap<[u32; 2], Vec<usize>> = HashMap::new();
    for (t, [a, b, c]) in mesh.triangles.iter().copied().enumerate() {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            sides.entry([a.min(b), a.max(b)]).or_default().push(t);
        }
    }
    let cosine = |a: usize, b: usize| (0..3).map(|k| mesh.face_normals[a][k] * mesh.face_normals[b][k]).sum::<f32>();
    let pairs: Vec<([usize; 2], f32)> = sides
        .values()
        .filter_map(|faces| <[usize; 2]>::try_from(&faces[..]).ok())
        .map(|[a, b]| ([a, b], cosine(a, b)))
        .collect();
    // A part is named after its first triangle.
    let mut part: Vec<usize> = (0..mesh.triangles.len()).collect();
    let mut has_changed = true;
    while has_changed {
        has_changed = false;
        for ([a, b], cosine) in &pairs {
            let least = part[*a].min(part[*b]);
            if *cosine >= LEVEL && part[*a] != part[*b] {
                (part[*a], part[*b], has_changed) = (least, least, true);
            }
        }
    }
    // A plane that bends slowly is none.
    let mut is_level: Vec<bool> = (0..part.len()).map(|t| cosine(t, part[t]) >= LEVEL).collect();
    let level_alone = is_level.clone();
    for (t, of) in part.iter().enumerate() {
        is_level[*of] &= level_alone[t];
    }
    for ([a, b], cosine) in &pairs {
        if *cosine > SHARP && part[*a] != part[*b] {
            is_level[part[*a]] = false;
            is_level[part[*b]] = false;
        }
    }
    part.iter().map(|of| is_level[*of]).collect()
}
