//! What earlier pictures found out about a mesh changes no later one: no byte, no skip, no refusal.

use std::sync::Arc;

use image::ImageFormat;
use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::{AtomicsChoice, Gpu, GpuKind, GpuRenderer};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{self, PlanError, Prepared};
use meshsnap_render::scene::Scene;
use meshsnap_render::spec::Spec;

use rayon::prelude::*;
use serde_json::json;

use crate::render::textures::levels::{encode, model, model_of};
use crate::support::gpus::gpus;
use crate::support::scenes::{self, SCENES};
use crate::support::server::CUBE_OBJ;
use crate::support::shapes;

/// Draws a mesh as it was found before, and anew.
fn is_drawn_alike(renderer: &mut dyn Renderer, mesh: &Mesh, spec: &Spec, prepared: &Prepared, what: &str) {
    let (limits, deadline) = (Limits::default(), Deadline::default());
    let (mut fresh, mut warm) = (Budget::new(&limits), Budget::new(&limits));
    let scene = Scene::new(mesh, spec, &mut fresh).unwrap();
    let plan = plan::build(&scene, &mut fresh, &deadline).unwrap();
    let scene = Scene::new(mesh, spec, &mut warm).unwrap();
    let again = plan::build_from(&scene, prepared, &mut warm, &deadline).unwrap();
    assert_eq!((&again.skips, warm.spent_bytes()), (&plan.skips, fresh.spent_bytes()), "{what}");
    assert!(renderer.draw(&again, &deadline).unwrap() == renderer.draw(&plan, &deadline).unwrap(), "{what}");
}

#[test]
fn scenes_are_the_same_whatever_is_known() {
    let mut cpu = CpuRenderer::new(2);
    let (mut drawn, mut known) = (0, 0);
    for scene in SCENES {
        let mesh = scenes::mesh(&(scene.obj)());
        let prepared = Prepared::default();
        // Another look and another camera come first, and the scene twice.
        for keys in
            [&[("style", "outline"), ("size", "40")][..], &[("style", "smooth"), ("size", "40"), ("view", "top")]]
        {
            is_drawn_alike(&mut cpu, &mesh, &scenes::spec(keys), &prepared, scene.name);
        }
        let before = prepared.bytes();
        for _ in 0..2 {
            is_drawn_alike(&mut cpu, &mesh, &scene.spec(), &prepared, scene.name);
            drawn += 1;
        }
        known += usize::from(before > 0);
    }
    assert_eq!((drawn, known), (2 * SCENES.len(), SCENES.len()));
}

/// Other crease angles, of all or of some materials, and back again; with normals by position, and with
/// texture coordinates that have an order of their own.
#[test]
fn creases_are_those_that_each_picture_asks_for() {
    let cube = scenes::mesh(&String::from_utf8_lossy(CUBE_OBJ));
    let balls = scenes::mesh(&shapes::two_balls());
    let picture = image::RgbImage::from_fn(16, 16, |x, y| image::Rgb([(x * y) as u8, x as u8, (x ^ y) as u8]));
    let textured = model_of(&encode(&picture.into(), ImageFormat::Png));
    let mut renderers: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(2))];
    let on_gpus = gpus().into_iter().flatten().map(|gpu| Box::new(GpuRenderer::new(gpu.clone())) as Box<dyn Renderer>);
    renderers.extend(on_gpus);
    let mut pictures = std::collections::BTreeSet::new();
    let mut drawn = 0;
    for renderer in &mut renderers {
        for mesh in [&cube, &balls, &textured] {
            let prepared = Prepared::default();
            for angle in ["30", "30", "180", "180", "30", "10", "30"] {
                let other = format!(r#"{{"left":{{"surface":{{"crease_angle_deg":{}}}}}}}"#, 3 * drawn % 180);
                for materials in ["{}", &other] {
                    let keys = [("style", "smooth"), ("size", "40"), ("surface.crease_angle_deg", angle)];
                    let spec = scenes::spec(&[&keys[..], &[("materials", materials)]].concat());
                    is_drawn_alike(&mut **renderer, mesh, &spec, &prepared, angle);
                    let mut budget = Budget::new(&Limits::default());
                    let scene = Scene::new(mesh, &spec, &mut budget).unwrap();
                    let plan = plan::build_from(&scene, &prepared, &mut budget, &Deadline::default()).unwrap();
                    pictures.insert(renderer.draw(&plan, &Deadline::default()).unwrap().rgba.into_vec());
                    drawn += 1;
                }
            }
        }
    }
    assert_eq!(drawn, renderers.len() * 3 * 7 * 2);
    assert!(pictures.len() > 8, "{} pictures: the angles change nothing", pictures.len());
}

/// From the third picture on, a mesh's lists are on the device already.
#[test]
fn what_stays_on_a_gpu_changes_no_pixel() {
    let Some(gpus) = gpus() else { return };
    let picture = image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([(x * y) as u8, x as u8, (x ^ y) as u8]));
    let textured = model_of(&encode(&picture.into(), ImageFormat::Png));
    let mut meshes = vec![(textured, vec![scenes::spec(&[("style", "smooth"), ("size", "64")])], Prepared::default())];
    for scene in SCENES.iter().step_by(6) {
        let outline = scenes::spec(&[("style", "outline"), ("size", "40")]);
        meshes.push((scenes::mesh(&(scene.obj)()), vec![scene.spec(), outline], Prepared::default()));
    }
    let mut drawn = 0;
    for gpu in gpus {
        let mut renderer = GpuRenderer::new(gpu.clone());
        for round in 0..4 {
            for (mesh, specs, prepared) in &meshes {
                for spec in specs {
                    is_drawn_alike(&mut renderer, mesh, spec, prepared, &format!("round {round}"));
                    drawn += 1;
                }
            }
        }
    }
    assert!(drawn >= 4 * (1 + 2 * 6), "{drawn}");
    assert!(gpus.iter().all(|gpu| gpu.resident_bytes() > 1000), "nothing stayed");
    // Meshes of one size come and go, so that one lies where another did.
    let mut renderer = GpuRenderer::new(gpus[0].clone());
    for i in 0..24 {
        let prepared = Prepared::default();
        let mesh = scenes::mesh(&format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 {} 1\nf 1 2 3\nf 1 2 4\n", 1 + i % 5));
        for _ in 0..3 {
            is_drawn_alike(&mut renderer, &mesh, &scenes::spec(&[("size", "24")]), &prepared, "a short life");
        }
    }
}

#[test]
fn a_gpu_without_a_renderer_keeps_no_buffers_for_jobs() {
    if gpus().is_none() {
        return;
    }
    let gpu = Arc::new(Gpu::open(GpuKind::Any, AtomicsChoice::Best, None).unwrap());
    let mesh = scenes::mesh("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let mut renderers = [GpuRenderer::new(gpu.clone()), GpuRenderer::new(gpu.clone())].into_iter();
    for left in [1, 0] {
        let mut renderer = renderers.next().unwrap();
        is_drawn_alike(&mut renderer, &mesh, &scenes::spec(&[("size", "24")]), &Prepared::default(), "spare");
        assert!(gpu.spare_bytes() > 0);
        drop(renderer);
        assert_eq!(gpu.spare_bytes() > 0, left > 0, "{left} left");
    }
}

#[test]
fn textures_are_decoded_again_only_where_finer_levels_are_needed() {
    let picture = image::RgbImage::from_fn(512, 512, |x, y| image::Rgb([(x * y) as u8, x as u8, (x ^ y) as u8]));
    let mesh = model_of(&encode(&picture.into(), ImageFormat::Png));
    let mut cpu = CpuRenderer::new(2);
    let prepared = Prepared::default();
    let mut bytes = Vec::new();
    // At a slant, finer levels are needed: those views are smaller.
    for (size, view) in [("48", "front"), ("24", "iso"), ("200", "front"), ("48", "front"), ("100", "iso")] {
        let spec = scenes::spec(&[("style", "smooth"), ("size", size), ("view", view)]);
        is_drawn_alike(&mut cpu, &mesh, &spec, &prepared, size);
        bytes.push(prepared.bytes());
    }
    assert!(bytes[0] > 0 && bytes[2] > bytes[1], "{bytes:?}");
    assert_eq!([bytes[1], bytes[3], bytes[4]], [bytes[0], bytes[2], bytes[2]], "{bytes:?}");
}

#[test]
fn a_budget_refuses_in_the_same_words() {
    let scene = SCENES.iter().find(|scene| scene.name == "torus-smooth").unwrap();
    let mesh = scenes::mesh(&(scene.obj)());
    let spec = scenes::spec(&[("style", "outline"), ("outline.method", "contour"), ("size", "40")]);
    let build = |prepared: &Prepared, memory_bytes: u64| -> Result<u64, PlanError> {
        let mut budget = Budget::new(&Limits::default().with(|limits| limits.memory_bytes = memory_bytes));
        let scene = Scene::new(&mesh, &spec, &mut budget)?;
        plan::build_from(&scene, prepared, &mut budget, &Deadline::default())?;
        Ok(budget.spent_bytes())
    };
    let warm = Prepared::default();
    let needed = build(&warm, u64::MAX).unwrap();
    let mut refused = 0;
    for step in 0..200 {
        let bytes = needed * step / 200;
        let (cold, again) = (build(&Prepared::default(), bytes), build(&warm, bytes));
        assert_eq!(cold.as_ref().unwrap_err().to_string(), again.unwrap_err().to_string(), "{bytes} bytes");
        refused += 1;
    }
    assert_eq!((refused, build(&warm, needed).unwrap()), (200, needed));
}

/// So large that there is no room for the finest level, which a close view asks for.
#[test]
fn textures_that_do_not_fit_are_kept_as_they_are() {
    let picture = image::RgbImage::from_fn(4096, 4096, |x, y| image::Rgb([(x ^ y) as u8, (x >> 4) as u8, y as u8]));
    let mesh = model_of(&encode(&picture.into(), ImageFormat::Png));
    let mut cpu = CpuRenderer::new(2);
    let prepared = Prepared::default();
    let close = [("camera.eye", "0.3,0.3,0.01"), ("camera.target", "0.3,0.3,0")];
    let mut bytes = Vec::new();
    for near in [&close[..], &close, &[], &close] {
        let spec = scenes::spec(&[&[("style", "smooth"), ("size", "64"), ("surface.shading", "unlit")], near].concat());
        is_drawn_alike(&mut cpu, &mesh, &spec, &prepared, "a large texture");
        bytes.push(prepared.bytes());
    }
    // All levels but the finest, and a table of one image.
    let levels = bytes_of_levels_from(2048);
    assert!(bytes.iter().all(|bytes| (levels..levels + 1000).contains(bytes)), "{bytes:?}");
}

/// Looks that sample different images of a mesh, in turns.
#[test]
fn looks_in_turns_decode_nothing_again() {
    let mesh = model_with_two_images();
    let looks: Vec<Spec> = [
        &[("style", "smooth")][..],
        &[("style", "smooth"), ("surface.shading", "unlit")],
        &[("style", "smooth"), ("view", "top"), ("size", "32")],
        &[("style", "flat")],
        &[("style", "wire")],
    ]
    .iter()
    .map(|keys| scenes::spec(&[&[("size", "64")], *keys].concat()))
    .collect();
    let textures = |spec: &Spec, prepared: &Prepared| {
        let mut budget = Budget::new(&Limits::default());
        let scene = Scene::new(&mesh, spec, &mut budget).unwrap();
        let plan = plan::build_from(&scene, prepared, &mut budget, &Deadline::default()).unwrap();
        plan.surface.map(|surface| surface.textures)
    };
    let prepared = Prepared::default();
    let mut first = Vec::new();
    for look in &looks {
        first.push(textures(look, &prepared));
    }
    let bytes = prepared.bytes();
    let counts: Vec<usize> = first.iter().map(|of| of.as_ref().map_or(0, |of| of.images.len())).collect();
    assert_eq!(counts[..3], [2, 1, 2], "lit, unlit, from afar");
    let [lit, unlit, afar] = [0, 1, 2].map(|look: usize| first[look].as_ref().unwrap());
    assert!(Arc::ptr_eq(lit, afar), "finer levels than needed change nothing");
    let places = [lit, unlit].map(|of| of.images.iter().map(|image| image.texels.as_ptr()).collect::<Vec<_>>());
    assert!(places[0].contains(&places[1][0]), "an image of both is in memory once");
    let mut found = 0;
    for (look, first) in (0..3).flat_map(|_| looks.iter().zip(&first)) {
        let again = textures(look, &prepared);
        let is_same = first.iter().zip(&again).all(|(first, again)| Arc::ptr_eq(first, again));
        // A look without textures has an empty list of its own.
        assert!(is_same || first.as_ref().is_some_and(|first| first.images.is_empty()), "{look:?}");
        found += usize::from(is_same);
    }
    assert!(found >= 9 && prepared.bytes() == bytes, "{found} found");

    let mut renderers: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(2))];
    let on_gpus = gpus().into_iter().flatten().map(|gpu| Box::new(GpuRenderer::new(gpu.clone())) as Box<dyn Renderer>);
    renderers.extend(on_gpus);
    for renderer in &mut renderers {
        for look in (0..3).flat_map(|_| &looks) {
            is_drawn_alike(&mut **renderer, &mesh, look, &prepared, "in turns");
        }
    }
}

/// Half floats of all levels of a square texture.
fn bytes_of_levels_from(side: u64) -> u64 {
    (0..=side.ilog2()).map(|level| 8 * (side >> level).pow(2)).sum()
}

/// A triangle with an image that is read in two ways: as light that it emits, and as normals.
fn model_with_two_images() -> Mesh {
    let picture = image::RgbImage::from_fn(128, 128, |x, y| image::Rgb([(x * y) as u8, x as u8, (x ^ y) as u8]));
    let picture = encode(&picture.into(), ImageFormat::Png);
    let material =
        json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 }, "normalTexture": { "index": 0 } });
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    model(&[corners], &[[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]], &picture, material)
}

/// Two images, which a tight budget decodes one after the other: what an easy picture left behind
/// changes nothing for one that has little room, or the other way round.
#[test]
fn a_budget_refuses_textures_alike() {
    let mesh = model_with_two_images();
    let spec = scenes::spec(&[("style", "smooth"), ("size", "200")]);
    let build = |prepared: &Prepared, memory_bytes: u64| -> Result<u64, String> {
        let mut budget = Budget::new(&Limits::default().with(|limits| limits.memory_bytes = memory_bytes));
        let scene = Scene::new(&mesh, &spec, &mut budget).map_err(|error| error.to_string())?;
        let plan = plan::build_from(&scene, prepared, &mut budget, &Deadline::default());
        plan.map_err(|error| error.to_string()).map(|_| budget.spent_bytes())
    };
    let roomy = Prepared::default();
    let most = build(&roomy, u64::MAX).unwrap();
    let tight = (0..=400).find_map(|step| {
        let prepared = Prepared::default();
        build(&prepared, most / 2 + most * step / 800).ok().map(|_| prepared)
    });
    let (tight, mut seen) = (tight.unwrap(), [0; 2]);
    for step in 0..=400 {
        let bytes = most / 2 + most * step / 800;
        let cold = build(&Prepared::default(), bytes);
        assert_eq!([build(&roomy, bytes), build(&tight, bytes)], [cold.clone(), cold.clone()], "{bytes} bytes");
        seen[usize::from(cold.is_ok_and(|spent| spent < most))] += 1;
    }
    assert!(seen[1] > 5 && seen[0] > 5, "{seen:?}: some decode one after the other");
}

/// Views of one mesh, drawn by the threads of a pool that also finds its normals.
#[test]
fn plans_of_one_mesh_may_be_made_in_a_pool() {
    let mesh = scenes::mesh(&shapes::torus(100));
    let prepared = Prepared::default();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let views: Vec<u32> = (0..24).collect();
    let made = pool.install(|| {
        let make = |_: &u32| {
            let spec = scenes::spec(&[("style", "smooth"), ("size", "40")]);
            let mut budget = Budget::new(&Limits::default());
            let scene = Scene::new(&mesh, &spec, &mut budget).unwrap();
            plan::build_from(&scene, &prepared, &mut budget, &Deadline::default()).unwrap();
            1
        };
        views.par_iter().map(make).sum::<u32>()
    });
    assert_eq!(made, 24);
}
