//! Every look of the shade stage (normals, metals, textures, wires, debug views), GPU against CPU.
//! On the CPU also points that are shaded together against one by one.

use std::borrow::Cow;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{
    CornerValues, DrawPlan, ShadedMaterial, Texture, TextureUse, Textures, flags, samplers, slots,
};

use crate::support::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::shapes::{self, Random};
use crate::support::{scenes, truth};

/// A look, and what makes it.
type Look = (&'static str, fn(&mut ShadedMaterial));

const CHECKER: u32 = 0;
const BUMPS: u32 = 1;
const COARSE: u32 = 2;
const FLAT: u32 = flags::FILL | flags::FACE_NORMALS;
const SECOND: u32 = samplers::SECOND_UVS;
const CUT_OUT: u32 = samplers::CUT_OUT;
const SMOOTH: u32 = flags::FILL | flags::VERTEX_NORMALS;

const LOOKS: &[Look] = &[
    ("derivative", |m| m.flags = flags::FILL | flags::DERIVATIVE_NORMALS),
    ("metal", |m| (m.flags, m.metallic, m.roughness) = (FLAT, 1.0, 0.2)),
    ("rough metal", |m| (m.flags, m.metallic, m.roughness) = (SMOOTH, 0.8, 0.7)),
    ("emissive", |m| (m.flags, m.emissive) = (FLAT, [0.4, 0.1, 0.0])),
    ("colours", |m| m.flags = SMOOTH | flags::VERTEX_COLORS),
    ("colours unlit", |m| m.flags = flags::FILL | flags::VERTEX_COLORS),
    ("colours blended", |m| m.flags = FLAT | flags::VERTEX_COLORS | flags::BLEND),
    ("colours masked", |m| (m.flags, m.alpha_cutoff) = (FLAT | flags::VERTEX_COLORS | flags::MASK, 0.6)),
    ("texture", |m| (m.flags, m.textures[slots::BASE]) = (FLAT, used(CHECKER, 0))),
    ("texture mirrored", |m| (m.flags, m.textures[slots::BASE]) = (SMOOTH, used(CHECKER, 5))),
    ("texture clamped", |m| (m.flags, m.textures[slots::BASE]) = (flags::FILL, used(CHECKER, 10))),
    ("texture nearest", |m| (m.flags, m.textures[slots::BASE]) = (flags::FILL, used(CHECKER, 16))),
    ("texture nearest mixed", |m| (m.flags, m.textures[slots::BASE]) = (FLAT, used(CHECKER, 16 + 1 + 8))),
    ("texture far", |m| (m.flags, m.textures[slots::BASE]) = (flags::FILL, turned(CHECKER, 40.0))),
    ("texture coarse", |m| (m.flags, m.textures[slots::BASE]) = (flags::FILL, turned(COARSE, 0.2))),
    ("texture huge", |m| (m.flags, m.textures[slots::BASE]) = (flags::FILL, turned(CHECKER, 1e30))),
    ("texture masked", |m| {
        (m.flags, m.alpha_cutoff, m.textures[slots::BASE]) = (FLAT | flags::MASK, 0.5, used(CHECKER, 0));
    }),
    ("texture masked and blended", |m| {
        m.flags = SMOOTH | flags::MASK | flags::BLEND | flags::VERTEX_COLORS;
        (m.alpha_cutoff, m.textures[slots::BASE]) = (0.3, used(CHECKER, 0));
    }),
    ("texture cut out", |m| m.textures[slots::BASE] = cut_out(m, used(CHECKER, CUT_OUT))),
    ("texture cut out, nearest", |m| m.textures[slots::BASE] = cut_out(m, used(CHECKER, CUT_OUT | 16))),
    ("texture cut out, far", |m| m.textures[slots::BASE] = cut_out(m, turned(CHECKER, 40.0))),
    ("texture cut out, coarse", |m| m.textures[slots::BASE] = cut_out(m, turned(COARSE, 0.2))),
    ("metallic-roughness texture", |m| {
        (m.flags, m.metallic, m.textures[slots::METALLIC_ROUGHNESS]) = (SMOOTH, 1.0, used(CHECKER, 0));
    }),
    ("normal texture", |m| (m.flags, m.textures[slots::NORMAL]) = (SMOOTH, used(BUMPS, 0))),
    ("normal texture turned", |m| {
        (m.flags, m.metallic, m.textures[slots::NORMAL]) = (SMOOTH, 0.5, turned(BUMPS, -1.5));
        m.normal_scale = 0.6;
    }),
    ("texture of the second coordinates", |m| {
        (m.flags, m.textures[slots::BASE]) = (SMOOTH, used(CHECKER, SECOND));
        (m.textures[slots::NORMAL], m.textures[slots::OCCLUSION_TEXTURE]) = (used(BUMPS, 0), used(CHECKER, 0));
    }),
    ("normal texture of the second coordinates", |m| {
        (m.flags, m.textures[slots::NORMAL]) = (SMOOTH, used(BUMPS, SECOND));
        m.textures[slots::EMISSIVE] = used(CHECKER, SECOND | samplers::NEAREST);
    }),
    ("emissive texture", |m| {
        (m.flags, m.emissive, m.textures[slots::EMISSIVE]) = (FLAT, [0.7, 0.6, 0.3], used(CHECKER, 0));
    }),
    ("wire threshold", |m| wire(m, FLAT | flags::WIRE_THRESHOLD, 4.0)),
    ("wire barycentric", |m| wire(m, FLAT | flags::WIRE_BARYCENTRIC, 2.0)),
    ("wire fwidth-min", |m| wire(m, SMOOTH | flags::WIRE_FWIDTH_MIN, 1.0)),
    ("wire fwidth alone", |m| wire(m, flags::WIRE_FWIDTH, 1.0)),
    ("wire fwidth lit", |m| wire(m, FLAT | flags::WIRE_FWIDTH | flags::WIRE_LIT, 1.0)),
    ("wire lit over texture", |m| {
        wire(m, SMOOTH | flags::WIRE_BARYCENTRIC | flags::WIRE_LIT | flags::BLEND, 3.0);
        (m.emissive, m.textures[slots::BASE]) = ([0.1, 0.1, 0.3], used(CHECKER, 0));
    }),
    ("debug barycentric", |m| debug(m, FLAT, 1)),
    ("debug min-barycentric", |m| debug(m, FLAT, 2)),
    ("debug edge-distance", |m| debug(m, FLAT, 3)),
    ("debug normal", |m| debug(m, SMOOTH, 4)),
    ("debug normal by derivatives", |m| debug(m, flags::FILL | flags::DERIVATIVE_NORMALS, 4)),
    ("debug uv", |m| debug(m, FLAT, 5)),
    ("debug face-orientation", |m| debug(m, FLAT, 6)),
    ("debug vertex-color", |m| debug(m, flags::FILL | flags::VERTEX_COLORS, 7)),
    ("debug under a wire", |m| {
        wire(m, FLAT | flags::WIRE_FWIDTH, 1.0);
        debug(m, m.flags, 4);
    }),
];

const INSIDE: &[(&str, &str)] =
    &[("camera.eye", "0.2,0.35,0.3"), ("camera.target", "-0.8,0,-0.9"), ("camera.fov_deg", "80")];

#[test]
fn every_look_agrees() {
    let Some(gpus) = gpus::gpus() else { return };
    let mut gpu = GpuRenderer::new(gpus[0].clone());
    let mut cpu = CpuRenderer::new(1);
    let (mut cases, mut views) = (0, 0);
    each_view(|view, plan| {
        // The parts test has this view too, and every kernel that a software device compiles takes
        // its time.
        if view == "inside a sheet, 1 samples" {
            return;
        }
        let plain = cpu.draw(plan, &Deadline::default()).unwrap();
        let views_before = views;
        views += 1;
        for (i, (name, look)) in LOOKS.iter().enumerate() {
            // Each look in one of the three views; in all of them in a long run.
            if !truth::is_long() && i % 3 != views_before {
                continue;
            }
            let surface = plan.surface.as_mut().unwrap();
            surface.materials = vec![base_look()];
            look(&mut surface.materials[0]);
            let picture = cpu.draw(plan, &Deadline::default()).unwrap();
            let what = format!("{name}, {view}");
            assert!(Likeness::of(&plain, &picture).differing() > 300, "{what}: the look changes nothing");
            assert!(colors(&picture) > 1, "{what}: blank");
            let other = gpu.draw(plan, &Deadline::default()).unwrap();
            Likeness::of(&picture, &other).assert(Tolerance::TWINS, &what);
            cases += 1;
        }
    });
    assert_eq!(cases, LOOKS.len() * truth::cases(1, 3));
    assert_eq!(LOOKS.len(), 43);
}

#[test]
fn parts_of_different_looks_agree() {
    let Some(gpus) = gpus::gpus() else { return };
    let mut gpu = GpuRenderer::new(gpus[0].clone());
    let mut cpu = CpuRenderer::new(1);
    // Plans of any lifetime may borrow it.
    let materials: &'static [u32] = (0..10_000).map(|t| t / 3 % LOOKS.len() as u32).collect::<Vec<_>>().leak();
    let mut cases = 0;
    each_view(|view, plan| {
        let surface = plan.surface.as_mut().unwrap();
        surface.materials = LOOKS.iter().map(|(_, look)| with(base_look(), *look)).collect();
        let count = surface.face_normals.len();
        surface.triangle_materials = materials[..count].into();
        let masks: Vec<u8> = (0..count).map(|t| [7, 5, 0, 2][t % 4]).collect();
        surface.edge_masks = Cow::Owned(masks);
        let picture = cpu.draw(plan, &Deadline::default()).unwrap();
        assert!(colors(&picture) > 1000, "{view}: too plain");
        Likeness::of(&picture, &gpu.draw(plan, &Deadline::default()).unwrap()).assert(Tolerance::TWINS, view);
        cases += 1;
    });
    assert_eq!(cases, 4);
}

/// On the CPU alone: eight points at a time, on each instruction set, against one by one.
#[test]
fn points_have_the_same_colours_together_and_one_by_one() {
    let mut plain = CpuRenderer::plain(1);
    let mut others: Vec<CpuRenderer> = Isa::available().into_iter().map(|isa| CpuRenderer::with_isa(2, isa)).collect();
    let materials: &'static [u32] = (0..10_000).map(|t| t / 3 % LOOKS.len() as u32).collect::<Vec<_>>().leak();
    let mut cases = 0;
    each_view(|view, plan| {
        let mut agree = |plan: &DrawPlan<'_>, what: &str| {
            let want = plain.draw(plan, &Deadline::default()).unwrap();
            for other in &mut others {
                assert!(other.draw(plan, &Deadline::default()).unwrap() == want, "{what}, {view}");
            }
            cases += 1;
        };
        for (name, look) in LOOKS {
            let surface = plan.surface.as_mut().unwrap();
            surface.materials = vec![with(base_look(), *look)];
            agree(plan, name);
        }
        let surface = plan.surface.as_mut().unwrap();
        surface.materials = LOOKS.iter().map(|(_, look)| with(base_look(), *look)).collect();
        surface.triangle_materials = materials[..surface.face_normals.len()].into();
        agree(plan, "all of them");
    });
    assert_eq!(cases, 4 * (LOOKS.len() + 1));
}

#[test]
fn hostile_coordinates_and_textures_agree() {
    let Some(gpus) = gpus::gpus() else { return };
    let mut cases = 0;
    each_view(|view, plan| {
        let bad: Vec<[f32; 2]> = (0..plan.positions.len())
            .map(|i| [[1e30, -1e30], [f32::MAX, 0.0], [0.5, f32::MIN_POSITIVE], [-0.0, 3e7]][i % 4])
            .collect();
        let surface = plan.surface.as_mut().unwrap();
        surface.uvs = Some(CornerValues { values: bad.into(), triangles: plan.triangles.clone() });
        let uses = [used(CHECKER, 0), turned(CHECKER, f32::MAX), used(COARSE, 5), used(77, 0), used(CHECKER, 16)];
        let look = ShadedMaterial { textures: uses, flags: SMOOTH | flags::MASK, alpha_cutoff: 0.1, ..base_look() };
        surface.materials = vec![ShadedMaterial { emissive: [1e30, 2.0, 0.0], ..look }];
        let cpu = CpuRenderer::new(1).draw(plan, &Deadline::default()).unwrap();
        let gpu = GpuRenderer::new(gpus[0].clone()).draw(plan, &Deadline::default()).unwrap();
        assert!(colors(&cpu) > 1, "{view}: blank");
        Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, view);
        cases += 1;
    });
    assert_eq!(cases, 4);
}

#[test]
fn alpha_that_rounds_below_nothing_agrees() {
    let Some(gpus) = gpus::gpus() else { return };
    let mut gpu = GpuRenderer::new(gpus[0].clone());
    // Alpha is 0 along the upper edge, which runs through pixels' centres: there the third
    // barycentric rounds to either side of 0.
    let corners = |i: u32| {
        let (left, top) = (-60.0 + 2.0 * i as f32, 9.5 * i as f32 - 47.0);
        [[left, top, 0.5], [left + 71.0 + 3.0 * i as f32, top, 0.5], [left + 23.0, top + 9.0, 0.5]]
    };
    let positions: Vec<_> = (0..10).flat_map(corners).collect();
    let triangles: Vec<_> = (0..10).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let values: Vec<_> = [0.0, 0.0, 1.0].repeat(10).into_iter().map(|alpha| [0.9, 0.5, 0.3, alpha]).collect();
    let lit_wire = flags::WIRE_FWIDTH | flags::WIRE_LIT;
    let mut cases = 0;
    for bits in [lit_wire | flags::BLEND, lit_wire | flags::BLEND | flags::MASK, flags::BLEND] {
        for samples in [1, 4, 8, 16] {
            let mut plan = scenes::screen_plan([160, 100], samples, 1.0, &positions, &triangles);
            plan.background = [0.0; 4];
            let surface = plan.surface.as_mut().unwrap();
            surface.colors = Some(CornerValues { values: (&values).into(), triangles: (&triangles).into() });
            let flags = flags::FILL | flags::VERTEX_COLORS | bits;
            surface.materials = vec![ShadedMaterial { flags, wire_thickness: 1.0, ..base_look() }];
            let picture = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
            assert!(colors(&picture) > 15, "{bits}: too plain");
            let other = gpu.draw(&plan, &Deadline::default()).unwrap();
            Likeness::of(&picture, &other).assert(Tolerance::TWINS, &format!("{bits}, {samples} samples"));
            cases += 1;
        }
    }
    assert_eq!(cases, 12);
}

#[test]
fn normals_and_colours_that_go_by_different_indices_agree() {
    let Some(gpus) = gpus::gpus() else { return };
    let (mut gpu, mut cpu) = (GpuRenderer::new(gpus[0].clone()), CpuRenderer::new(1));
    // An index of its own for every corner. Plans of any lifetime may borrow it.
    let corners: &'static [[u32; 3]] = (0..10_000).map(|t| [3 * t + 2, 3 * t, 3 * t + 1]).collect::<Vec<_>>().leak();
    let mut cases = 0;
    each_view(|view, plan| {
        let (own, count) = (plan.triangles.clone(), plan.triangles.len());
        let surface = plan.surface.as_mut().unwrap();
        surface.materials = vec![ShadedMaterial { flags: SMOOTH | flags::VERTEX_COLORS, ..base_look() }];
        let by_position = surface.vertex_normals.clone().unwrap();
        assert!(std::ptr::eq(&by_position.triangles[..], &own[..]), "{view}: the normals have an index of their own");
        let all: Vec<[f32; 3]> = own.iter().flatten().map(|&v| by_position.values[v as usize]).collect();
        let turned: Vec<_> = (0..count).flat_map(|t| [all[3 * t + 1], all[3 * t + 2], all[3 * t]]).collect();
        let by_corner = CornerValues { values: turned.into(), triangles: corners[..count].into() };
        let paint: Vec<_> = (0..3 * count).map(|c| [(c % 3) as f32 / 2.0, (c % 7) as f32 / 6.0, 0.5, 1.0]).collect();
        let paint = CornerValues { values: paint.into(), triangles: corners[..count].into() };
        let mut pictures = Vec::new();
        for normals in [by_position, by_corner] {
            let surface = plan.surface.as_mut().unwrap();
            (surface.vertex_normals, surface.colors) = (Some(normals), Some(paint.clone()));
            let picture = cpu.draw(plan, &Deadline::default()).unwrap();
            assert!(colors(&picture) > 100, "{view}: too plain");
            Likeness::of(&picture, &gpu.draw(plan, &Deadline::default()).unwrap()).assert(Tolerance::TWINS, view);
            pictures.push(picture);
            cases += 1;
        }
        assert_eq!(pictures[0].rgba, pictures[1].rgba, "{view}: the same normals by another index");
    });
    assert_eq!(cases, 8);
}

/// Two meshes, the second from inside (where triangles are clipped), with one sample a pixel and
/// with four.
fn each_view(mut each: impl FnMut(&str, &mut DrawPlan<'_>)) {
    for (name, obj, camera) in [("torus", shapes::torus(16), &[][..]), ("inside a sheet", shapes::sheet(12), INSIDE)] {
        let mesh = scenes::mesh(&obj);
        for samples in ["1", "4"] {
            let own =
                [("style", "smooth"), ("surface.crease_angle_deg", "180"), ("size", "113x83"), ("samples", samples)];
            let keys = [&own, camera].concat();
            let spec = scenes::spec(&keys);
            let mut plan = scenes::plan(&mesh, &spec);
            assert_eq!(plan.projection.clip, !camera.is_empty());
            dress(&mesh, &mut plan);
            each(&format!("{name}, {samples} samples"), &mut plan);
        }
    }
}

/// Everything that a material can read.
fn dress<'a>(mesh: &'a Mesh, plan: &mut DrawPlan<'a>) {
    plan.background = [0.0; 4];
    let mut random = Random(7);
    let mut value = |from: f64| random.range(from, 1.0) as f32;
    let colors: Vec<_> = mesh.positions.iter().map(|_| [value(0.0), value(0.0), value(0.0), value(0.2)]).collect();
    let uvs: Vec<_> = mesh.positions.iter().map(|p| [2.5 * p[0] + 0.3 * p[1], 2.0 * p[2] - 1.7 * p[1]]).collect();
    let second: Vec<_> = mesh.positions.iter().map(|p| [1.1 - 3.0 * p[1], 1.3 * p[0] + 0.7 * p[2]]).collect();
    let surface = plan.surface.as_mut().unwrap();
    surface.face_normals = (&mesh.face_normals).into();
    surface.colors = Some(CornerValues { values: colors.into(), triangles: (&mesh.triangles).into() });
    surface.uvs = Some(CornerValues { values: uvs.into(), triangles: (&mesh.triangles).into() });
    surface.second_uvs = second.into();
    surface.textures = textures().into();
}

fn base_look() -> ShadedMaterial {
    ShadedMaterial { roughness: 0.5, wire_smoothing: 1.0, ..ShadedMaterial::unlit([0.7, 0.6, 0.5, 0.9]) }
}

fn with(mut look: ShadedMaterial, change: fn(&mut ShadedMaterial)) -> ShadedMaterial {
    change(&mut look);
    look
}

/// The use of a cut-out texture, and the bits of a material that has one.
fn cut_out(material: &mut ShadedMaterial, texture: TextureUse) -> TextureUse {
    material.flags = FLAT | flags::BLEND;
    TextureUse { sampler: texture.sampler | CUT_OUT, ..texture }
}

fn used(texture: u32, sampler: u32) -> TextureUse {
    TextureUse { texture, sampler, ..TextureUse::NONE }
}

fn turned(texture: u32, scale: f32) -> TextureUse {
    let transform = [[0.8 * scale, 0.6 * scale, 0.1], [-0.6 * scale, 0.8 * scale, 7.3]];
    TextureUse { transform, texture, sampler: 0 }
}

fn wire(look: &mut ShadedMaterial, bits: u32, thickness: f32) {
    (look.flags, look.wire_color, look.wire_thickness) = (bits, [0.5, 0.0, 0.2, 0.8], thickness);
}

fn debug(look: &mut ShadedMaterial, bits: u32, view: u32) {
    look.flags = bits | view << flags::DEBUG_SHIFT;
}

fn colors(image: &Image) -> usize {
    image.rgba.chunks(4).collect::<std::collections::HashSet<_>>().len()
}

/// A checker of two colours, one half transparent; bumps; and the checker from its third level on.
pub fn textures() -> Textures {
    let mut textures = Textures::default();
    let checker = |x: u32, y: u32| {
        if (x / 4 + y / 4).is_multiple_of(2) { [0.9, 0.8, 0.3, 1.0] } else { [0.1, 0.3, 0.7, 0.25] }
    };
    let bump = |x: u32, y: u32| {
        let wave = |v: u32| (v as f32 * 0.4).sin() * 0.3;
        [0.5 + wave(x), 0.5 + wave(y + x), 0.9, 1.0]
    };
    add(&mut textures, [64, 40], 0, checker);
    add(&mut textures, [33, 33], 0, bump);
    add(&mut textures, [64, 40], 2, checker);
    textures
}

fn add(textures: &mut Textures, size: [u32; 2], first_level: u32, texel: impl Fn(u32, u32) -> [f32; 4]) {
    let levels = size[0].max(size[1]).ilog2() + 1;
    let mut texels = Vec::new();
    for level in first_level..levels {
        let [w, h] = size.map(|side| (side >> level).max(1));
        for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
            let mut sum = [0.0; 4];
            let (from, to) = ([x * size[0] / w, y * size[1] / h], [(x + 1) * size[0] / w, (y + 1) * size[1] / h]);
            for (i, j) in (from[0]..to[0]).flat_map(|i| (from[1]..to[1]).map(move |j| (i, j))) {
                sum = std::array::from_fn(|k| sum[k] + texel(i, j)[k]);
            }
            let count = ((to[0] - from[0]) * (to[1] - from[1])) as f32;
            texels.push(sum.map(|v| half(v / count)));
        }
    }
    let [width, height] = size;
    textures.images.push(Texture { width, height, first_level, levels, texels: texels.into() });
}

/// For 2^-14 to 1: rounded down.
fn half(v: f32) -> u16 {
    if v < 6.2e-5 { 0 } else { ((v.to_bits() >> 13) - (112 << 10)) as u16 }
}
