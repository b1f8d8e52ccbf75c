//! The camera as a plan has it: four row vectors in f32.

use crate::scene::camera::Camera;

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
    /// The projection of a placed camera. `clip` is kept as [`Projection::clip`].
    pub fn new(camera: &Camera, size_px: [u32; 2], clip: bool) -> Self {
        let [x, y, z, w] = camera.rows(size_px);
        let [right, up, back] = camera.axes.map(|axis| axis.as_vec3().to_array());
        // In an orthographic view W is 1 and nothing is behind the eye.
        let near_w = if w[3] == 1.0 && w[..3] == [0.0; 3] { 0.5 } else { camera.near as f32 };
        Self { x, y, z, w, near_w, clip, to_viewer: back, screen_up: up, screen_right: right }
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

/// `row . (p, 1)`, in f64.
pub fn row_dot(row: &[f32; 4], p: [f32; 3]) -> f64 {
    let (row, p) = (row.map(f64::from), p.map(f64::from));
    ((row[0] * p[0] + row[1] * p[1]) + row[2] * p[2]) + row[3]
}

/// The rows of a projection in f64, for many places at once.
#[derive(Clone, Copy, Debug)]
pub struct Rows([[f64; 4]; 4]);

impl Rows {
    /// The rows of a projection.
    pub fn new(projection: &Projection) -> Self {
        Self([projection.x, projection.y, projection.z, projection.w].map(|row| row.map(f64::from)))
    }

    /// X, Y and W: as [`row_dot`] gives them.
    #[inline(always)]
    pub fn place(&self, p: [f32; 3]) -> [f64; 3] {
        let p = [f64::from(p[0]), f64::from(p[1]), f64::from(p[2])];
        [self.dot(0, p), self.dot(1, p), self.dot(3, p)]
    }

    /// Z.
    #[inline(always)]
    pub fn depth(&self, p: [f32; 3]) -> f64 {
        self.dot(2, [f64::from(p[0]), f64::from(p[1]), f64::from(p[2])])
    }

    #[inline(always)]
    fn dot(&self, row: usize, p: [f64; 3]) -> f64 {
        let row = &self.0[row];
        ((row[0] * p[0] + row[1] * p[1]) + row[2] * p[2]) + row[3]
    }
}
