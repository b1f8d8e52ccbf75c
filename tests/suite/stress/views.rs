//! Awkward views: fields of view from 0.01 to 179 degrees, pictures from one pixel to the limit,
//! the eye inside the mesh or on a corner of it, and flat meshes seen edge on.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::import::MeshFault;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::DrawPlan;

use crate::support::families::moved::{LOOKS, MESHES, draw, is_blank};
use crate::support::files::mesh::read;
use crate::support::scenes;
use crate::support::truth::renderers;

fn plan<'a>(mesh: &'a Mesh, keys: &[(&str, &str)]) -> DrawPlan<'a> {
    scenes::plan(mesh, &scenes::spec(keys))
}

/// The visibility buffer, which must be the same on every back-end; depths are finite.
fn visibility(plan: &DrawPlan<'_>, renderers: &mut [Box<dyn Renderer>], what: &str) -> Vec<u64> {
    let mut all = renderers.iter_mut().map(|r| r.draw_visibility(plan, &Deadline::default()).unwrap());
    let words = all.next().unwrap();
    assert!(all.all(|other| other == words), "{what}: other samples");
    let depths = words.iter().filter(|&&word| word != 0).map(|word| f32::from_bits((word >> 32) as u32));
    assert!(depths.into_iter().all(|depth| depth > 0.0 && depth <= 1.0), "{what}: no depth");
    words
}

/// Left, top, right and bottom of what is seen, pixels.
fn extent(words: &[u64], width_px: usize) -> [usize; 4] {
    let seen =
        words.iter().enumerate().filter(|(_, word)| **word != 0).map(|(i, _)| [i / 4 % width_px, i / 4 / width_px]);
    seen.fold([usize::MAX, usize::MAX, 0, 0], |e, [x, y]| [e[0].min(x), e[1].min(y), e[2].max(x), e[3].max(y)])
}

#[test]
fn every_field_of_view_shows_the_whole_mesh_as_large_as_can_be() {
    let mut fitted = 0;
    let mut renderers = renderers();
    let fields = ["0.01", "0.1", "1", "10", "35", "90", "135", "160", "175", "179"];
    for (name, obj) in MESHES {
        let mesh = scenes::mesh(&obj());
        for fov in fields {
            let what = format!("{name}, {fov} degrees");
            let plan = plan(&mesh, &[("style", "flat"), ("size", "200x160"), ("camera.fov_deg", fov)]);
            let words = visibility(&plan, &mut renderers, &what);
            let [left, top, right, bottom] = extent(&words, 200);
            let seen = words.iter().filter(|&&word| word != 0).count();
            // At 179 degrees what is a little farther than the nearest corner is tiny.
            assert!(seen > 2, "{what}: {seen} samples");
            // A twentieth is left free on each side, and one of the two directions is filled.
            assert!(left >= 9 && right <= 190 && top >= 7 && bottom <= 152, "{what}: {left} {top} {right} {bottom}");
            let is_full = right - left >= 176 || bottom - top >= 140;
            assert!(is_full || fov.len() > 2, "{what}: {left} {top} {right} {bottom}");
            fitted += 1;
        }
    }
    assert_eq!(fitted, MESHES.len() * fields.len());
}

#[test]
fn every_look_can_be_drawn_in_every_field_of_view() {
    let mut drawn = 0;
    let mut renderer = CpuRenderer::new(2);
    for (name, obj) in MESHES {
        let mesh = scenes::mesh(&obj());
        for fov in ["0.01", "1", "120", "170"] {
            for (look, keys) in LOOKS {
                let keys = [keys, &[("camera.fov_deg", fov)]].concat();
                let picture =
                    renderer.draw(&plan(&mesh, &[&keys[..], &[("size", "96x80")]].concat()), &Deadline::default());
                assert!(!is_blank(&picture.unwrap()), "{name}, {fov} degrees, {look}");
                drawn += 1;
            }
        }
    }
    assert_eq!(drawn, MESHES.len() * 4 * LOOKS.len());
}

#[test]
fn pictures_of_any_size_are_drawn() {
    let mut drawn = 0;
    let mut renderers = renderers();
    let sizes = ["1x1", "1x2", "2x1", "3x5", "7x1", "8x8", "9x17", "33x65", "2x300", "300x2"];
    for (name, obj) in MESHES {
        let mesh = scenes::mesh(&obj());
        for size in sizes {
            let what = format!("{name}, {size}");
            let words = visibility(&plan(&mesh, &[("style", "flat"), ("size", size)]), &mut renderers, &what);
            // The sheet is narrow and slips between the samples of a single pixel.
            let seen = words.iter().filter(|&&word| word != 0).count();
            assert!(seen > 0 || what == "sheet, 1x1", "{what}: nothing is seen");
            for (look, keys) in LOOKS {
                let picture = draw(&mesh, keys, size, &mut CpuRenderer::new(1));
                assert_eq!(format!("{}x{}", picture.width_px, picture.height_px), size);
                assert_eq!(picture.rgba.len() as u32, picture.width_px * picture.height_px * 4, "{what}, {look}");
                drawn += 1;
            }
        }
    }
    assert_eq!(drawn, MESHES.len() * sizes.len() * LOOKS.len());
}

/// As long, as high and as large as can be.
#[test]
fn pictures_as_large_as_the_limit_are_drawn() {
    let mut drawn = 0;
    let mesh = scenes::mesh(&MESHES[1].1());
    let looks: [&[(&str, &str)]; 2] = [&[("style", "wire")], &[("style", "outline"), ("outline.unit", "px")]];
    for (size, looks) in [("4096x1", &looks[..]), ("1x4096", &looks[..]), ("4096", &looks[..1])] {
        for look in looks {
            let picture = draw(&mesh, look, size, &mut CpuRenderer::new(2));
            assert!(!is_blank(&picture), "{size}");
            drawn += 1;
        }
    }
    assert_eq!(drawn, 5);
}

/// In a closed mesh something is seen in every direction.
#[test]
fn from_inside_a_closed_mesh_every_sample_is_covered() {
    let mut all = 0;
    let mut renderers = renderers();
    // In the tube of the torus, in the middle of the others; far inside and right at the wall.
    let insides =
        [("torus", 0, "1,0.01,0.02"), ("cube", 3, "0.1,0.2,0.3"), ("cube", 3, "0.999,0,0"), ("ball", 4, "0,0.1,0")];
    for (name, mesh, eye) in insides {
        let mesh = scenes::mesh(&MESHES[mesh].1());
        for target in ["5,0,0", "-5,0.5,0", "0,5,0", "0.1,-5,0", "1,2,3", "0,0,-9"] {
            for fov in ["1", "60", "150"] {
                let what = format!("{name} from {eye} to {target}, {fov} degrees");
                let keys = [("size", "48x40"), ("camera.eye", eye), ("camera.target", target), ("camera.fov_deg", fov)];
                let words =
                    visibility(&plan(&mesh, &[&keys[..], &[("style", "flat")]].concat()), &mut renderers, &what);
                let open = words.iter().filter(|&&word| word == 0).count();
                assert_eq!(open, 0, "{what}: samples without a surface");
                for (_, look) in LOOKS {
                    let picture = CpuRenderer::new(1).draw(&plan(&mesh, &[look, &keys].concat()), &Deadline::default());
                    assert_eq!(picture.unwrap().rgba.len(), 48 * 40 * 4);
                }
                all += 1;
            }
        }
    }
    assert_eq!(all, insides.len() * 6 * 3);
}

/// The near plane is then far nearer than f32 can tell from the eye.
#[test]
fn with_the_eye_on_a_corner_of_the_mesh_both_back_ends_see_the_same() {
    let mut renderers = renderers();
    let mut cases = 0;
    for (mesh, eye) in [(0, "1.4,0,0"), (0, "-0.6,0,0"), (3, "1,1,1"), (3, "-1,1,-1"), (4, "0,1,0")] {
        let mesh = scenes::mesh(&MESHES[mesh].1());
        for target in ["0,0,0", "0.3,-0.2,0.1", "5,0.5,0.2"] {
            for (_, look) in LOOKS {
                let keys =
                    [("size", "48x40"), ("camera.eye", eye), ("camera.target", target), ("camera.fov_deg", "70")];
                let plan = plan(&mesh, &[look, &keys].concat());
                let mut all = renderers.iter_mut().map(|r| r.draw_visibility(&plan, &Deadline::default()).unwrap());
                let words = all.next().unwrap();
                assert!(all.all(|other| other == words), "{eye} to {target}, {look:?}: other samples");
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 5 * 3 * LOOKS.len());
}

#[test]
fn faces_that_are_a_point_or_a_line_are_refused() {
    let files = [
        "v 1 2 3\nf 1 1 1\n",
        "v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n",
        "v 0 0 0\nv 1 1 1\nv 3 3 3\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 1e9 0 0\nv 1e-9 0 0\nf 1 2 3 4\n",
        "v 0 0 0\nv 1 0 0\nf 1 2 1\nf 2 1 2\n",
        "v 1 2 3\nl 1 1\n",
        "v nan 2 3\np 1\n",
    ];
    for file in files {
        let error = read(file.as_bytes()).unwrap_err();
        assert_eq!(error.fault, MeshFault::Empty, "{file}: {}", error.detail);
    }
    assert_eq!(files.len(), 7);
}

/// A sheet is a full square from the front, and from above a line, which only what draws edges
/// shows.
#[test]
fn flat_meshes_are_seen_from_the_front_and_edge_on() {
    let mut drawn = 0;
    let mut renderers = renderers();
    let flat = scenes::mesh("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 0\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n");
    for projection in ["perspective", "orthographic"] {
        for (view, is_seen) in
            [("front", true), ("back", true), ("top", false), ("bottom", false), ("left", false), ("right", false)]
        {
            let keys = [("size", "64"), ("view", view), ("camera.projection", projection)];
            let what = format!("{view}, {projection}");
            let words = visibility(&plan(&flat, &[&keys[..], &[("style", "flat")]].concat()), &mut renderers, &what);
            let seen = words.iter().filter(|&&word| word != 0).count();
            // 57.6 px of 64, squared, with four samples.
            assert!(if is_seen { seen.abs_diff(13271) < 300 } else { seen == 0 }, "{what}: {seen} samples");
            for (look, keys_of_look) in LOOKS {
                let keys = [keys_of_look, &keys].concat();
                let picture = renderers[0].draw(&plan(&flat, &keys), &Deadline::default()).unwrap();
                let shows_edges = !["flat", "smooth", "hull", "hull px", "fwidth", "contour"].contains(&look);
                assert!(!is_blank(&picture) || !(is_seen || shows_edges), "{what}, {look}");
                drawn += 1;
            }
        }
    }
    assert_eq!(drawn, 2 * 6 * LOOKS.len());
}
