//! Contacts whose numbers are known, the budget, the deadline, and threads.

use super::*;
use crate::limits::Limits;

fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
    Mesh { positions: positions.to_vec(), triangles: triangles.to_vec(), ..Mesh::default() }
}

#[track_caller]
fn found(mesh: &Mesh) -> (Vec<u32>, Option<u64>) {
    let (budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    let faces = self_intersections(mesh, &budget, &deadline).unwrap();
    (faces, t_junctions(mesh, &budget, &deadline).unwrap())
}

/// A flat triangle, and another one with these corners.
fn with(corners: [[f32; 3]; 3]) -> Mesh {
    let flat = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]];
    let mut positions = flat.to_vec();
    let own = corners.map(|corner| {
        flat.iter().position(|known| *known == corner).unwrap_or_else(|| {
            positions.push(corner);
            positions.len() - 1
        }) as u32
    });
    mesh(&positions, &[[0, 1, 2], own])
}

#[test]
fn contacts_that_count_and_contacts_that_do_not() {
    let (o, x, y) = ([0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]);
    let inside = [0.125, 0.125, 0.0];
    let above = |[x, y, z]: [f32; 3]| [x, y, z + 0.25];
    let half = [0.25, 0.0, 0.0];
    let cases = [
        ("through the middle", [above(inside), [0.125, 0.125, -0.25], [-0.5, -0.5, 0.0]], true, 0),
        ("a corner on the face", [inside, above(o), above(x)], true, 0),
        ("a corner on an edge", [half, above(o), above(x)], true, 1),
        ("an edge on a part of an edge", [half, [0.75, 0.0, 0.0], above(x)], true, 2),
        ("inside in the same plane", [inside, [0.25, 0.125, 0.0], [0.125, 0.25, 0.0]], true, 0),
        ("the same edge and plane, same side", [o, x, [0.25, 0.5, 0.0]], true, 0),
        ("the same edge and plane, other side", [o, x, [0.25, -0.5, 0.0]], false, 0),
        ("the same edge, another plane", [o, x, above(inside)], false, 0),
        ("the same corner", [o, [-0.25, -0.25, 0.0], above(o)], false, 0),
        ("the same corner, and through the face", [o, [0.25, 0.25, 0.25], [0.25, 0.25, -0.25]], true, 0),
        ("the same corner, and along an edge", [o, half, above(o)], true, 1),
        ("the same face", [y, x, o], false, 0),
        ("beside it", [above(o), above(x), above(y)], false, 0),
        ("no area", [inside, [0.25, 0.125, 0.0], [0.1875, 0.125, 0.0]], false, 0),
    ];
    for (name, corners, is_met, junctions) in cases {
        let expected = if is_met { vec![0, 1] } else { vec![] };
        assert_eq!(found(&with(corners)), (expected, Some(junctions)), "{name}");
    }
}

/// A deep pile of triangles that all intersect, and as many beside it that do not.
fn pile() -> Mesh {
    let mut pile = Mesh::default();
    for i in 0..3000_u32 {
        let turn = i as f32 * 0.002;
        let at = |a: f32, b: f32, z: f32| [0.25 * a - 0.2, 0.25 * b, z];
        pile.positions.extend([at(-1.0, turn - 3.0, 0.1), at(1.0, 3.0 - turn, 0.0), at(turn - 3.0, 1.0, 0.2)]);
        let z = -0.5 + i as f32 / 8192.0;
        pile.positions.extend([[0.3, 0.3, z], [0.4, 0.3, z], [0.3, 0.4, z]]);
        pile.triangles.extend([[6 * i, 6 * i + 1, 6 * i + 2], [6 * i + 3, 6 * i + 4, 6 * i + 5]]);
    }
    pile
}

#[test]
fn threads_change_nothing() {
    let pile = pile();
    let (faces, junctions) = found(&pile);
    // Too deep a pile to look for vertices on all edges.
    assert_eq!(junctions, None);
    assert!(faces.len() > 2900 && faces.iter().all(|face| face % 2 == 0), "{}", faces.len());
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(|| found(&pile)) == (faces.clone(), junctions), "{threads}");
    }
}

#[test]
fn it_stops_and_it_is_refused() {
    let pile = pile();
    let budget = Budget::new(&Limits::default());
    let stopped = |polls| {
        let deadline = Deadline::after_polls(polls);
        let stopped = self_intersections(&pile, &budget, &deadline).is_err();
        (stopped, t_junctions(&pile, &budget, &Deadline::after_polls(polls)).is_err())
    };
    for polls in [1, 3, 100, 500] {
        assert_eq!(stopped(polls), (true, true), "{polls}");
    }
    let small = Budget::new(&Limits { memory_bytes: 1000, ..Limits::default() });
    assert!(matches!(self_intersections(&pile, &small, &Deadline::default()), Err(Exhausted::Limit(_))));
    assert!(matches!(t_junctions(&pile, &small, &Deadline::default()), Err(Exhausted::Limit(_))));
    assert_eq!(found(&Mesh::default()), (vec![], Some(0)));
}
