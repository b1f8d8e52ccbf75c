//! The ground's shadow: dark where the mesh stands, soft around it, no part of the mesh's own picture, and
//! nothing from below; and the back-ends agree.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::{Deadline, Limits};

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::shapes;

const SHADOW: (&str, &str) = ("scene.ground", "shadow");

fn draw(obj: &str, keys: &[(&str, &str)]) -> Image {
    let mesh = scenes::mesh(obj);
    let spec = scenes::spec(&[&[("size", "120x100"), ("background", "transparent")], keys].concat());
    let plan = scenes::plan(&mesh, &spec);
    let image = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
    let other = CpuRenderer::with_isa(2, Isa::baseline()).draw(&plan, &Deadline::default()).unwrap();
    assert!(image.rgba == other.rgba);
    image
}

/// Pixels of a picture with a shadow that are shadow alone: black, and clear in the other picture.
fn shadow(with: &Image, without: &Image) -> Vec<u8> {
    let pairs = with.rgba.chunks(4).zip(without.rgba.chunks(4));
    pairs.filter(|(with, without)| without[3] == 0 && with[3] > 0).map(|(with, _)| with[3]).collect()
}

#[test]
fn the_mesh_keeps_its_pixels_and_gets_a_soft_black_shadow() {
    for style in ["flat", "smooth", "wire", "outline", "technical"] {
        for obj in [shapes::cube(), shapes::torus(24)] {
            let without = draw(&obj, &[("style", style), ("camera.margin", "0.2")]);
            let with = draw(&obj, &[("style", style), ("camera.margin", "0.2"), SHADOW]);
            let has_lines = !["flat", "smooth"].contains(&style);
            for (with, without) in with.rgba.chunks(4).zip(without.rgba.chunks(4)) {
                // Where a line lies over the border of the surface, the shadow is a part of what it mixes.
                let most = if has_lines { 16 } else { 1 };
                let same = with.iter().zip(without).all(|(a, b)| a.abs_diff(*b) <= most);
                assert!(without[3] < 255 || same, "{style}: {without:?} became {with:?}");
                assert!(without[3] > 0 || with[..3] == [0; 3], "{style}: {with:?}");
            }
            let alpha = shadow(&with, &without);
            assert!(alpha.len() > 40, "{style}: {} pixels of shadow", alpha.len());
            let (faint, dark) = (alpha.iter().filter(|a| **a < 20).count(), alpha.iter().filter(|a| **a > 50).count());
            // Lines along the foot cover where it is darkest.
            assert!(
                faint > 15 && (dark > 5 || has_lines) && alpha.iter().all(|a| *a <= 185),
                "{style}: {faint} faint, {dark} dark"
            );
        }
    }
}

#[test]
fn nothing_shows_from_below_without_a_surface_or_by_default() {
    let mut cases = 0;
    for keys in [
        [("style", "flat"), ("view", "bottom")],
        [("style", "outline"), ("camera.elevation_deg", "-40")],
        [("style", "wireframe"), ("view", "iso")],
        [("surface", "null"), ("view", "iso")],
    ] {
        let obj = shapes::gear(7);
        let without = draw(&obj, &keys);
        assert!(without.rgba == draw(&obj, &[&keys[..], &[SHADOW]].concat()).rgba, "{keys:?}");
        assert!(without.rgba == draw(&obj, &[&keys[..], &[("scene.ground", "none")]].concat()).rgba);
        cases += 1;
    }
    assert_eq!(cases, 4);
}

#[test]
fn the_plane_follows_the_up_axis_and_lies_under_the_lowest_point() {
    for up in ["y", "z", "-y", "-z", "x", "-x"] {
        let obj = shapes::cube();
        let keys = [("style", "flat"), ("up", up), ("camera.elevation_deg", "20"), ("camera.margin", "0.2")];
        let (without, with) = (draw(&obj, &keys), draw(&obj, &[&keys[..], &[SHADOW]].concat()));
        let rows = |top: u32, bottom: u32| -> usize {
            let at = |y: u32| 4 * (y * with.width_px) as usize..4 * ((y + 1) * with.width_px) as usize;
            let part =
                |image: &Image, y: u32| Image { width_px: 120, height_px: 1, rgba: image.rgba[at(y)].to_vec().into() };
            (top..bottom).map(|y| shadow(&part(&with, y), &part(&without, y)).len()).sum()
        };
        assert_eq!(rows(0, 30), 0, "{up}");
        assert!(rows(50, 100) > 60, "{up}");
    }
}

#[test]
fn odd_meshes_and_small_budgets_are_no_panic() {
    let meshes = [
        ("a point", "v 0 0 0\nv 1 0 0\nv 0 0 1\np 1 2 3\n"),
        ("a line", "v 0 0 0\nv 1 0 0\nl 1 2\n"),
        ("an upright line", "v 0 0 0\nv 0 1 0\nl 1 2\n"),
        ("an upright face", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("a flat face", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 3 2 1\n"),
        ("a needle", "v 0 0 0\nv 1e-30 1 0\nv 0 1 1e-30\nf 3 2 1\n"),
    ];
    for (name, obj) in meshes {
        for view in ["iso", "top", "front"] {
            println!("{name} {view}");
            draw(obj, &[SHADOW, ("view", view)]);
            draw(obj, &[SHADOW, ("camera.eye", "0.1,0.1,0.1"), ("camera.target", "0,0,0"), ("camera.fov_deg", "170")]);
        }
    }
    let obj = shapes::torus(40);
    let mesh = scenes::mesh(&obj);
    let spec = scenes::spec(&[SHADOW, ("size", "16"), ("style", "flat")]);
    let mut refused = 0;
    for kib in 1..2000 {
        let limits = Limits::default().with(|limits| limits.memory_bytes = kib << 10);
        if let Err(error) = scenes::try_plan(&mesh, &spec, &limits, &Deadline::default(), &[]) {
            refused += usize::from(error.to_string().contains("ground"));
        }
    }
    assert!(refused > 0, "the ground's memory is paid for");
}

#[test]
fn grounds_are_the_same_on_both_back_ends() {
    let Some(gpus) = gpus() else { return };
    let mut renderer = GpuRenderer::new(gpus[0].clone());
    for keys in [
        &[("style", "smooth")][..],
        &[("style", "outline"), ("samples", "1")],
        &[("style", "wire"), ("wire.method", "fwidth"), ("wire.hidden", "show")],
        &[("style", "xray"), ("surface.cull", "front")],
        &[("style", "flat"), ("camera.projection", "orthographic"), ("surface.debug", "aspect")],
    ] {
        let obj = shapes::gear(9);
        let mesh = scenes::mesh(&obj);
        let spec = scenes::spec(&[keys, &[SHADOW, ("size", "120x90")]].concat());
        let plan = scenes::plan(&mesh, &spec);
        let cpu = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
        let gpu = renderer.draw(&plan, &Deadline::default()).unwrap();
        Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, &format!("{keys:?}"));
    }
}
