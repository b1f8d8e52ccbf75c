//! The warning `positions_coarse`: the file stores positions as f32, and so far from the origin
//! that neighbouring f32 values are too far apart for the size of the mesh.

use super::faces::Bounds;
use crate::warning::Warning;

/// A mesh fewer steps across than this shows them: half a step is a quarter of a pixel in a picture
/// of 1024 pixels.
const STEPS_MIN: f64 = 2048.0;

/// A warning if positions of a file that stores f32 are far apart for the size of the mesh; `bounds`
/// are those of its usable triangles. Not for positions that a transform changed: they are most
/// likely fine near their own origin.
pub fn warning(bounds: &Bounds) -> Option<Warning> {
    let Bounds { low, high } = bounds;
    let farthest = bounds.largest() as f32;
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
    use crate::limits::Deadline;

    /// A cube with f32 coordinates.
    fn cube(at: f64, side: f64) -> Bounds {
        let f32 = |c: f64| f64::from(c as f32);
        Bounds { low: [f32(at); 3], high: [f32(at + side); 3] }
    }

    #[test]
    fn only_steps_that_show_are_worth_a_word() {
        let detail = |bounds: Bounds| warning(&bounds).map(|w| w.detail);
        let far = detail(cube(1e9, 2.0)).unwrap();
        assert!(
            far.starts_with("f32 positions near 1e9 are 64 units apart, too coarse for a mesh that is 0 across"),
            "{far}"
        );
        let far = detail(cube(1e9, 1280.0)).unwrap();
        assert!(far.contains("that is 1280 across"), "{far}");
        let near = detail(cube(-65_536.5, 2.0)).unwrap();
        assert!(near.starts_with("f32 positions near 65536.5 are 0.0078125 units apart"), "{near}");
        // No warning: a large enough mesh, and one near the origin.
        for fine in [cube(1e9, 2e5), cube(1e3, 2.0), cube(0.0, 1e-30), Bounds::EMPTY] {
            assert_eq!(warning(&fine), None);
        }
    }

    #[test]
    fn only_coordinates_of_f32_are_called_coarse() {
        use crate::import::normalise::faces::{have_f32, pick, survey};
        use crate::import::normalise::geometry::Indexed;
        let triangles = [[0, 1, 2], [0, 1, 3]];
        let check = |x: f64| {
            let positions = [[1e9, 0.0, 0.0], [x, 0.0, 0.0], [1e9, 64.0, 0.0], [f64::NAN; 3]];
            let geometry = Indexed { positions: positions.to_vec(), triangles: triangles.to_vec(), is_usable: false };
            let usable = pick(&geometry, None, &Deadline::default()).unwrap().usable;
            (
                usable,
                survey(&positions, &Deadline::default()).map(|survey| (survey.largest, survey.is_f32)).unwrap(),
                have_f32(&geometry, &Deadline::default()).unwrap(),
            )
        };
        let bounds = Bounds { low: [1e9, 0.0, 0.0], high: [1e9 + 64.0, 64.0, 0.0] };
        assert_eq!(check(1e9 + 64.0), (bounds, (1e9 + 64.0, true), true));
        let (_, survey, have_f32) = check(1e9 + 0.5);
        assert_eq!((survey, have_f32), ((1e9 + 0.5, false), false));
    }
}
