//! Which pixels an edge between two faces makes mixed: by the angle between the faces' normals, and
//! by the place of the edge between the samples.

use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, ShadedMaterial, flags};

use super::every_renderer;
use crate::support::scenes;

const SIZE_PX: [u32; 2] = [37, 24];

/// Angles between normals, degrees: alike, slightly different, different.
const ANGLES_DEG: [f64; 3] = [10.0, 30.0, 70.0];

/// Distance of the edge from a pixel's left or upper border, 1/256 px; and the number of columns or rows that are mixed:
/// first with 4 samples, then with 16, for each of the angles.
///
/// The outermost of 4 samples lie 32/256 px from the pixel's borders, those of 16 samples 8/256 px.
const PLACES: [(f32, [[u64; 3]; 2]); 7] = [
    // Between samples of one pixel: its neighbours are mixed, too, if the step is not slight.
    (129.0, [[0, 1, 3], [0, 1, 3]]),
    // Between the outermost samples of two pixels.
    (4.0, [[0, 2, 2], [0, 2, 2]]),
    (252.0, [[0, 2, 2], [0, 2, 2]]),
    // Of 4 samples between the outermost of two pixels, of 16 between those of one pixel.
    (20.0, [[0, 2, 2], [0, 1, 3]]),
    (236.0, [[0, 2, 2], [0, 1, 3]]),
    // Of 4 samples between the outermost and the next, of 16 between others of one pixel.
    (64.0, [[0, 1, 3], [0, 1, 3]]),
    (192.0, [[0, 1, 3], [0, 1, 3]]),
];

/// Two squares that meet at an edge. It is upright and lies this far right of the picture's middle, or level and this
/// far below it.
fn squares(is_upright: bool, edge_px: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let corners = [[-90.0, -90.0], [edge_px, -90.0], [90.0, -90.0], [-90.0, 90.0], [edge_px, 90.0], [90.0, 90.0]];
    let position = |[along, across]: [f32; 2]| if is_upright { [along, across, 0.5] } else { [across, along, 0.5] };
    (corners.map(position).to_vec(), vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
}

/// A plan of two squares that their normals alone tell apart: these differ by an angle. There are no lights, so the
/// picture is not looked at.
fn plan<'a>(samples: u32, angle_deg: f64, positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]]) -> DrawPlan<'a> {
    let mut plan = scenes::screen_plan(SIZE_PX, samples, 1.0, positions, triangles);
    (plan.is_adaptive, plan.margin_px) = (true, 1);
    if let Some(surface) = &mut plan.surface {
        let look = ShadedMaterial::unlit([1.0; 4]);
        surface.materials = vec![ShadedMaterial { flags: look.flags | flags::FACE_NORMALS, ..look }];
        let [a, b] = [-0.5, 0.5].map(|side| {
            let (sin, cos) = (side * angle_deg).to_radians().sin_cos();
            [sin as f32, 0.0, cos as f32]
        });
        surface.face_normals = vec![a, a, b, b].into();
    }
    plan
}

#[test]
fn an_edge_mixes_the_pixels_whose_samples_it_parts() {
    let mut renderers = every_renderer();
    let mut cases = 0;
    for (place_256ths_px, of_samples) in PLACES {
        for is_upright in [true, false] {
            // An edge in the first pixel right of the middle, or below it.
            let half_px = if is_upright { SIZE_PX[0] } else { SIZE_PX[1] } as f32 / 2.0;
            let (positions, triangles) = squares(is_upright, half_px.ceil() - half_px + place_256ths_px / 256.0);
            let length_px = u64::from(if is_upright { SIZE_PX[1] } else { SIZE_PX[0] });
            for (samples, of_angles) in [4, 16].into_iter().zip(of_samples) {
                for (angle_deg, mixed_rows) in ANGLES_DEG.into_iter().zip(of_angles) {
                    let plan = plan(samples, angle_deg, &positions, &triangles);
                    for renderer in &mut renderers {
                        renderer.draw(&plan, &Deadline::default()).unwrap();
                        let mixed = renderer.draw_times().mixed_pixels;
                        let name = format!(
                            "at {place_256ths_px}, upright: {is_upright}, {samples} samples, {angle_deg} degrees"
                        );
                        assert_eq!(mixed, mixed_rows * length_px, "{name}, {:?}", renderer.kind());
                        cases += 1;
                    }
                }
            }
        }
    }
    assert_eq!(cases, PLACES.len() * 2 * 2 * ANGLES_DEG.len() * renderers.len());
}
