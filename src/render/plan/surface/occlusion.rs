//! Occlusion: how much light does not reach the bottom of hollows. Back-ends estimate it from the depths that the
//! picture shows (screen-space ambient occlusion). Here it is decided whether a picture has it, and its numbers are
//! computed: how far surfaces darken each other, and which places around a pixel are looked at. docs/rasterizer.md,
//! "Occlusion", has the definition.

use crate::plan::SurfacePass;
use crate::plan::context::PlanContext;
use crate::plan::flags;
use crate::plan::skips::SkipKind;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::spec::ProjectionKind;

/// Places around a pixel that are looked at, and those that one pixel looks at itself.
pub const TAPS: usize = 64;
/// As above: four pixels share all of them.
pub const TAPS_PER_PIXEL: usize = TAPS / 4;

/// Distance within which a surface takes light from another, as a share of the mesh's diagonal.
const RADIUS: f64 = 0.11;

/// The same on screen, at most, as a share of the picture's longer side.
const RADIUS_SCREEN_MAX: f64 = 0.15;

/// Depths of one surface in neighbouring pixels differ by no more than this share of the radius.
const NEAR: f64 = 0.25;

/// The angle between two directions that never fall together: pi (3 - sqrt 5).
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// The occlusion of a picture's surface. Lengths are in pixels at the mesh's centre, so that they
/// are near 1 however large or small the mesh is.
#[derive(Clone, Debug, PartialEq)]
pub struct OcclusionPass {
    /// Share of the light that a place which is wholly shut in goes without, 0 to 1.
    pub strength: f32,
    /// Distance within which a surface takes light from another.
    pub radius: f32,
    /// `[a, b, c]`: a sample of depth z lies `a z / (b z + c)` before the far plane.
    pub depth: [f32; 3],
    /// `[a, b]`: at `t` before the far plane, a pixel is `a - b t` wide.
    pub spread: [f32; 2],
    /// Neighbouring pixels show one surface where their places before the far plane differ by no more.
    pub near: f32,
    /// A pixel's samples show one surface where their depths differ by no more.
    pub near_depth: f32,
    /// The places that pixels look at, columns and rows from their own. Pixel (2x, 2y) looks at number
    /// `x % 2 + 2 (y % 2)` of four equal parts.
    pub taps: [[i32; 2]; TAPS],
}

/// The occlusion of a picture; None where nothing needs it.
pub fn occlusion_pass(
    scene: &Scene<'_, '_>,
    surface: Option<&SurfacePass<'_>>,
    cx: &mut PlanContext<'_>,
) -> Option<OcclusionPass> {
    let strength = scene.spec.light.ambient_occlusion;
    let is_lit = surface.is_some_and(|surface| surface.is_shaded && surface.all_flags() & flags::LIT != 0);
    if cx.skips.skip(SkipKind::Occlusion, !is_lit, "no surface is lit")
        || cx.skips.skip(SkipKind::Occlusion, strength == 0.0, "ambient_occlusion is 0")
        || surface.is_none()
    {
        return None;
    }
    Some(OcclusionPass::new(&scene.camera, scene.size_px(), diagonal(&scene.mesh.bounds), strength))
}

impl OcclusionPass {
    /// The occlusion of a mesh whose box has the diagonal `diagonal`, in its own units.
    pub fn new(camera: &Camera, size_px: [u32; 2], diagonal: f64, strength: f32) -> Self {
        let is_perspective = camera.kind == ProjectionKind::Perspective;
        let px = 1.0 / camera.px_per_unit(size_px);
        let longer_px = f64::from(size_px[0].max(size_px[1]));
        let radius = (RADIUS * diagonal / px).min(RADIUS_SCREEN_MAX * longer_px).max(1.0);
        let range = camera.far - camera.near;
        // The inverse of the depths that `Camera::rows` makes.
        let (depth, spread) = if is_perspective {
            let w = camera.distance.max(camera.near);
            ([camera.far * range / px, range, camera.near], [camera.far / w, px / w])
        } else {
            ([range / px, 0.0, 1.0], [1.0, 0.0])
        };
        let near = NEAR * radius;
        // z = c t / (a - b t), whose slope is a c / (a - b t)^2.
        let [a, b, c] = depth;
        let middle = 0.5 * range / px;
        let near_depth = near * a * c / ((a - b * middle) * (a - b * middle));
        Self {
            strength,
            radius: radius as f32,
            depth: depth.map(|v| v as f32),
            spread: spread.map(|v| v as f32),
            near: near as f32,
            near_depth: near_depth as f32,
            taps: taps(radius),
        }
    }

    /// 1 / radius^2.
    pub fn inverse_square(&self) -> f32 {
        1.0 / (self.radius * self.radius)
    }

    /// The places that a pixel of an even column and row looks at.
    #[inline(always)]
    pub fn taps_of(&self, x: u32, y: u32) -> &[[i32; 2]] {
        let part = (((x >> 1) & 1) + 2 * ((y >> 1) & 1)) as usize;
        &self.taps[part * TAPS_PER_PIXEL..(part + 1) * TAPS_PER_PIXEL]
    }
}

/// A spiral of places up to `radius` away, as many in each ring; every fourth is the same part's.
fn taps(radius: f64) -> [[i32; 2]; TAPS] {
    std::array::from_fn(|i| {
        let (part, place) = (i / TAPS_PER_PIXEL, i % TAPS_PER_PIXEL);
        let number = (4 * place + part) as f64;
        let away = (radius * (number + 0.5) / TAPS as f64).max(1.0);
        let angle = GOLDEN_ANGLE * number;
        [libm::cos(angle), libm::sin(angle)].map(|v| libm::round(away * v) as i32)
    })
}

fn diagonal([low, high]: &[[f32; 3]; 2]) -> f64 {
    let side = |k: usize| f64::from(high[k]) - f64::from(low[k]);
    libm::sqrt((0..3).map(|k| side(k) * side(k)).sum())
}
