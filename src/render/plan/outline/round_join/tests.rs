//! Tests of round joins, the corners of outlines.

use std::f64::consts::PI;

use super::*;
use crate::limits::Limits;

/// Two edges that leave a vertex at these angles, with nothing between the first and the second.
fn corner(vertex: u32, angles: [f64; 2], reach_px: f64) -> [EdgeEnd; 2] {
    [1, -1].map(|free| EdgeEnd {
        vertex,
        outer: Some(7),
        material: 0,
        free,
        angle: angles[usize::from(free < 0)],
        turn: FRAC_PI_2,
        middle: [0.0; 2],
        reach: 256.0 * reach_px,
        depth: 0.5,
        inv_w: 1.0,
        slope: 0.0,
        is_hidden: false,
    })
}

const SIZE_PX: [u32; 2] = [1000, 800];

fn joins(ends: Vec<EdgeEnd>, size_px: [u32; 2]) -> RoundJoins {
    RoundJoins { ends, ..RoundJoins::with_capacity(0, size_px) }
}

fn finish(ends: Vec<EdgeEnd>, size_px: [u32; 2]) -> (HullPass<'static>, Result<(), PlanError>) {
    let mut hull = HullPass::default();
    let (mut budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    let mut joins = joins(ends, size_px);
    joins.sort(&deadline).unwrap();
    let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
    let result = joins.draw(&HiddenDirections::default(), 10, &mut hull, &mut cx);
    let exact = [hull.vertices.capacity(), hull.triangles.capacity()];
    assert_eq!(exact, [hull.vertices.len(), hull.triangles.len()], "room for what there is");
    (hull, result)
}

/// The sum of the angles of all joins.
fn swept(ends: Vec<EdgeEnd>) -> f64 {
    let mut joins = joins(ends, SIZE_PX);
    let (mut sum, deadline) = (0.0, Deadline::default());
    joins.sort(&deadline).unwrap();
    each_join(&joins.ends, &HiddenDirections::default(), &deadline, |join| sum += join.angle()).unwrap();
    sum
}

#[test]
fn joins_fill_what_offset_quads_leave() {
    let near = |got: f64, want: f64| assert!((got - want).abs() < 1e-6, "{got}, not {want}");
    // A corner of a square, where three quarters of a turn are free; one that turns inwards; a
    // needle, and one that is rounded flat.
    near(swept(corner(0, [0.0, 1.5 * PI], 4.0).into()), FRAC_PI_2);
    near(swept(corner(0, [3.0, 3.0 + 1.5 * PI - TAU], 4.0).into()), FRAC_PI_2);
    near(swept(corner(0, [0.0, FRAC_PI_2], 4.0).into()), 0.0);
    near(swept(corner(0, [0.001, 0.0], 4.0).into()), PI - 0.001);
    near(swept(corner(0, [1.0, 1.0], 4.0).into()), PI);
    near(swept(corner(0, [1.0, 1.0 + 1e-15], 4.0).into()), PI);
    // An end that meets none, and an edge with both sides free.
    near(swept(corner(0, [1.0, 1.0], 4.0)[..1].to_vec()), FRAC_PI_2);
    // Two squares that touch at a corner.
    let two = [corner(0, [FRAC_PI_2, PI], 4.0), corner(0, [1.5 * PI, 2.0 * PI], 4.0)].concat();
    near(swept(two), 0.0);
}

/// A face that covers most of a join of a quarter of a turn leaves its two borders, if one of the
/// two edges is hidden.
#[test]
fn faces_cut_joins_beside_edges_that_they_hide() {
    let hidden = HiddenDirections::of_one(0, [FRAC_PI_2 + 0.2, PI - 0.3]);
    let deadline = Deadline::default();
    for (is_hidden, want) in
        [([false, false], vec![FRAC_PI_2]), ([true, false], vec![0.2, 0.3]), ([false, true], vec![0.2, 0.3])]
    {
        let mut ends = corner(0, [0.0, 1.5 * PI], 4.0);
        (0..2).for_each(|k| ends[k].is_hidden = is_hidden[k]);
        let mut angles = Vec::new();
        each_join(&ends, &hidden, &deadline, |join| angles.push(join.angle())).unwrap();
        let is_near = angles.len() == want.len() && angles.iter().zip(&want).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(is_near, "{angles:?}, not {want:?}");
    }
}

#[test]
fn however_many_corners_there_are_their_joins_are_bounded() {
    let (few, result) = finish(corner(0, [0.0, 1.5 * PI], 32.0).into(), SIZE_PX);
    result.unwrap();
    assert!((20..40).contains(&few.triangles.len()), "{}", few.triangles.len());
    let count = 100_000;
    for (size_px, more) in [(SIZE_PX, TRIANGLES_MAX), ([100, 50], 80_000.0)] {
        let ends: Vec<EdgeEnd> = (0..count).flat_map(|v| corner(v, [0.0, 1.5 * PI], 32.0)).collect();
        let (many, result) = finish(ends, size_px);
        result.unwrap();
        let triangles = many.triangles.len();
        let range = count as usize..more as usize + 3 * count as usize + 1;
        assert!(range.contains(&triangles) && triangles as f64 > 0.5 * more, "{triangles}");
        assert_eq!(many.triangle_materials.len(), triangles);
    }
}

#[test]
fn joins_end_when_the_job_does() {
    let ends: Vec<EdgeEnd> = (0..1000).flat_map(|v| corner(v, [0.0, 1.5 * PI], 32.0)).collect();
    let (mut hull, mut budget, deadline) = (HullPass::default(), Budget::new(&Limits::default()), Deadline::default());
    deadline.stop();
    let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
    let result = joins(ends, SIZE_PX).draw(&HiddenDirections::default(), 10, &mut hull, &mut cx);
    assert!(matches!(result, Err(PlanError::Stopped(_))), "{result:?}");
    assert!(hull.triangles.is_empty());
}
