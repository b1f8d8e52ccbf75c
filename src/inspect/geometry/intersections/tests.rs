//! Tests of the search for intersections: contacts of faces whose number is known, fans (many faces around one
//! vertex), the limit of memory, the deadline, and equal results with any number of threads.

use super::*;
use meshsnap_render::limits::Limits;

fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
    Mesh { positions: positions.to_vec(), triangles: triangles.to_vec(), ..Mesh::default() }
}

#[track_caller]
fn found(mesh: &Mesh) -> (Vec<u32>, Option<u64>) {
    let (budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    let faces = self_intersections(mesh, &budget, &deadline).unwrap().unwrap();
    (faces, t_junctions(mesh, &budget, &deadline).unwrap())
}

/// A triangle in the plane z = 0, and one with these corners, which shares vertices with it where corners are equal.
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
    let small = Budget::new(&Limits::default().with(|limits| limits.memory_bytes = 1000));
    assert!(matches!(self_intersections(&pile, &small, &Deadline::default()), Err(Exhausted::Limit(_))));
    assert!(matches!(t_junctions(&pile, &small, &Deadline::default()), Err(Exhausted::Limit(_))));
    assert_eq!(found(&Mesh::default()), (vec![], Some(0)));
}

/// Faces around one vertex: a wheel whose rim is a zigzag, so that no two of them lie in one plane.
fn wheel(spokes: u32) -> Mesh {
    let mut wheel = mesh(&[[0.0; 3]], &[]);
    for i in 0..spokes {
        let angle = f64::from(i) / f64::from(spokes) * std::f64::consts::TAU;
        let height = if i % 2 == 0 { 0.01 } else { -0.01 };
        wheel.positions.push([(0.5 * libm::cos(angle)) as f32, (0.5 * libm::sin(angle)) as f32, height]);
        wheel.triangles.push([0, 1 + i, 1 + (i + 1) % spokes]);
    }
    wheel
}

#[test]
fn a_fan_of_many_faces_takes_time_by_their_number() {
    let (budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    let mut wheel = wheel(100_000);
    let tree = Tree::of(&wheel, &mut budget.clone(), &deadline).unwrap();
    let fans = Fans::of(&wheel, &tree, &mut budget.clone(), &deadline).unwrap();
    assert_eq!((fans.trees.len(), fans.trees[0].len()), (1, 100_000));
    let pairs = |search: Search<'_>| search.estimate().unwrap() / 100_000.0;
    let around = pairs(Search { mesh: &wheel, tree: &tree, fans: Some(&fans), deadline: &deadline });
    let of_fan = pairs(Search { mesh: &wheel, tree: &fans.trees[0], fans: None, deadline: &deadline });
    assert!(around < 1.0 && of_fan < 32.0, "{around} and {of_fan} pairs for each face");
    assert!(found(&wheel).0.is_empty());
    // A face of the same fan that lies across some of the others, and one beside the fan that cuts through it.
    let across = 100_000;
    wheel.triangles.push([0, 1, 1 + 11]);
    let last = wheel.positions.len() as u32;
    wheel.positions.extend([[-0.3, 0.0, 0.1], [-0.3, 0.001, 0.1], [-0.3, 0.0, -0.1]]);
    wheel.triangles.push([last, last + 1, last + 2]);
    let faces = found(&wheel).0;
    assert!(faces.ends_with(&[across, across + 1]), "{faces:?}");
    assert!(faces.contains(&5) && faces.iter().any(|face| face.abs_diff(50_000) < 100), "{faces:?}");
    assert!(faces.len() < 200, "{}", faces.len());
}

#[test]
fn fans_have_the_intersections_that_are_found_without_them() {
    let (budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut number = |range: u32| {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 33) as u32 % range
    };
    let (mut met, mut fans_met) = (0, 0);
    for _ in 0..60 {
        // Few places, so that much lies in one plane or on one line; and a hub with faces for a fan.
        let points = 24;
        let mut one = Mesh::default();
        for _ in 0..points {
            one.positions.push([0; 3].map(|_| number(9) as f32 / 16.0 - 0.25));
        }
        for i in 0..110 {
            let hub = if i < 90 { 0 } else { number(points) };
            one.triangles.push([hub, number(points), number(points)]);
        }
        let mut expected = vec![false; one.triangles.len()];
        let tree = Tree::of(&one, &mut budget.clone(), &deadline).unwrap();
        fans_met += Fans::of(&one, &tree, &mut budget.clone(), &deadline).unwrap().trees.len();
        let position = |vertex: u32| one.positions[vertex as usize].map(f64::from);
        let with_area = |face: usize| pair::has_area(one.triangles[face].map(position));
        for a in (0..one.triangles.len()).filter(|face| with_area(*face)) {
            for b in (0..a).filter(|face| with_area(*face)) {
                if pair::intersect(one.triangles[a], one.triangles[b], false, position) {
                    (expected[a], expected[b]) = (true, true);
                    met += 1;
                }
            }
        }
        let expected: Vec<u32> = (0..expected.len() as u32).filter(|face| expected[*face as usize]).collect();
        assert_eq!(found(&one).0, expected);
    }
    assert!(met > 1000 && fans_met >= 30, "{met} pairs, {fans_met} fans");
}

#[test]
fn pages_of_one_book_are_not_compared_for_ever() {
    // Faces with a common edge: every pair has boxes and directions in common.
    let mut book = mesh(&[[0.0, 0.0, -0.25], [0.0, 0.0, 0.25]], &[]);
    for i in 0..30_000_u32 {
        let angle = f64::from(i) / 30_000.0 * std::f64::consts::TAU;
        book.positions.push([(0.5 * libm::cos(angle)) as f32, (0.5 * libm::sin(angle)) as f32, 0.0]);
        book.triangles.push([0, 1, 2 + i]);
    }
    let (budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    assert!(self_intersections(&book, &budget, &deadline).unwrap().is_none());
}
