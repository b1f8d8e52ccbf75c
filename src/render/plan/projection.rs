//! The projection of a picture: four row vectors that turn a position into its place on screen, its
//! depth, and W, its distance in front of the eye (1 in an orthographic view). `Projection` has them in
//! f32, and back-ends draw by it. `Projector` has the same rows in f64: most parts of the plan find by
//! it what lies where on screen, and what lies before the near plane.

use crate::scene::camera::Camera;

/// A pixel in the units of the screen.
pub const PX: f64 = 256.0;

/// Row vectors: `screen = (X.p, Y.p) / W.p`, `depth = Z.p / W.p` for `p = (x, y, z, 1)`.
///
/// W is the distance in front of the eye in perspective (near plane at `near_w`) and constantly 1
/// in an orthographic view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// To 1/256 pixels right of the centre, times W.
    pub x: [f32; 4],
    /// To 1/256 pixels below the centre, times W.
    pub y: [f32; 4],
    /// To reversed depth, times W.
    pub z: [f32; 4],
    /// To W.
    pub w: [f32; 4],
    /// Smallest W that is drawn.
    pub near_w: f32,
    /// True if triangles may reach behind the near plane or far outside the picture. Where the
    /// mesh's box is known to lie inside, no triangle is tested for clipping.
    pub clip: bool,
    /// Unit vector from the mesh towards the viewer, unit-box axes.
    pub to_viewer: [f32; 3],
    /// The picture's up direction, unit-box axes.
    pub screen_up: [f32; 3],
    /// The picture's right direction, unit-box axes.
    pub screen_right: [f32; 3],
}

impl Projection {
    /// The projection of a placed camera. Nothing is known yet about what needs no clipping.
    pub fn new(camera: &Camera, size_px: [u32; 2]) -> Self {
        let [x, y, z, w] = camera.rows(size_px);
        let [right, up, back] = camera.axes.map(|axis| axis.as_vec3().to_array());
        // In an orthographic view W is 1 and nothing is behind the eye.
        let near_w = if w[3] == 1.0 && w[..3] == [0.0; 3] { 0.5 } else { camera.near as f32 };
        Self { x, y, z, w, near_w, clip: true, to_viewer: back, screen_up: up, screen_right: right }
    }

    /// Distance that a ray gains sideways on its way, per distance along the view's axis and 1/256 px
    /// from the picture's centre; 0 in an orthographic view.
    pub fn ray_slope(&self) -> f32 {
        let square = |row: &[f32; 4]| (row[0] * row[0] + row[1] * row[1]) + row[2] * row[2];
        let (along, across) = (square(&self.w), square(&self.x));
        if along > 0.0 && across > 0.0 { (along / across).sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
impl Projection {
    /// From the front, 60 px a unit at the distance 1; the eye is at z = 1.4.
    pub fn for_tests() -> Self {
        let [right, up, back] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let row = |axis: [f32; 3], scale: f32, offset: f32| [axis[0] * scale, axis[1] * scale, axis[2] * scale, offset];
        Self {
            x: row(right, 60.0 * 256.0, 0.0),
            y: row(up, -40.0 * 256.0, 0.0),
            z: row(back, 0.2, 0.5),
            w: [0.0, 0.0, -1.0, 1.4],
            near_w: 0.5,
            clip: true,
            to_viewer: back,
            screen_up: up,
            screen_right: right,
        }
    }
}

/// A projection in f64. Its places differ from those of the back-ends by what f32 rounds.
#[derive(Clone, Copy, Debug)]
pub struct Projector {
    /// The rows that give X, Y, Z and W.
    pub rows: [[f64; 4]; 4],
    near_w: f64,
}

impl Projector {
    /// The same projection.
    pub fn new(projection: &Projection) -> Self {
        let Projection { x, y, z, w, near_w, .. } = *projection;
        Self { rows: [x, y, z, w].map(|row| row.map(f64::from)), near_w: f64::from(near_w) }
    }

    /// Smallest W before the near plane. A margin moves the plane away from the eye by a share of its distance.
    pub fn near_w(&self, margin: f64) -> f64 {
        self.near_w * (1.0 + margin)
    }

    /// X, Y and W of a position.
    #[inline(always)]
    pub fn place<T: Copy + Into<f64>>(&self, p: [T; 3]) -> [f64; 3] {
        let p = [p[0].into(), p[1].into(), p[2].into()];
        [self.dot(0, p), self.dot(1, p), self.dot(3, p)]
    }

    /// X, Y, Z and W of a position.
    #[inline(always)]
    pub fn homogeneous(&self, p: [f32; 3]) -> [f64; 4] {
        let [x, y, w] = self.place(p);
        [x, y, self.dot(2, p.map(f64::from)), w]
    }

    /// A position on screen, in 1/256 pixels right of the centre and below it, and 1 / W. None where W is less than
    /// `near_w`.
    #[inline]
    pub fn on_screen<T: Copy + Into<f64>>(&self, p: [T; 3], near_w: f64) -> Option<[f64; 3]> {
        let [x, y, w] = self.place(p);
        (w >= near_w).then(|| [x / w, y / w, 1.0 / w])
    }

    #[inline(always)]
    fn dot(&self, row: usize, p: [f64; 3]) -> f64 {
        let row = &self.rows[row];
        ((row[0] * p[0] + row[1] * p[1]) + row[2] * p[2]) + row[3]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_on_screen_where_it_lies_before_the_near_plane() {
        let projector = Projector::new(&Projection::for_tests());
        // The eye is at z = 1.4 and the near plane at z = 0.9.
        let (near_w, half) = (projector.near_w(0.0), [0.5, 0.25, 0.4]);
        let [x, y, inverse] = projector.on_screen(half, near_w).unwrap();
        assert!((x - 30.0 * PX).abs() < 1e-2 && (y + 10.0 * PX).abs() < 1e-2 && (inverse - 1.0).abs() < 1e-6);
        let at = |z: f64| [0.0, 0.0, z];
        assert!(projector.on_screen(at(0.899), near_w).is_some());
        assert!(projector.on_screen(at(0.901), near_w).is_none());
        assert!(projector.on_screen(at(0.899), projector.near_w(0.01)).is_none());
        assert!(projector.on_screen(at(f64::NAN), near_w).is_none());
    }
}
