//! Hulls (outline meshes). A hull of very many edges has few triangles in a small picture, and
//! building and drawing it stop soon after its job. Both back-ends draw hulls alike, and lines that
//! end inside a shape leave nothing beside their ends.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::{Deadline, Limits};
use meshsnap_render::mesh::Mesh;

use crate::support::families::outlines::SHAPES;
use crate::support::families::soups::Random;
use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::truth::cases;
use crate::support::work::assert_stops_at_any_poll;
use crate::support::{scenes, shapes};

/// A mesh of so many triangles in the unit box, up to `size` long, that share no edge: STL.
fn disjoint(count: u32, size: f32) -> Mesh {
    let mut random = Random(5);
    let mut stl = vec![0; 80];
    stl.extend(count.to_le_bytes());
    for _ in 0..count {
        let center = random.point(1.0);
        stl.extend([0; 12]);
        for _ in 0..3 {
            let corner = random.point(size);
            stl.extend((0..3).flat_map(|k| (center[k] + corner[k]).to_le_bytes()));
        }
        stl.extend([0; 2]);
    }
    scenes::mesh_of(&stl).unwrap()
}

#[test]
fn hulls_of_many_edges_end_soon_after_their_job() {
    const TRIANGLES: u32 = 100_000;
    let mesh = disjoint(TRIANGLES, 0.02);
    let spec = scenes::spec(&[("style", "outline"), ("outline.method", "hull"), ("size", "128")]);
    let build = |deadline: &Deadline| scenes::try_plan(&mesh, &spec, &Limits::default(), deadline, &[]).ok();
    let polls = assert_stops_at_any_poll(8, 8, build);
    assert!(polls >= u64::from(TRIANGLES / TRIANGLES_PER_POLL), "{polls} polls while planning");
    let plan = scenes::plan(&mesh, &spec);
    let mut warm = CpuRenderer::new(2);
    warm.draw(&plan, &Deadline::default()).unwrap();
    // A renderer's second picture of a size keeps its samples, and so does less than its first.
    let first = |deadline: &Deadline| CpuRenderer::new(2).draw(&plan, deadline).ok();
    let later = |deadline: &Deadline| warm.draw(&plan, deadline).ok();
    // After a stop, each band that is left polls once and does nothing.
    for polls in [assert_stops_at_any_poll(4, 64, first), assert_stops_at_any_poll(4, 64, later)] {
        assert!(polls >= u64::from(TRIANGLES / TRIANGLES_PER_POLL), "{polls} polls while drawing");
    }
}

/// Triangles of a hull that may lie between two polls of the deadline.
const TRIANGLES_PER_POLL: u32 = 1 << 15;

#[test]
fn hulls_of_many_edges_have_few_triangles_where_there_are_few_pixels() {
    let mesh = disjoint(50_000, 0.02);
    let triangles = |size: &str, px: &str| {
        let keys = [("style", "outline"), ("outline.method", "hull"), ("size", size), ("outline.unit", "px")];
        // Without a surface nothing hides an edge.
        let spec = scenes::spec(&[&keys[..], &[("outline.thickness", px), ("surface", "null")]].concat());
        scenes::plan(&mesh, &spec).hull.unwrap().triangles.len()
    };
    // Three strips and three fans, or six at needles, however wide.
    let (few, many) = (triangles("32", "8"), triangles("512", "8"));
    assert!((400_000..520_000).contains(&few), "{few}");
    assert!((few + 400_000..1_600_000).contains(&many), "{many}");
}

#[test]
fn hulls_are_the_same_on_both_back_ends_with_any_samples() {
    let Some(gpus) = gpus() else { return };
    let mut cpu = CpuRenderer::new(2);
    let mut renderers = gpus.each_ref().map(|gpu| GpuRenderer::new(gpu.clone()));
    let samples: &[&str] = cases(&["1", "8"], &["1", "4", "8", "16"]);
    let mut compared = 0;
    for (name, obj) in [("gear", shapes::gear(9)), ("sheet", shapes::sheet(6)), ("balls", shapes::two_balls())] {
        let mesh = scenes::mesh(&obj);
        for samples in samples.iter().copied() {
            for (unit, thickness, opacity) in [("px", "5", "1"), ("object", "0.07", "1"), ("px", "2.5", "0.4")] {
                let spec = scenes::spec(&[
                    ("style", "outline"),
                    ("size", "140x110"),
                    ("samples", samples),
                    ("outline.method", "hull"),
                    ("outline.unit", unit),
                    ("outline.thickness", thickness),
                    ("outline.color", "d03010"),
                    ("surface.opacity", opacity),
                    ("background", "transparent"),
                ]);
                let plan = scenes::plan(&mesh, &spec);
                let what = format!("{name}, {samples} samples, {thickness} {unit}, opacity {opacity}");
                let cpu = cpu.draw(&plan, &Deadline::default()).unwrap();
                let is_red = |p: &&[u8]| p[3] > 0 && p[0] > 150 && p[1] < 80;
                let red = cpu.rgba.chunks(4).filter(is_red).count();
                assert!(red > 300, "{what}: {red} pixels of an outline");
                for gpu in &mut renderers {
                    let gpu = gpu.draw(&plan, &Deadline::default()).unwrap();
                    Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, &what);
                    compared += 1;
                }
            }
        }
    }
    assert_eq!(compared, 3 * samples.len() * 3 * gpus.len());
}

/// Counts the connected pieces of a picture's dark pixels; a common corner connects.
fn dark_pieces(picture: &Image) -> usize {
    let [width, height] = [picture.width_px as usize, picture.height_px as usize];
    let mut is_left: Vec<bool> = picture.rgba.chunks(4).map(|pixel| pixel[0] < 128).collect();
    let mut pieces = 0;
    for first in 0..is_left.len() {
        pieces += usize::from(is_left[first]);
        let mut reached = vec![first];
        while let Some(at) = reached.pop() {
            if !std::mem::take(&mut is_left[at]) {
                continue;
            }
            let (x, y) = (at % width, at / width);
            let beside = |v: usize, size: usize| v.saturating_sub(1)..(v + 2).min(size);
            let around = beside(y, height).flat_map(|y| beside(x, width).map(move |x| y * width + x));
            reached.extend(around.filter(|&i| is_left[i]));
        }
    }
    pieces
}

#[test]
fn lines_that_end_inside_a_shape_leave_nothing_beside_their_ends() {
    let mut renderer = CpuRenderer::new(2);
    let mut cases = 0;
    for (name, eye) in [("L", "5,-4,4"), ("L", "4,-4,5"), ("star", "0.5,-5,3.5"), ("star", "0.3,-4,3")] {
        let shape = SHAPES.iter().find(|shape| shape.name == name).unwrap();
        let mesh = scenes::mesh(&(shape.obj)());
        for px in ["4", "8", "12"] {
            let keys = [("style", "outline"), ("outline.unit", "px"), ("outline.thickness", px), ("samples", "8")];
            let view = [("camera.eye", eye), ("camera.target", "0,0,0"), ("size", "240x200"), ("background", "fff")];
            let spec = scenes::spec(&[&keys[..], &view, &[("surface.color", "fff")]].concat());
            let picture = renderer.draw(&scenes::plan(&mesh, &spec), &Deadline::default()).unwrap();
            // Each line inside begins at the outer border.
            assert_eq!(dark_pieces(&picture), 1, "{name} from {eye}, {px} px");
            cases += 1;
        }
    }
    assert_eq!(cases, 12);
}
