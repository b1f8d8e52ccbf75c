//! The oracle's camera, given as plain numbers: takes positions to pixels and depth, and cuts off
//! what lies behind the near plane.

use super::vector::V3;

/// Rows that give pixels right of and below the picture's centre (times W), reversed depth (times
/// W: larger is nearer) and W, the distance in front of the eye or 1.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    pub size_px: [u32; 2],
    pub x: [f64; 4],
    pub y: [f64; 4],
    pub z: [f64; 4],
    pub w: [f64; 4],
    /// Points with less W are not drawn.
    pub near_w: f64,
}

/// Homogeneous: pixels from the picture's upper left corner times W, depth times W, and W.
pub type Homogeneous = [f64; 4];

impl Camera {
    /// A camera that takes x and y as pixels from the upper left corner and z as depth.
    pub fn of_pixels(size_px: [u32; 2]) -> Self {
        let half = size_px.map(|n| f64::from(n) * 0.5);
        Self {
            size_px,
            x: [1.0, 0.0, 0.0, -half[0]],
            y: [0.0, 1.0, 0.0, -half[1]],
            z: [0.0, 0.0, 1.0, 0.0],
            w: [0.0, 0.0, 0.0, 1.0],
            near_w: 0.5,
        }
    }

    pub fn homogeneous(&self, p: V3) -> Homogeneous {
        let row = |r: &[f64; 4]| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3];
        let w = row(&self.w);
        let half = self.size_px.map(|n| f64::from(n) * 0.5);
        [row(&self.x) + half[0] * w, row(&self.y) + half[1] * w, row(&self.z), w]
    }

    /// The part of a closed chain of corners in front of the near plane; with two corners, of a
    /// segment.
    pub fn in_front(&self, corners: &[Homogeneous]) -> Vec<Homogeneous> {
        let mut kept = Vec::new();
        for (i, &from) in corners.iter().enumerate() {
            let to = corners[(i + 1) % corners.len()];
            let (d0, d1) = (from[3] - self.near_w, to[3] - self.near_w);
            if d0 >= 0.0 {
                kept.push(from);
            }
            // Of a segment, only the way there counts, not the way back.
            if (d0 >= 0.0) != (d1 >= 0.0) && (corners.len() > 2 || i == 0) {
                let t = d0 / (d0 - d1);
                kept.push(std::array::from_fn(|k| from[k] + t * (to[k] - from[k])));
            }
        }
        kept
    }
}

/// x, y and depth.
pub fn project(p: Homogeneous) -> V3 {
    [p[0] / p[3], p[1] / p[3], p[2] / p[3]]
}
