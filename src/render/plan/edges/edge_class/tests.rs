//! Tests of the classes of edges: which edges of small meshes belong to each.

use super::*;
use crate::limits::Budget;
use crate::limits::{Deadline, Limits};
use crate::mesh::edges::EdgeList;

/// Numbers of edges that are feature, crease (both at 30 degrees), boundary and non-manifold.
fn counts(obj: &str) -> [usize; 4] {
    let limits = Limits::default();
    let mut budget = Budget::new(&limits);
    let bundle = crate::import::Bundle::of_one(obj.as_bytes().to_vec());
    let mesh = crate::import::import(&bundle, None, &limits, &mut budget, &Deadline::default()).unwrap().0;
    let list = EdgeList::of(&mesh, &mut budget).unwrap();
    let limit = sharp_cos(30.0);
    [Class::Feature(limit), Class::Crease(limit), Class::Boundary, Class::Nonmanifold]
        .map(|class| list.iter().filter(|edge| belongs_to(class, &mesh, edge)).count())
}

#[test]
fn classes_of_edges() {
    let cube = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n\
                f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    // No diagonal bends.
    assert_eq!(counts(cube), [12, 12, 0, 0]);
    let one_inside_out = cube.replace("f 2 4 8 6", "f 6 8 4 2");
    assert_eq!(counts(&one_inside_out), [12, 12, 0, 4], "wound alike");
    let fin = "v 0 0 0\nv 0 1 0\nv 1 0 .2\nv 1 1 .2\nv -1 0 .4\nv -1 1 .4\nv .2 0 -1\nv .2 1 -1\n\
               f 1 2 4 3\nf 1 2 6 5\nf 1 2 8 7\n";
    assert_eq!(counts(fin), [10, 0, 9, 1]);
    // Folded by 20 degrees and by 40, one wing a sliver of 1 to 100,000.
    let fold = |degrees: f64| {
        let (y, z) = (libm::cos(degrees.to_radians()), libm::sin(degrees.to_radians()));
        format!("v 0 0 0\nv 1 0 0\nv .5 -1e-5 0\nv .5 {y} {z}\nf 2 1 3\nf 1 2 4\n")
    };
    assert_eq!(counts(&fold(20.0)), [4, 0, 4, 0]);
    assert_eq!(counts(&fold(40.0)), [5, 1, 4, 0]);
}

#[test]
fn a_strip_with_half_a_twist_has_one_seam_of_inconsistent_winding() {
    use std::fmt::Write;
    const N: usize = 24;
    let mut obj = String::new();
    for i in 0..N {
        let turn = i as f64 / N as f64 * std::f64::consts::TAU;
        for side in [-0.1, 0.1] {
            let r = 1.0 + side * libm::cos(0.5 * turn);
            let height = side * libm::sin(0.5 * turn);
            writeln!(obj, "v {} {} {height}", r * libm::cos(turn), r * libm::sin(turn)).unwrap();
        }
    }
    for i in 0..N {
        let (a, b) = (2 * i + 1, 2 * i + 2);
        // At the seam the sides change places.
        let (c, d) = if i + 1 < N { (a + 2, b + 2) } else { (2, 1) };
        writeln!(obj, "f {a} {c} {d} {b}").unwrap();
    }
    let [_, crease, boundary, nonmanifold] = counts(&obj);
    assert_eq!((crease, boundary, nonmanifold), (0, 2 * N, 1));
}
