//! Pictures in linear light: they round to the bytes of the usual picture, and GPU and CPU agree.

use std::ops::RangeInclusive;
use std::sync::LazyLock;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::{Image, LinearImage, f16, srgb8_thresholds};
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::{scenes, shapes};

/// One for each way to a pixel's colour: flat and other faces, mixed pixels, lines over faces and alone, occlusion, layers,
/// an outline, no faces at all, and each kind of background.
const LOOKS: &[&[(&str, &str)]] = &[
    &[("style", "flat"), ("samples", "4")],
    &[("style", "flat"), ("samples", "adaptive"), ("background", "transparent")],
    &[("style", "smooth"), ("light.preset", "three-point"), ("surface.metallic", "1"), ("surface.roughness", "0.2")],
    &[("style", "wire"), ("background", "#fff..#224")],
    &[("style", "wire"), ("samples", "8"), ("background", "transparent"), ("wire.smoothing", "2")],
    &[("style", "wireframe"), ("background", "transparent")],
    &[("style", "hidden-line"), ("background", "#c40")],
    &[("style", "clay")],
    &[("style", "smooth"), ("surface.emissive", "#fff")],
    &[("style", "xray")],
    &[("style", "outline"), ("outline.thickness", "3"), ("outline.unit", "px")],
    &[("style", "wireframe"), ("wire.opacity", "0"), ("background", "#8ac..#000")],
];

/// Largest difference of GPU and CPU, in steps between neighbouring half floats.
const STEPS_MAX: u16 = 1;

fn each_plan(mut each: impl FnMut(&str, &DrawPlan<'_>)) {
    for obj in [shapes::torus(14), shapes::gear(7)] {
        let mesh = scenes::mesh(&obj);
        for look in LOOKS {
            let spec = scenes::spec(&[look, &[("size", "72x60"), ("camera.azimuth_deg", "23")][..]].concat());
            each(&format!("{look:?}"), &scenes::plan(&mesh, &spec));
        }
    }
}

#[test]
fn linear_pictures_of_the_cpu_round_to_its_bytes() {
    let (mut renderer, mut brightest, mut cases) = (CpuRenderer::new(2), f16::ZERO, 0);
    each_plan(|look, plan| {
        let linear = round_to_bytes(&mut renderer, look, plan);
        brightest = linear.rgba.as_flattened().iter().copied().fold(brightest, f16::max);
        cases += 1;
    });
    assert_eq!(cases, 2 * LOOKS.len());
    assert!(brightest > f16::ONE, "what shines is not clamped, but the brightest value is {brightest}");
}

#[test]
fn linear_pictures_of_gpu_and_cpu_agree() {
    let Some(gpus) = gpus() else { return };
    let (mut cpu, mut cases) = (CpuRenderer::new(2), 0);
    let mut renderers: Vec<_> = gpus.iter().map(|gpu| GpuRenderer::new(gpu.clone())).collect();
    each_plan(|look, plan| {
        let want = cpu.draw_linear(plan, &Deadline::default()).unwrap();
        // Each look is drawn by two devices, if there are as many.
        let device = (cases + cases / LOOKS.len()) % renderers.len();
        let got = round_to_bytes(&mut renderers[device], look, plan);
        let pixels = want.rgba.iter().zip(&got.rgba);
        let steps = |(a, b): (&[f16; 4], &[f16; 4])| a.iter().zip(b).map(|(a, b)| steps(*a, *b)).max().unwrap();
        let apart = pixels.map(steps).filter(|&steps| steps > STEPS_MAX).count();
        assert!(apart as f64 <= Tolerance::TWINS.share * want.rgba.len() as f64, "{look}: {apart} pixels");
        // A difference of one step may cross a byte's threshold.
        Likeness::of(&bytes(&want), &bytes(&got)).assert(Tolerance { share: 0.01, ..Tolerance::TWINS }, look);
        cases += 1;
    });
    assert_eq!(cases, 2 * LOOKS.len());
}

/// Draws both pictures of a plan, and compares them.
fn round_to_bytes(renderer: &mut dyn Renderer, look: &str, plan: &DrawPlan<'_>) -> LinearImage {
    let deadline = Deadline::default();
    let image = renderer.draw(plan, &deadline).unwrap();
    let linear = renderer.draw_linear(plan, &deadline).unwrap();
    assert_eq!((linear.width_px, linear.height_px), (image.width_px, image.height_px), "{look}");
    // A large face may be one colour, whose half float lies on the other side of a byte's threshold.
    Likeness::of(&image, &bytes(&linear)).assert(Tolerance { max: 1, share: 1.0 }, look);
    for (half, byte) in linear.rgba.iter().zip(image.rgba.chunks(4)).filter(|(half, _)| half[3] == f16::ONE) {
        let is_near = (0..3).all(|k| bytes_near(half[k]).contains(&byte[k]));
        assert!(is_near && byte[3] == 255, "{look}: {half:?} is {byte:?}");
    }
    linear
}

/// The bytes of colours that are rounded to a half float.
fn bytes_near(half: f16) -> RangeInclusive<u8> {
    let bits = if half > f16::ZERO { half.to_bits() } else { 0 };
    srgb(f16::from_bits(bits.saturating_sub(1)).into())..=srgb(f16::from_bits(bits + 1).into())
}

fn srgb(linear: f32) -> u8 {
    static THRESHOLDS: LazyLock<[f32; 255]> = LazyLock::new(srgb8_thresholds);
    THRESHOLDS.partition_point(|&threshold| threshold <= linear) as u8
}

/// The sRGB bytes of half floats.
fn bytes(linear: &LinearImage) -> Image {
    let pixel = |pixel: &[f16; 4]| match pixel.map(f32::from) {
        [_, _, _, a] if a <= 0.0 => [0; 4],
        [r, g, b, a] => [srgb(r / a), srgb(g / a), srgb(b / a), (a * 255.0 + 0.5) as u8],
    };
    let rgba: Vec<u8> = linear.rgba.iter().flat_map(pixel).collect();
    Image { width_px: linear.width_px, height_px: linear.height_px, rgba: rgba.into() }
}

/// Steps between two half floats.
fn steps(a: f16, b: f16) -> u16 {
    let place = |v: f16| i32::from(v.to_bits() & 0x7fff) * if v.is_sign_negative() { -1 } else { 1 };
    place(a).abs_diff(place(b)) as u16
}
