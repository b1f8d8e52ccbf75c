//! Warns of coarse positions: f32 far from the origin.

use super::pow2::{is_usable, max_abs};
use crate::import::raw::RawMesh;
use crate::warning::Warning;

/// A mesh fewer steps across than this shows them: half a step is a quarter of a pixel in a picture
/// of 1024 pixels.
const STEPS_MIN: f64 = 2048.0;

/// A warning if the file stores f32 that are far apart for the size of the mesh. Not for positions
/// that a transform changed: they are most likely fine near their own origin.
pub fn warning(raw: &RawMesh) -> Option<Warning> {
    if !raw.is_f32 {
        return None;
    }
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for triangle in &raw.triangles {
        let corners = triangle.map(|v| &raw.positions[v as usize]);
        if !corners.iter().all(|p| is_usable(p)) {
            continue;
        }
        for p in corners {
            if p.iter().any(|&c| f64::from(c as f32) != c) {
                return None;
            }
            for k in 0..3 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
    }
    let farthest = max_abs(&low).max(max_abs(&high)) as f32;
    let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    // Infinite if there is no triangle.
    if !farthest.is_finite() {
        return None;
    }
    let step = f64::from(farthest) - f64::from(farthest.next_down());
    (step * STEPS_MIN > size && farthest > 0.0).then(|| Warning {
        code: "positions_coarse",
        detail: format!(
            "f32 positions near {} are {} units apart, too coarse for a mesh that is {} across: move it towards the origin, \
             or write it with f64",
            tidy(f64::from(farthest)),
            tidy(step),
            tidy(size)
        ),
    })
}

/// Short: `1e9`, `64`, `0.0078125`.
fn tidy(v: f64) -> String {
    if (1e-5..1e6).contains(&v) || v == 0.0 { format!("{}", v as f32) } else { format!("{v:.0e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(at: f64, side: f64) -> RawMesh {
        let corner = |i: u32| [0, 1, 2].map(|k| at + side * f64::from(i >> k & 1));
        RawMesh {
            positions: (0..8).map(corner).collect(),
            triangles: vec![[0, 1, 2], [3, 5, 6], [1, 4, 7]],
            is_f32: true,
            ..RawMesh::default()
        }
    }

    #[test]
    fn only_steps_that_show_are_worth_a_word() {
        let f32s = |raw: RawMesh| RawMesh {
            positions: raw.positions.iter().map(|p| p.map(|c| f64::from(c as f32))).collect(),
            ..raw
        };
        let detail = |raw: &RawMesh| warning(raw).map(|w| w.detail);
        let far = detail(&f32s(cube(1e9, 2.0))).unwrap();
        assert!(
            far.starts_with("f32 positions near 1e9 are 64 units apart, too coarse for a mesh that is 0 across"),
            "{far}"
        );
        let far = detail(&f32s(cube(1e9, 1280.0))).unwrap();
        assert!(far.contains("that is 1280 across"), "{far}");
        let near = detail(&f32s(cube(-65_536.5, 2.0))).unwrap();
        assert!(near.starts_with("f32 positions near 65536.5 are 0.0078125 units apart"), "{near}");
        // No warning: whole numbers in f64, moved f32, a large enough mesh, and one near the
        // origin.
        let whole = RawMesh { is_f32: false, ..cube(1e5, 2.0) };
        for fine in [whole, cube(1e9 + 0.5, 2.0), f32s(cube(1e9, 2e5)), f32s(cube(1e3, 2.0)), f32s(cube(0.0, 1e-30))] {
            assert_eq!(warning(&fine), None);
        }
        assert_eq!(warning(&RawMesh::default()), None);
        assert_eq!(
            warning(&RawMesh { triangles: vec![[0; 3]], positions: vec![[f64::NAN; 3]], ..RawMesh::default() }),
            None
        );
    }
}
