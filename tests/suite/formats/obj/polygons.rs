//! Polygons are cut into triangles that cover them, and keep their outline.

use crate::support::files::mesh::read;
use crate::support::files::same::edges;

/// The area of the triangles, and that none runs against the polygon, tell that a polygon was cut
/// rightly.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn concave_polygons_are_cut_inside() {
    let comb = |teeth: u32| {
        let mut outline = vec![[0.0, 0.0], [f64::from(2 * teeth), 0.0]];
        for i in (0..2 * teeth).rev() {
            outline.push([f64::from(i) + 0.5, if i % 2 == 0 { 3.0 } else { 1.0 }]);
        }
        outline
    };
    let star = |n: u32| -> Vec<[f64; 2]> {
        (0..2 * n)
            .map(|i| {
                let (r, a) = (if i % 2 == 0 { 2.0 } else { 0.5 }, f64::from(i) * std::f64::consts::PI / f64::from(n));
                [r * libm::cos(a), r * libm::sin(a)]
            })
            .collect()
    };
    let shapes: Vec<Vec<[f64; 2]>> = vec![
        vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]],
        vec![[0.0, 0.0], [2.0, 2.0], [4.0, 0.0], [2.0, 1.0 / 8.0]], // a quad with a reflex corner: one diagonal is wrong
        vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0]], // corners in line
        vec![
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ],
        comb(3),
        comb(20),
        star(5),
        star(101),
    ];
    let mut cases = 0;
    for outline in &shapes {
        let n = outline.len();
        let signed: f64 = (0..n)
            .map(|i| outline[i][0] * outline[(i + 1) % n][1] - outline[(i + 1) % n][0] * outline[i][1])
            .sum::<f64>();
        for axis in 0..3 {
            for reversed in [false, true] {
                let mut obj = String::new();
                for p in outline {
                    let mut q = [0.25; 3];
                    (q[axis], q[(axis + 1) % 3]) = (p[0], p[1]);
                    obj += &format!("v {} {} {}\n", q[0], q[1], q[2]);
                }
                let order: Vec<usize> = if reversed { (1..=n).rev().collect() } else { (1..=n).collect() };
                obj += &format!("f {}\n", order.iter().map(usize::to_string).collect::<Vec<_>>().join(" "));
                let mesh = read(obj.as_bytes()).unwrap();
                let normal_axis = (axis + 2) % 3;
                let sign = if reversed { -signed.signum() } else { signed.signum() };
                let mut area = 0.0;
                for (t, normal) in mesh.triangles.iter().zip(&mesh.face_normals) {
                    assert_eq!(f64::from(normal[normal_axis]), sign, "{outline:?}");
                    let p = t.map(|v| mesh.positions[v as usize].map(f64::from));
                    let (u, v) = (axis, (axis + 1) % 3);
                    area += (p[1][u] - p[0][u]) * (p[2][v] - p[0][v]) - (p[1][v] - p[0][v]) * (p[2][u] - p[0][u]);
                }
                let area = area * mesh.to_file.scale * mesh.to_file.scale;
                assert!((area.abs() - signed.abs()).abs() < 1e-5 * signed.abs(), "{area} {signed} {outline:?}");
                // Every corner is joined to the next by an edge that is drawn.
                let drawn = edges(&mesh).iter().filter(|e| e.is_polygon_edge).count();
                let bridges = usize::from(n == 10 && outline[0] == outline[4]);
                assert_eq!(drawn, n - bridges, "{outline:?}");
                cases += 1;
            }
        }
    }
    assert_eq!(cases, shapes.len() * 6);
}

#[test]
fn convex_quads_are_cut_along_the_shorter_diagonal() {
    let quad = |first: usize| {
        let corners = [[0.0, 0.0], [3.0, 0.0], [4.0, 1.0], [1.0, 1.0]];
        let mut obj = String::new();
        for k in 0..4 {
            let p = corners[(first + k) % 4];
            obj += &format!("v {} {} 0\n", p[0], p[1]);
        }
        read((obj + "f 1 2 3 4\n").as_bytes()).unwrap()
    };
    for first in 0..4 {
        let mesh = quad(first);
        let hidden = edges(&mesh).iter().find(|e| !e.is_polygon_edge).unwrap();
        let [a, b] = hidden.vertices.map(|v| mesh.positions[v as usize]);
        assert_eq!((a[0] - b[0]).abs() * 4.0, 2.0, "from (3, 0) to (1, 1)");
    }
}

/// Its two halves cancel out, so that it has no normal of its own; it is not nothing.
#[test]
fn polygons_that_cross_themselves_are_drawn() {
    let points = "v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nv 3 0 0\n";
    let bow = read(format!("{points}f 1 2 3 4\n").as_bytes()).unwrap();
    assert_eq!((bow.triangles.len(), bow.report.dropped_degenerate_faces), (2, 0));
    assert_eq!(bow.edge_masks, [0b011, 0b110]);
    // On one line there is nothing to draw, and that is one face.
    let line = read(format!("{points}f 1 3 6 5\nf 1 2 3\n").as_bytes()).unwrap();
    assert_eq!((line.triangles.len(), line.report.dropped_degenerate_faces), (1, 1));
}
