//! Hulls (outline meshes) never show through closed surfaces. The truth tests points of the
//! silhouette edges against every face: a pixel may have the outline's colour only if a visible
//! point is within the outline's width.

use std::collections::HashMap;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::DrawPlan;

use crate::support::scenes;
use crate::support::shapes::{Obj, Random};
use crate::support::truth::cases;

/// The outline's thickness, pixels.
const REACH_PX: f64 = 6.0;

/// How much nearer the outline may be than a visible edge is: hidden parts of up to 1 px are drawn,
/// and pixels have a size.
const SLACK_PX: f64 = 2.0;

#[test]
fn hulls_do_not_show_through_closed_surfaces() {
    let mut random = Random(20);
    let (mut pictures, mut colored) = (0, 0);
    let mut missed = Vec::new();
    for i in 0..cases(12, 60) {
        for (name, obj) in [
            ("things in a box", things_in_a_box(&mut random)),
            ("beams through a solid", beams(&mut random)),
            ("voxels", voxels(&mut random)),
            ("rings", rings(&mut random)),
        ] {
            let mesh = scenes::mesh(&obj);
            let azimuth = random.range(0.0, 360.0).to_string();
            let elevation = random.range(-80.0, 80.0).to_string();
            let keys = [
                ("style", "outline"),
                ("surface.shading", "unlit"),
                ("surface.color", "fff"),
                ("outline.unit", "px"),
                ("outline.thickness", "6"),
                ("size", "200x160"),
                ("samples", "1"),
                ("camera.azimuth_deg", &azimuth),
                ("camera.elevation_deg", &elevation),
            ];
            let plan = scenes::plan(&mesh, &scenes::spec(&keys));
            let (wrong, dark) = wrong_pixels(&mesh, &plan);
            if wrong > 0 {
                missed.push(format!("{name} {i} from {azimuth}, {elevation}: {wrong} of {dark} pixels"));
            }
            pictures += 1;
            colored += dark;
        }
    }
    assert_eq!(pictures, 4 * cases(12, 60));
    assert!(colored > 500 * pictures, "{colored} pixels in {pictures} pictures");
    assert!(missed.is_empty(), "{} of {pictures}:\n{}", missed.len(), missed.join("\n"));
}

/// Pixels of the outline's colour without a visible silhouette edge nearby, and those of its colour.
fn wrong_pixels(mesh: &Mesh, plan: &DrawPlan<'_>) -> (usize, usize) {
    let picture = CpuRenderer::new(2).draw(plan, &Deadline::default()).unwrap();
    let seen = visible_silhouettes(mesh, plan);
    let [width, height] = [plan.width_px as usize, plan.height_px as usize];
    let (mut wrong, mut dark) = (0, 0);
    for (i, _) in picture.rgba.chunks(4).enumerate().filter(|(_, pixel)| pixel[0] < 128) {
        let at = [(i % width) as f64 + 0.5 - 0.5 * width as f64, (i / width) as f64 + 0.5 - 0.5 * height as f64];
        let is_near = |p: &[f64; 2]| (p[0] - at[0]).hypot(p[1] - at[1]) <= REACH_PX + SLACK_PX;
        wrong += usize::from(!seen.iter().any(is_near));
        dark += 1;
    }
    (wrong, dark)
}

/// Points of visible silhouette edges, half a pixel apart: pixels from the picture's centre.
fn visible_silhouettes(mesh: &Mesh, plan: &DrawPlan<'_>) -> Vec<[f64; 2]> {
    let row = |row: &[f32; 4], p: [f32; 3]| {
        (0..3).map(|k| f64::from(row[k]) * f64::from(p[k])).sum::<f64>() + f64::from(row[3])
    };
    // X and y in pixels, and reversed depth: what is straight stays straight.
    let at: Vec<[f64; 3]> = mesh
        .positions
        .iter()
        .map(|&p| {
            let w = row(&plan.projection.w, p);
            [
                row(&plan.projection.x, p) / w / 256.0,
                row(&plan.projection.y, p) / w / 256.0,
                row(&plan.projection.z, p) / w,
            ]
        })
        .collect();
    let mut sides: HashMap<[u32; 2], Vec<f64>> = HashMap::new();
    for triangle in &mesh.triangles {
        for k in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|j| triangle[(k + j) % 3]);
            let [from, to] = if a < b { [a, b] } else { [b, a] };
            sides.entry([from, to]).or_default().push(side(at[from as usize], at[to as usize], at[c as usize]));
        }
    }
    let mut points = Vec::new();
    for ([a, b], sides) in sides {
        if sides.iter().any(|s| *s > 0.0) && sides.iter().any(|s| *s < 0.0) {
            continue;
        }
        let [a, b] = [at[a as usize], at[b as usize]];
        let steps = (2.0 * (b[0] - a[0]).hypot(b[1] - a[1])).ceil().max(1.0);
        for i in 0..=steps as usize {
            let t = i as f64 / steps;
            let p: [f64; 3] = std::array::from_fn(|k| a[k] + t * (b[k] - a[k]));
            if !mesh.triangles.iter().any(|face| hides(face.map(|v| at[v as usize]), p)) {
                points.push([p[0], p[1]]);
            }
        }
    }
    points
}

/// Twice the area of a triangle on screen.
fn side(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// True if a face lies in front of a point, and not just at its side.
fn hides([a, b, c]: [[f64; 3]; 3], p: [f64; 3]) -> bool {
    let area = side(a, b, c);
    if area.abs() < 1e-9 {
        return false;
    }
    let shares = [side(b, c, p), side(c, a, p), side(a, b, p)].map(|s| s / area);
    let depth = shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2];
    shares.iter().all(|share| *share >= -1e-9) && depth > p[2] * (1.0 + 1e-5) + 1e-7
}

fn any_box(random: &mut Random, within: f64, size: [f64; 2]) -> [[f64; 3]; 2] {
    let low: [f64; 3] = std::array::from_fn(|_| random.range(-within, within));
    let high = low.map(|v| (v + random.range(size[0], size[1])).min(within));
    [low.map(|v| v.min(within - 0.02)), high]
}

/// A closed box with boxes and balls in it, some of them closely under its walls.
fn things_in_a_box(random: &mut Random) -> String {
    let mut obj = Obj::default();
    obj.cuboid([-1.0, -0.6, -0.8], [1.0, 0.6, 0.8]);
    for _ in 0..4 {
        let [low, high] = any_box(random, 0.55, [0.1, 0.8]);
        obj.cuboid(low, high);
    }
    let x = random.range(-0.7, 0.7);
    obj.ball([x, 0.38, 0.0], 0.21, 16);
    obj.finish()
}

/// A solid box, and beams that end inside of it or go through it.
fn beams(random: &mut Random) -> String {
    let mut obj = Obj::default();
    obj.cuboid([-0.5; 3], [0.5; 3]);
    for axis in 0..3 {
        let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
        for k in 0..3 {
            low[k] = random.range(-0.45, 0.2);
            high[k] = low[k] + random.range(0.05, 0.25);
        }
        low[axis] = random.range(-0.48, 0.3);
        high[axis] = random.range(0.4, 1.2);
        obj.cuboid(low, high);
    }
    obj.finish()
}

/// Unit cubes, of which those beside each other share faces.
fn voxels(random: &mut Random) -> String {
    let mut obj = Obj::default();
    let mut is_full = [false; 27];
    is_full.iter_mut().for_each(|full| *full = random.range(0.0, 1.0) < 0.5);
    is_full[13] = true;
    let is_at = |p: [i32; 3]| p.iter().all(|v| (0..3).contains(v)) && is_full[(p[0] + 3 * p[1] + 9 * p[2]) as usize];
    let corners: Vec<usize> =
        (0..64).map(|i| obj.vertex([i % 4, i / 4 % 4, i / 16].map(|v| f64::from(v) - 1.5))).collect();
    for i in 0..27_i32 {
        let cell = [i % 3, i / 3 % 3, i / 9];
        for (axis, up) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]).filter(|_| is_at(cell)) {
            let mut beside = cell;
            beside[axis] += 2 * up - 1;
            if is_at(beside) {
                continue;
            }
            let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                let mut p = cell;
                p[axis] += up;
                p[(axis + 1) % 3] += u;
                p[(axis + 2) % 3] += v;
                corners[(p[0] + 4 * p[1] + 16 * p[2]) as usize]
            });
            if up == 0 {
                quad.reverse();
            }
            obj.face(&quad);
        }
    }
    obj.finish()
}

/// Thick rings around and through each other, and a ball.
fn rings(random: &mut Random) -> String {
    let mut obj = Obj::default();
    for _ in 0..2 {
        let centre: [f64; 3] = std::array::from_fn(|_| random.range(-0.5, 0.5));
        let (radius, thick, turn) = (random.range(0.5, 0.9), random.range(0.15, 0.4), random.range(0.0, 3.0));
        obj.grid([20, 12], [true, true], |u, v| {
            let (a, b) = (u * std::f64::consts::TAU, v * std::f64::consts::TAU);
            let r = radius + thick * b.cos();
            let [x, y, z] = [r * a.cos(), thick * b.sin(), -r * a.sin()];
            let (sin, cos) = turn.sin_cos();
            [centre[0] + x, centre[1] + cos * y - sin * z, centre[2] + sin * y + cos * z]
        });
    }
    obj.ball([0.0; 3], 0.5, 20);
    obj.finish()
}
