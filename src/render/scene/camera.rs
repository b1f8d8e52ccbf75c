//! The camera of a picture: position, direction and lens, as the request asks for them and fitted to the
//! mesh where it leaves them open. All is computed in f64.
//!
//! Fitting is exact: the frame, less its free border, touches the projected mesh itself, not its
//! bounding sphere (for a turntable, all turns of the mesh together). In perspective, let t be the
//! slope of a plane of the view pyramid. A vertex (x, y, z) in camera axes (z towards the viewer) is
//! inside where `x + t z <= t d + cx`. The largest left-hand side on each of the four planes gives
//! distance d and centre cx in closed form.

use glam::{DVec2, DVec3};

use super::extents::{Extents, turned_extents};
use super::position_boxes::BoxedPositions;
use crate::mesh::material::{FileCamera, FileLens};
use crate::mesh::{Mesh, UpAxis};
use crate::spec::{CameraSpec, ProjectionKind as Kind};

/// A placed camera. Lengths are in units of the mesh's box.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Unit vectors to the picture's right, to its top, and towards the viewer: right-handed.
    pub axes: [DVec3; 3],
    /// The point where the view's axis crosses the plane z = 0 of the camera's axes.
    pub center: DVec2,
    /// Distance of the eye from that plane, along the view's axis.
    pub distance: f64,
    /// Half the picture's width and height: at distance 1 in perspective, at every distance in an
    /// orthographic view.
    pub half_size: DVec2,
    /// Perspective or orthographic.
    pub kind: Kind,
    /// Smallest distance from the eye that is drawn.
    pub near: f64,
    /// Distance from the eye of the farthest point of the mesh.
    pub far: f64,
    /// True if all of the mesh lies safely between `near` and the guard band.
    pub contains_mesh: bool,
    /// The mesh's reach from the picture's middle, as shares of half its width and height: an
    /// upper limit, apart from rounding. Infinite where the mesh is not wholly before the eye.
    pub reach: DVec2,
}

/// Room that a picture needs around the mesh.
#[derive(Clone, Copy, Debug, Default)]
pub struct Border {
    /// Distance by which the mesh itself grows on each side, units of the box.
    pub grow: f64,
    /// Room on each side, pixels.
    pub px: f64,
    /// Distance around the mesh that is drawn, too, wherever it lies on screen: units of the box.
    pub around: f64,
}

impl Camera {
    /// Places the camera for a picture of `size_px`, fitted to those of the mesh's positions (`all`) that are in
    /// `framing`.
    pub fn place(
        spec: &CameraSpec,
        mesh: &Mesh,
        [framing, all]: [BoxedPositions<'_>; 2],
        size_px: [u32; 2],
        border: Border,
    ) -> Self {
        let size = DVec2::new(f64::from(size_px[0]), f64::from(size_px[1]));
        let up = spec.up.unwrap_or(mesh.up);
        let free = |v: f64| (1.0 - 2.0 * spec.margin - 2.0 * border.px / v).max(0.05);
        let inner = DVec2::new(free(size.x), free(size.y));
        let aspect = size.x / size.y;
        let file = mesh.cameras.first().filter(|_| spec.from_file);
        let (spec, file_axes) = match file {
            Some(camera) => (&through(spec, camera), Some(file_axes(mesh, camera))),
            None => (spec, None),
        };
        let tan = tan_deg(spec.fov_deg * 0.5);
        let tangents = DVec2::new(tan * aspect, tan);
        let (axes, explicit) = match (file_axes, spec.eye, spec.target) {
            (Some(placed), ..) => placed,
            (None, Some(eye), Some(target)) => explicit_axes(mesh, up, eye, target),
            _ => (named_axes(spec, up), None),
        };
        let slopes = tangents * inner;
        let extents_of = |framing: BoxedPositions<'_>| match spec.fits_turn {
            true => {
                turned_extents(framing.positions, mesh, (axes, frame(up)[1]), sin_cos_deg(spec.elevation_deg()), slopes)
            }
            false => Extents::new(framing, axes, slopes),
        };
        let extents = extents_of(framing);
        let mut camera = match (spec.projection, explicit) {
            (Kind::Perspective, Some((target, distance))) => {
                let to = DVec2::new(axes[0].dot(target), axes[1].dot(target));
                Self::new(axes, to, axes[2].dot(target) + distance, tangents, Kind::Perspective)
            }
            (Kind::Perspective, None) => {
                let (center, distance) = extents.fit_perspective(slopes, border.grow);
                Self::new(axes, center, distance, tangents, Kind::Perspective)
            }
            (Kind::Orthographic, _) => {
                let center = explicit.map_or(extents.center(), |(t, _)| DVec2::new(axes[0].dot(t), axes[1].dot(t)));
                let fitted = ((extents.half() + border.grow) / inner / DVec2::new(aspect, 1.0)).max_element();
                let half = spec.height.map_or(fitted, |h| 0.5 * h / mesh.to_file.scale);
                let half = if half > 0.0 { half } else { 1e-3 };
                Self::new(axes, center, extents.high.z + 1.0, DVec2::new(half * aspect, half), Kind::Orthographic)
            }
        };
        // What does not frame the picture has a depth, too.
        let is_all = framing.positions.len() == all.positions.len();
        let extents = if is_all { extents } else { extents_of(all) };
        camera.set_range(&extents, border.grow + border.around, size);
        camera.set_reach(&extents, slopes);
        camera
    }

    fn new(axes: [DVec3; 3], center: DVec2, distance: f64, half_size: DVec2, kind: Kind) -> Self {
        Self {
            axes,
            center,
            distance,
            half_size,
            kind,
            near: 0.0,
            far: 0.0,
            contains_mesh: false,
            reach: DVec2::INFINITY,
        }
    }

    fn set_range(&mut self, extents: &Extents, grow: f64, size_px: DVec2) {
        let nearest = self.distance - extents.high.z - grow;
        let farthest = self.distance - extents.low.z + grow;
        // Where the mesh lies behind or around the eye, the near plane is at a millionth of the
        // distance to its far side.
        self.near = if nearest > 0.0 { 0.5 * nearest } else { 1e-6 * farthest.max(1e-6) };
        // f32 rounds depths by the size of the box, however close the eye is to the box's far side,
        // and rounding must not move that behind the far plane.
        self.far = (farthest.max(2.0 * self.near) * (1.0 + 1e-6)).max(farthest + 1e-6);
        let reach = (extents.high - self.center.extend(0.0)).abs().max((extents.low - self.center.extend(0.0)).abs());
        let w = if self.kind == Kind::Perspective { nearest } else { 1.0 };
        let px = (DVec2::new(reach.x, reach.y) + grow) / (self.half_size * w) * size_px * 0.5;
        // Half of the guard band, so that f32 cannot round anything out of it. Hulls need no room:
        // the plan cuts them to what may be in the picture.
        self.contains_mesh = nearest > 0.0 && px.max_element() < 2048.0;
    }

    /// Finds [`Camera::reach`] from the bounds of the mesh in a view pyramid of these slopes.
    fn set_reach(&mut self, extents: &Extents, slopes: DVec2) {
        let shares = match self.kind {
            Kind::Orthographic => (extents.high.truncate() - self.center).max(self.center - extents.low.truncate()),
            // Where `x <= plus - s z`, `(x - c) / (d - z) <= s + (plus - c - s d) / (d - z)`.
            Kind::Perspective => {
                let nearest = self.distance - extents.high.z;
                if nearest <= 0.0 {
                    return;
                }
                let beyond = (extents.plus - self.center).max(extents.minus + self.center) - slopes * self.distance;
                slopes + beyond.max(DVec2::ZERO) / nearest
            }
        };
        self.reach = shares / self.half_size;
    }

    /// Pixels per unit of the box, at the box's centre.
    pub fn px_per_unit(&self, size_px: [u32; 2]) -> f64 {
        let w = if self.kind == Kind::Perspective { self.distance.max(self.near) } else { 1.0 };
        f64::from(size_px[1]) * 0.5 / (self.half_size.y * w)
    }

    /// A position in the camera's axes.
    pub fn in_axes(&self, position: [f32; 3]) -> DVec3 {
        let p = DVec3::from(position.map(f64::from));
        DVec3::from(self.axes.map(|axis| axis.dot(p)))
    }

    /// W of a point in the camera's axes.
    pub fn w(&self, at: DVec3) -> f64 {
        if self.kind == Kind::Perspective { self.distance - at.z } else { 1.0 }
    }

    /// The distance along the view's axis of what has a reversed depth: the inverse of the third and fourth row of
    /// [`Camera::rows`].
    pub fn distance_of(&self, depth: f64) -> f64 {
        let range = self.far - self.near;
        match self.kind {
            Kind::Perspective => self.near * self.far / (depth * range + self.near),
            Kind::Orthographic => self.far - depth * range,
        }
    }

    /// The four rows of the projection: x, y (in 1/256 px from the centre), reversed depth, W.
    pub fn rows(&self, size_px: [u32; 2]) -> [[f32; 4]; 4] {
        let [right, up, back] = self.axes;
        let perspective = self.kind == Kind::Perspective;
        let unit = DVec2::new(f64::from(size_px[0]), f64::from(size_px[1])) * 128.0 / self.half_size;
        let row = |axis: DVec3, offset: f64| [axis.x as f32, axis.y as f32, axis.z as f32, offset as f32];
        let w = if perspective { row(-back, self.distance) } else { [0.0, 0.0, 0.0, 1.0] };
        // z = near (far - W) / (W (far - near)): 1 at the near plane, 0 at the far one. With far -
        // W as one row nothing cancels, however narrow the field of view is.
        let range = self.far - self.near;
        let scale = if perspective { self.near / range } else { 1.0 / range };
        [
            row(right * unit.x, -self.center.x * unit.x),
            row(-up * unit.y, self.center.y * unit.y),
            row(back * scale, (self.far - self.distance) * scale),
            w,
        ]
    }
}

type Explicit = Option<(DVec3, f64)>;

/// Axes for an explicit eye and target (file space), with the target in box units and its distance
/// from the eye.
fn explicit_axes(mesh: &Mesh, up: UpAxis, eye: [f64; 3], target: [f64; 3]) -> ([DVec3; 3], Explicit) {
    let local = |p: [f64; 3]| (DVec3::from(p) - DVec3::from(mesh.to_file.centre)) / mesh.to_file.scale;
    let (eye, target) = (local(eye), local(target));
    let [right, up, front] = frame(up);
    let back = (eye - target).try_normalize().unwrap_or(front);
    // Looking straight up or down, the picture's right stays the model's right.
    let side = up.cross(back).try_normalize().unwrap_or(right);
    ([side, back.cross(side), back], Some((target, (eye - target).length())))
}

/// The requested camera with the lens of the file's camera.
fn through(spec: &CameraSpec, camera: &FileCamera) -> CameraSpec {
    match camera.lens {
        FileLens::Perspective { fov_deg } => {
            CameraSpec { projection: Kind::Perspective, fov_deg: fov_deg.clamp(0.01, 179.0), ..*spec }
        }
        FileLens::Orthographic { height } => {
            CameraSpec { projection: Kind::Orthographic, height: Some(height), ..*spec }
        }
    }
}

/// The file camera's axes, with a point in front of it and its distance.
fn file_axes(mesh: &Mesh, camera: &FileCamera) -> ([DVec3; 3], Explicit) {
    let axes = camera.axes.map(DVec3::from);
    let eye = (DVec3::from(camera.eye) - DVec3::from(mesh.to_file.centre)) / mesh.to_file.scale;
    (axes, Some((eye - axes[2], 1.0)))
}

fn named_axes(spec: &CameraSpec, up: UpAxis) -> [DVec3; 3] {
    let (sin_a, cos_a) = sin_cos_deg(spec.azimuth_deg());
    let (sin_e, cos_e) = sin_cos_deg(spec.elevation_deg());
    let [right, up, front] = frame(up);
    let back = (right * sin_a + front * cos_a) * cos_e + up * sin_e;
    let side = right * cos_a - front * sin_a;
    [side, back.cross(side), back]
}

/// Model right, up and front for an up axis: right-handed, and as the formats' conventions have it
/// (glTF: +Y up, +Z front; STL: +Z up, -Y front).
pub(crate) fn frame(up: UpAxis) -> [DVec3; 3] {
    let (right, up) = match up {
        UpAxis::Y => (DVec3::X, DVec3::Y),
        UpAxis::NegY => (DVec3::X, DVec3::NEG_Y),
        UpAxis::Z => (DVec3::X, DVec3::Z),
        UpAxis::NegZ => (DVec3::X, DVec3::NEG_Z),
        UpAxis::X => (DVec3::NEG_Y, DVec3::X),
        UpAxis::NegX => (DVec3::Y, DVec3::NEG_X),
    };
    [right, up, right.cross(up)]
}

/// Sine and cosine of degrees, exact at quarter turns.
fn sin_cos_deg(degrees: f64) -> (f64, f64) {
    let turns = degrees / 90.0;
    if turns == libm::rint(turns) {
        return match libm::rint(turns).rem_euclid(4.0) as i32 {
            0 => (0.0, 1.0),
            1 => (1.0, 0.0),
            2 => (0.0, -1.0),
            _ => (-1.0, 0.0),
        };
    }
    let radians = degrees.to_radians();
    (libm::sin(radians), libm::cos(radians))
}

fn tan_deg(degrees: f64) -> f64 {
    libm::tan(degrees.to_radians())
}
