//! The test picture that a GPU has to draw before it is used with a number of samples per pixel. Every sample and
//! every pixel of it is checked, to find a driver that computes wrong numbers before a client sees them.
//!
//! The expected picture follows from a formula in this file, not from the other back-end. Visible depths are powers
//! of two and corners lie on multiples of 1/256 px, so rounding cannot change what a sample shows. A colour may be
//! off by one step in 255.

use super::{DrawError, Renderer};
use crate::image::srgb8_thresholds;
use crate::limits::Deadline;
use crate::plan::{DrawPlan, Faces, Projection, ShadedMaterial, SurfacePass, sample_offsets};

/// Side of the picture: large enough for a triangle that goes the way of large triangles.
const SIZE_PX: u32 = 24;

/// Pixels from the picture's centre, y up. A triangle in front that is so small that a thread draws it by
/// itself, one above all that turns its back, and a wall of two large triangles that leaves the last four columns free.
const POSITIONS: [[f32; 3]; 10] = [
    [-12.0, 12.0, NEAR],
    [-12.0, 8.8125, NEAR],
    [-8.8125, 12.0, NEAR],
    [-12.0, 12.0, 0.75],
    [12.0, 12.0, 0.75],
    [-12.0, -12.0, 0.75],
    [-12.0, 12.0, FAR],
    [-12.0, -12.0, FAR],
    [8.0, -12.0, FAR],
    [8.0, 12.0, FAR],
];
const TRIANGLES: [[u32; 3]; 4] = [[0, 1, 2], [3, 4, 5], [6, 7, 9], [9, 7, 8]];
const MATERIALS: [u32; 4] = [0, 2, 1, 1];
const NEAR: f32 = 0.5;
const FAR: f32 = 0.25;

/// Linear colours of the small triangle, of the wall, of what must not be seen; and of the
/// background.
const COLORS: [[f32; 4]; 3] = [[1.0, 0.25, 0.0, 1.0], [0.0, 0.25, 1.0, 1.0], [0.0, 1.0, 0.0, 1.0]];
const BACKGROUND: [f32; 4] = [1.0, 1.0, 1.0, 1.0];

/// The fault that makes a renderer unfit for use.
#[derive(Debug, thiserror::Error)]
pub enum ProbeError {
    /// It would not draw.
    #[error("it does not draw the probe: {0}")]
    Draw(#[from] DrawError),
    /// A sample sees something else than it should.
    #[error("it draws the probe wrong: {wrong} of {of} visibility samples at {samples} a pixel")]
    Samples {
        /// Number of wrong ones.
        wrong: usize,
        /// Number of all.
        of: usize,
        /// Samples per pixel.
        samples: u32,
    },
    /// A pixel has another colour than it should.
    #[error("it draws the probe wrong: {wrong} of {of} pixels where samples = {samples}")]
    Pixels {
        /// Number of wrong ones.
        wrong: usize,
        /// Number of all.
        of: usize,
        /// Samples per pixel.
        samples: u32,
    },
}

/// Draws the probe with so many samples per pixel: samples must be right to the bit, colours to one
/// step in 255.
pub fn probe(renderer: &mut dyn Renderer, samples: u32) -> Result<(), ProbeError> {
    let deadline = Deadline::default();
    let plan = plan(samples);
    // The picture first: it needs all kernels, and they are made side by side.
    let image = renderer.draw(&plan, &deadline)?;
    let (want, got) = (expected_words(samples), renderer.draw_visibility(&plan, &deadline)?);
    let wrong = count_differing(&want, &got, |a, b| a == b);
    if wrong > 0 {
        return Err(ProbeError::Samples { wrong, of: want.len(), samples });
    }
    let want = expected_pixels(samples);
    let (got, rest) = image.rgba.as_chunks();
    let close = |a: &[u8; 4], b: &[u8; 4]| a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1);
    let wrong = rest.len() + count_differing(&want, got, close);
    if wrong > 0 {
        return Err(ProbeError::Pixels { wrong, of: want.len(), samples });
    }
    Ok(())
}

fn count_differing<T>(want: &[T], got: &[T], same: impl Fn(&T, &T) -> bool) -> usize {
    let missing = want.len().abs_diff(got.len());
    missing + want.iter().zip(got).filter(|(a, b)| !same(a, b)).count()
}

/// The triangle at a sample, by the formula of the scene's edges; `x`, `y` in 1/256 px from the
/// upper left corner.
fn seen_at([x, y]: [i32; 2]) -> Option<u32> {
    if x + y < 3 * 256 + 48 {
        Some(0)
    } else if x >= 20 * 256 {
        None
    } else if 6 * x + 5 * y < 120 * 256 {
        Some(2)
    } else {
        Some(3)
    }
}

/// Expected triangle per sample, in the order of the visibility buffer.
fn samples_seen(samples: u32) -> impl Iterator<Item = Option<u32>> {
    let side = SIZE_PX as i32;
    let pixels = (0..side).flat_map(move |y| (0..side).map(move |x| [x * 256, y * 256]));
    pixels.flat_map(move |[x, y]| sample_offsets(samples).iter().map(move |[dx, dy]| seen_at([x + dx, y + dy])))
}

fn expected_words(samples: u32) -> Vec<u64> {
    let word = |seen: Option<u32>| {
        seen.map_or(0, |id| {
            let depth = if id == 0 { NEAR } else { FAR };
            u64::from(depth.to_bits()) << 32 | u64::from(!id)
        })
    };
    samples_seen(samples).map(word).collect()
}

fn expected_pixels(samples: u32) -> Vec<[u8; 4]> {
    let thresholds = srgb8_thresholds();
    let level = |linear: f32| thresholds.partition_point(|&t| t <= linear) as u8;
    let color = |seen: &Option<u32>| seen.map_or(BACKGROUND, |id| COLORS[MATERIALS[id as usize] as usize]);
    let seen: Vec<_> = samples_seen(samples).collect();
    let pixel = |group: &[Option<u32>]| {
        let mean = |k: usize| group.iter().map(|s| color(s)[k]).sum::<f32>() / samples as f32;
        [level(mean(0)), level(mean(1)), level(mean(2)), 255]
    };
    seen.chunks(samples as usize).map(pixel).collect()
}

fn plan(samples: u32) -> DrawPlan<'static> {
    let projection = Projection {
        x: [256.0, 0.0, 0.0, 0.0],
        y: [0.0, -256.0, 0.0, 0.0],
        z: [0.0, 0.0, 1.0, 0.0],
        w: [0.0, 0.0, 0.0, 1.0],
        near_w: 0.5,
        clip: false,
        to_viewer: [0.0, 0.0, 1.0],
        screen_up: [0.0, 1.0, 0.0],
        screen_right: [1.0, 0.0, 0.0],
    };
    let materials = COLORS.iter().map(|&color| ShadedMaterial::unlit(color)).collect();
    let surface = SurfacePass { triangle_materials: (&MATERIALS).into(), ..SurfacePass::new(Faces::Front, materials) };
    DrawPlan {
        samples,
        surface: Some(surface),
        background: BACKGROUND,
        ..DrawPlan::new([SIZE_PX; 2], &POSITIONS, &TRIANGLES, projection)
    }
}

#[cfg(test)]
mod tests {
    use super::super::cpu::CpuRenderer;
    use super::*;
    use crate::backend::BackendKind;
    use crate::image::{Image, LinearImage};

    /// The CPU's pictures, with a fault.
    struct Faulty {
        samples: fn(&mut Vec<u64>),
        pixels: fn(&mut Vec<u8>),
    }

    impl Renderer for Faulty {
        fn draw(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Image, DrawError> {
            let image = CpuRenderer::new(1).draw(plan, deadline)?;
            let mut rgba = image.rgba.into_vec();
            (self.pixels)(&mut rgba);
            Ok(Image { rgba: rgba.into(), ..image })
        }

        fn draw_linear(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<LinearImage, DrawError> {
            CpuRenderer::new(1).draw_linear(plan, deadline)
        }

        fn draw_visibility(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Vec<u64>, DrawError> {
            let mut words = CpuRenderer::new(1).draw_visibility(plan, deadline)?;
            (self.samples)(&mut words);
            Ok(words)
        }

        fn kind(&self) -> BackendKind {
            BackendKind::Gpu
        }
    }

    #[test]
    fn the_formula_and_the_cpu_agree() {
        for samples in [1, 4, 8, 16] {
            probe(&mut CpuRenderer::new(1), samples).unwrap();
        }
        let seen: std::collections::BTreeSet<_> = samples_seen(4).collect();
        assert_eq!(seen, [None, Some(0), Some(2), Some(3)].into());
    }

    #[test]
    fn one_step_of_colour_is_forgiven() {
        let step = |p: &mut Vec<u8>| p.iter_mut().for_each(|v| *v = v.saturating_sub(1));
        probe(&mut Faulty { samples: |_| {}, pixels: step }, 4).unwrap();
    }

    #[test]
    fn faults_are_found() {
        let faults = [
            (1, Faulty { samples: |w| w[100] ^= 1, pixels: |_| {} }, "1 of 576 visibility samples at 1 a pixel"),
            (1, Faulty { samples: |w| w[100] ^= 1 << 32, pixels: |_| {} }, "1 of 576 visibility"),
            (1, Faulty { samples: Vec::clear, pixels: |_| {} }, "576 of 576 visibility"),
            (
                4,
                Faulty { samples: |w| w.truncate(576), pixels: |_| {} },
                "1728 of 2304 visibility samples at 4 a pixel",
            ),
            (1, Faulty { samples: |_| {}, pixels: |p| p[400] ^= 0x80 }, "1 of 576 pixels"),
            (1, Faulty { samples: |_| {}, pixels: |p| p.fill(0) }, "576 of 576 pixels"),
            (1, Faulty { samples: |_| {}, pixels: |p| p.truncate(7) }, "of 576 pixels"),
        ];
        let mut found = 0;
        for (samples, mut fault, words) in faults {
            let error = probe(&mut fault, samples).unwrap_err().to_string();
            assert!(error.contains(words), "{words}: {error}");
            found += 1;
        }
        assert_eq!(found, 7);
    }
}
