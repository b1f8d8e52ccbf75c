//! Tests of the directions around a vertex that its faces cover.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;

fn hidden(arcs: &[[f64; 2]]) -> HiddenDirections {
    HiddenDirections { arcs: arcs.iter().map(|&[from, to]| Arc { vertex: 3, from, to, slope: [0.0; 2] }).collect() }
}

fn gaps(arcs: &[[f64; 2]], range: [f64; 2]) -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    hidden(arcs).gaps(3, range, |gap| found.push(gap));
    found
}

#[test]
fn directions_without_a_face_are_free() {
    assert_eq!(gaps(&[], [1.0, 5.0]), [[1.0, 5.0]]);
    let two = [[0.5, 1.0], [2.0, 3.0]];
    assert_eq!(gaps(&two, [0.0, 4.0]), [[0.0, 0.5], [1.0, 2.0], [3.0, 4.0]]);
    assert_eq!(gaps(&two, [0.75, 2.5]), [[1.0, 2.0]]);
    assert_eq!(gaps(&two, [1.0, 2.0]), [[1.0, 2.0]]);
    assert_eq!(gaps(&two, [2.0, 3.0]), [[0.0; 2]; 0]);
    // Past a whole turn.
    assert_eq!(gaps(&two, [2.5, TAU + 0.75]), [[3.0, TAU + 0.5]]);
    assert_eq!(gaps(&two, [4.0, TAU + 4.0]), [[4.0, TAU + 0.5], [TAU + 1.0, TAU + 2.0], [TAU + 3.0, TAU + 4.0]]);
    assert_eq!(gaps(&[[0.0, TAU]], [1.0, 6.0]), [[0.0; 2]; 0]);
    // Another vertex's faces do not count.
    let mut found = Vec::new();
    hidden(&two).gaps(2, [0.0, 4.0], |gap| found.push(gap));
    assert_eq!(found, [[0.0, 4.0]]);
}

#[test]
fn angles_are_within_a_turn() {
    for (angle, want) in [(-FRAC_PI_2, 1.5 * PI), (1.0, 1.0), (-3.0 * PI, PI), (5.0 * PI, PI)] {
        assert!((wrapped(angle) - want).abs() < 1e-12);
    }
}

#[test]
fn an_end_is_hidden_by_what_is_nearer_in_its_direction() {
    let end = |angle: f64, slope: f64| EdgeEnd { angle, slope, ..EdgeEnd::default() };
    // Nearer to the right, by 2 each unit.
    let face = Arc { vertex: 3, from: 0.0, to: FRAC_PI_2, slope: [2.0, 0.0] };
    let cases = [
        (0.5, 1.0, true),
        (0.5, 2.0, false),
        (1.5, 1.0, false),
        (0.0, 1.0, true),
        // Along its side, as deep: its own.
        (0.0, 2.0, false),
        (2.0, -9.0, false),
        (-0.5, 1.0, false),
        (0.5 - TAU, 1.0, true),
        (TAU, 1.0, true),
        (-1e-20, 1.0, true),
    ];
    for (angle, slope, is_hidden) in cases {
        assert_eq!(face.hides(&end(angle, slope)), is_hidden, "{angle} {slope}");
    }
}
