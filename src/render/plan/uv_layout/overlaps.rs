//! The faces that overlap others in the texture. They are found at the points of a grid: where a point
//! lies in two faces, these overlap. A point on an edge belongs to one of the edge's two faces, so that
//! neighbours do not count as overlapping. Overlaps between the points are not found. The search ends
//! after a large number of points.

use crate::limits::{Deadline, Stopped};

/// Points of the grid on a side.
const SIDE: i64 = 1024;

/// Units of the integer coordinates between two points.
const UNIT: i64 = 256;

/// Most points that are looked at, of all faces together.
const VISITS_MAX: u64 = 1 << 28;

/// Memory of the grid, bytes.
pub const GRID_BYTES: u64 = 4 * (SIDE * SIDE) as u64;

/// No face.
const NONE: u32 = u32::MAX;

/// The overlapping faces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Overlaps {
    /// By face.
    pub faces: Vec<bool>,
    /// False if the faces have so many points that not all were looked at.
    pub is_complete: bool,
}

/// Finds the faces that overlap others. Corners are in a box of side 1 around the origin.
pub fn overlapping(faces: &[[[f64; 2]; 3]], deadline: &Deadline) -> Result<Overlaps, Stopped> {
    let mut owners = vec![NONE; (SIDE * SIDE) as usize];
    let mut found = Overlaps { faces: vec![false; faces.len()], is_complete: true };
    let (mut visits, mut checked) = (0_u64, 0_u64);
    for (face, corners) in faces.iter().enumerate() {
        let triangle = Triangle::new(corners);
        let Some([x0, y0, x1, y1]) = triangle.bounds() else { continue };
        visits += ((x1 - x0 + 1) * (y1 - y0 + 1)) as u64;
        if visits > VISITS_MAX {
            found.is_complete = false;
            break;
        }
        if visits >= checked || face.is_multiple_of(1 << 16) {
            deadline.check()?;
            checked = visits + (1 << 20);
        }
        for (y, x) in (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| (y, x))) {
            if !triangle.owns([x * UNIT, y * UNIT]) {
                continue;
            }
            let owner = &mut owners[(y * SIDE + x) as usize];
            if *owner == NONE {
                *owner = face as u32;
            } else {
                found.faces[*owner as usize] = true;
                found.faces[face] = true;
            }
        }
    }
    Ok(found)
}

/// A face in integer coordinates, counter-clockwise.
struct Triangle([[i64; 2]; 3]);

impl Triangle {
    fn new(corners: &[[f64; 2]; 3]) -> Self {
        // The grid's points are at whole units.
        let place = |v: f64| libm::rint((v + 0.5).clamp(-1.0, 2.0) * (SIDE * UNIT) as f64) as i64;
        let [a, b, c] = corners.map(|corner| corner.map(place));
        let is_turned = (b[0] - a[0]) * (c[1] - a[1]) < (c[0] - a[0]) * (b[1] - a[1]);
        Self(if is_turned { [a, c, b] } else { [a, b, c] })
    }

    /// The first and last column and row of points that it may own.
    fn bounds(&self) -> Option<[i64; 4]> {
        let reach = |k: usize| {
            let values = self.0.map(|corner| corner[k]);
            let (low, high) = (values.into_iter().min()?, values.into_iter().max()?);
            let (first, last) = ((low + UNIT - 1).div_euclid(UNIT).max(0), high.div_euclid(UNIT).min(SIDE - 1));
            (first <= last).then_some([first, last])
        };
        let ([x0, x1], [y0, y1]) = (reach(0)?, reach(1)?);
        Some([x0, y0, x1, y1])
    }

    /// True if a point is inside, or on one of the edges that belong to the face: of the two directions in
    /// which faces run along an edge, one owns its points.
    fn owns(&self, [x, y]: [i64; 2]) -> bool {
        (0..3).all(|k| {
            let (from, to) = (self.0[k], self.0[(k + 1) % 3]);
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let side = dx * (y - from[1]) - dy * (x - from[0]);
            side > 0 || side == 0 && (dy > 0 || dy == 0 && dx < 0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles over a rectangle, the second turned over if so.
    fn quad([x0, y0, x1, y1]: [f64; 4], is_turned: bool) -> [[[f64; 2]; 3]; 2] {
        let second = [[x0, y0], [x1, y1], [x0, y1]];
        let [a, b, c] = second;
        [[[x0, y0], [x1, y0], [x1, y1]], if is_turned { [a, c, b] } else { second }]
    }

    fn marks(faces: &[[[f64; 2]; 3]]) -> Vec<bool> {
        let found = overlapping(faces, &Deadline::default()).unwrap();
        assert!(found.is_complete);
        found.faces
    }

    #[test]
    fn neighbours_do_not_overlap_and_others_do() {
        for is_turned in [false, true] {
            let mut faces: Vec<[[f64; 2]; 3]> = Vec::new();
            // Neighbours on the grid's own points, and between them.
            for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (f64::from(i), f64::from(j)))) {
                let at = |v: f64| v * 0.1 - 0.45;
                faces.extend(quad([at(i), at(j), at(i + 1.0), at(j + 1.0)], is_turned));
            }
            assert!(marks(&faces).iter().all(|mark| !mark), "{is_turned}");
            let count = faces.len();
            faces.extend(quad([-0.05, -0.05, 0.02, 0.02], is_turned));
            let found = marks(&faces);
            assert!(found[count] && found[count + 1]);
            let others = found[..count].iter().filter(|mark| **mark).count();
            assert!((2..=8).contains(&others), "{others}");
        }
    }

    #[test]
    fn too_many_visits_end_and_are_told() {
        let whole = quad([-0.5, -0.5, 0.5, 0.5], false)[0];
        let found = overlapping(&vec![whole; 400], &Deadline::default()).unwrap();
        assert!(!found.is_complete && found.faces[..200].iter().all(|mark| *mark));
        assert!(overlapping(&vec![whole; 400], &Deadline::after_polls(3)).is_err());
    }

    #[test]
    fn odd_corners_do_no_harm() {
        let odd = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.5, -0.5];
        let faces: Vec<_> = odd.iter().map(|&v| [[v, 0.0], [0.2, v], [0.1, 0.3]]).collect();
        assert_eq!(overlapping(&faces, &Deadline::default()).unwrap().faces.len(), 6);
    }
}
