//! Textures on a square that faces the viewer: the place of each texel, the blend between levels,
//! and the direction in which bumps lean.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{
    CornerValues, DrawPlan, Lamp, Lights, ShadedMaterial, Texture, TextureUse, Textures, flags, slots,
};

use crate::support::scenes;

/// The square fills the picture: a pixel a texel.
const SIDE: u32 = 16;
const POSITIONS: [[f32; 3]; 4] = [[-8.0, -8.0, 0.5], [8.0, -8.0, 0.5], [8.0, 8.0, 0.5], [-8.0, 8.0, 0.5]];
/// Counter-clockwise on screen, y down.
const TRIANGLES: [[u32; 3]; 2] = [[0, 2, 1], [0, 3, 2]];
const ONE: u16 = 0x3C00;

/// The first texture coordinate and its step, in texels; the sampler; and the texel that is in
/// column or row k.
type Case = (f32, f32, u32, fn(i32) -> i32);

#[test]
fn texels_are_where_they_belong() {
    let cases: [Case; 5] = [
        (0.0, 1.0, 0, |k| k),
        (-20.0, 1.0, 0, |k| (k - 20).rem_euclid(16)),
        (-20.0, 1.0, 5, |k| {
            let m = (k - 20).rem_euclid(32);
            if m < 16 { m } else { 31 - m }
        }),
        (-4.0, 1.0, 10, |k| (k - 4).clamp(0, 15)),
        (8.0, -1.0, 16, |k| (7 - k).rem_euclid(16)),
    ];
    let mut compared = 0;
    for (from, step, sampler, expected) in cases {
        let uvs = square_uvs(from / 16.0, (from + 16.0 * step) / 16.0);
        let used = TextureUse { texture: 0, sampler, ..TextureUse::NONE };
        let mut look = ShadedMaterial::unlit([1.0; 4]);
        look.textures[slots::BASE] = used;
        let picture = draw(&uvs, look, image(SIDE, |x, y| [ramp(x), ramp(y), 0, ONE]));
        for (y, x) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (y, x))) {
            let [r, g, ..] = picture.pixel(x, y);
            let want = [expected(x as i32), expected(y as i32)].map(|v| level(v as u32));
            assert_eq!([r, g], want, "sampler {sampler} from {from}: {x}, {y}");
            compared += 1;
        }
    }
    assert_eq!(compared, 5 * SIDE * SIDE);
}

#[test]
fn smaller_levels_blend_without_steps() {
    // One level red, the next blue, and so on: the mixture tells the level.
    let mut texels = Vec::new();
    for k in 0..5_u32 {
        let side = 16 >> k;
        texels.extend((0..side * side).map(|_| [ramp(k), 0, 0, ONE]));
    }
    let image = Texture { width: 16, height: 16, first_level: 0, levels: 5, texels: texels.into() };
    let textures = Textures { images: vec![image] };
    let mut look = ShadedMaterial::unlit([1.0; 4]);
    look.textures[slots::BASE] = TextureUse { texture: 0, ..TextureUse::NONE };
    let mut last = 0.0;
    let mut checked = 0;
    for i in 0..60 {
        let texels_a_pixel = 2.0_f32.powf(i as f32 * 0.1 - 1.0);
        let picture = draw(&square_uvs(0.0, texels_a_pixel), look, textures.clone());
        let level = f64::from(linear(picture.pixel(3, 5)[0])) * 16.0;
        let want = f64::from(texels_a_pixel).log2().clamp(0.0, 4.0);
        assert!((level - want).abs() < 0.08, "{texels_a_pixel} texels a pixel: level {level}, want {want}");
        assert!(level >= last - 1e-6);
        last = level;
        checked += 1;
    }
    assert_eq!(checked, 60);
}

#[test]
fn a_bump_leans_to_where_the_texture_says() {
    // Leaning right and up in the image, by 45 degrees in all.
    let leaning = |x: f32, y: f32| image(1, |_, _| [half(0.5 + 0.5 * x), half(0.5 + 0.5 * y), half(0.9), ONE]);
    let brightness = |uvs: &[[f32; 2]], textures: Textures, to_light: [f32; 3]| {
        let mut look = ShadedMaterial { flags: flags::FILL | flags::FACE_NORMALS, ..ShadedMaterial::unlit([0.5; 4]) };
        look.textures[slots::NORMAL] = TextureUse { texture: 0, ..TextureUse::NONE };
        lit(uvs, look, textures, to_light)
    };
    let upright = square_uvs(0.0, 1.0);
    let mirrored: Vec<_> = upright.iter().map(|[u, v]| [-u, *v]).collect();
    let flat = brightness(&upright, leaning(0.0, 0.0), RIGHT);
    let checks = [
        (&upright, 0.5, 0.0, RIGHT, true),
        (&upright, -0.5, 0.0, RIGHT, false),
        (&upright, 0.0, 0.5, UP, true),
        (&upright, 0.0, -0.5, UP, false),
        (&mirrored, 0.5, 0.0, RIGHT, false),
        (&mirrored, -0.5, 0.0, RIGHT, true),
        (&mirrored, 0.0, 0.5, UP, true),
    ];
    for (uvs, x, y, to_light, is_brighter) in checks {
        let seen = brightness(uvs, leaning(x, y), to_light);
        assert!(if is_brighter { seen > flat + 10 } else { seen + 10 < flat }, "{x} {y}: {seen} against {flat}");
    }
    let nowhere = vec![[0.3, 0.3]; 4];
    assert_eq!(brightness(&nowhere, leaning(0.5, 0.0), RIGHT), flat, "coordinates without direction bump nothing");
}

const RIGHT: [f32; 3] = [0.6, 0.0, 0.8];
const UP: [f32; 3] = [0.0, -0.6, 0.8];

/// Red of the middle under one lamp.
fn lit(uvs: &[[f32; 2]], look: ShadedMaterial, textures: Textures, to_light: [f32; 3]) -> u8 {
    let lamp = Lamp { to_light, halfway: [0.0, 0.0, 1.0], strength: 0.8 };
    let normals = [[0.0, 0.0, 1.0]; 2];
    let mut plan = plan(uvs, look, textures);
    let surface = plan.surface.as_mut().unwrap();
    surface.lights = Lights { lamps: vec![lamp], ambient: 0.1 };
    surface.face_normals = (&normals).into();
    CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap().pixel(7, 7)[0]
}

fn draw(uvs: &[[f32; 2]], look: ShadedMaterial, textures: Textures) -> Image {
    CpuRenderer::new(1).draw(&plan(uvs, look, textures), &Deadline::default()).unwrap()
}

fn plan<'a>(uvs: &'a [[f32; 2]], look: ShadedMaterial, textures: Textures) -> DrawPlan<'a> {
    let mut plan = scenes::screen_plan([SIDE; 2], 1, 1.0, &POSITIONS, &TRIANGLES);
    let surface = plan.surface.as_mut().unwrap();
    surface.materials = vec![look];
    surface.uvs = Some(CornerValues { values: uvs.into(), triangles: (&TRIANGLES).into() });
    surface.textures = textures.into();
    plan
}

/// u to the right and v downwards over the square.
fn square_uvs(from: f32, to: f32) -> Vec<[f32; 2]> {
    vec![[from, from], [to, from], [to, to], [from, to]]
}

fn image(side: u32, texel: impl Fn(u32, u32) -> [u16; 4]) -> Textures {
    let texels: Vec<_> = (0..side).flat_map(|y| (0..side).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
    Textures { images: vec![Texture { width: side, height: side, first_level: 0, levels: 1, texels: texels.into() }] }
}

/// k / 16, exactly.
fn ramp(k: u32) -> u16 {
    half(k as f32 / 16.0)
}

fn half(v: f32) -> u16 {
    if v == 0.0 { 0 } else { ((v.to_bits() >> 13) - (112 << 10)) as u16 }
}

/// The byte that `ramp(k)` is stored as.
fn level(k: u32) -> u8 {
    let v = f64::from(k) / 16.0;
    let v = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (v * 255.0).round() as u8
}

fn linear(byte: u8) -> f32 {
    meshsnap_render::srgb::srgb_to_linear(f64::from(byte) / 255.0) as f32
}
