//! The scenes: meshes, views, and the true widths of lines.

use std::path::PathBuf;

use meshsnap_render::import::Bundle;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan;
use meshsnap_render::plan::DrawPlan;
use meshsnap_render::request;
use meshsnap_render::request::Rules;
use meshsnap_render::spec::BackendChoice;
use meshsnap_render::spec::Spec;

use super::meshes;
use super::techniques::Family;
use super::textured;
use crate::support::shapes;

/// A scene, measured with each technique of its family.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    pub name: &'static str,
    pub family: Family,
    source: Source,
    /// True if a unit of the mesh is a pixel.
    is_flat: bool,
    pub keys: &'static [(&'static str, &'static str)],
    /// The true width of lines; of a hull, of the strip that shows.
    pub width_px: f64,
    /// True if `--quick` draws it.
    pub is_quick: bool,
}

/// A mesh's origin.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// Made for pictures of so many pixels per side.
    Made(fn(u32) -> String),
    /// Made with a texture, as GLB.
    Textured(fn() -> Vec<u8>),
    /// A file of the shared models, and what takes its place where it is not there.
    Model(&'static str, fn(u32) -> String),
}

/// From a little above, along a floor.
const ALONG: &[(&str, &str)] = &[("camera.eye", "0.3,1,3"), ("camera.target", "0,0,-1"), ("camera.fov_deg", "60")];

const POLYGONS: &[(&str, &str)] = &[("wire.edges", "polygons")];

/// All of them.
pub const SCENES: &[Scene] = &[
    flat("isolated lines", meshes::lines, 1.5),
    quick(flat("12 px grid", meshes::grid, 1.5)),
    quick(flat("48-fan", meshes::fan, 1.5)),
    Scene { keys: POLYGONS, ..flat("small quads", meshes::print, 1.0) },
    solid("dense ball", Family::Wires, Source::Made(|_| meshes::icosphere(6)), 0.5),
    solid("dense scan", Family::Wires, Source::Model("stanford-bunny.obj", |_| shapes::torus(256)), 0.5),
    solid("sparse model", Family::Wires, Source::Model("suzanne.obj", |_| shapes::torus(28)), 1.5),
    solid("deep rings", Family::Wires, Source::Made(|_| meshes::rings()), 1.0),
    quick(solid("gear silhouette", Family::Outlines, Source::Made(|_| shapes::gear(14)), 3.0)),
    solid("torus silhouette", Family::Outlines, Source::Made(|_| shapes::torus(48)), 3.0),
    solid("rings silhouettes", Family::Outlines, Source::Made(|_| meshes::rings()), 3.0),
    quick(solid("gear faces", Family::Faces, Source::Made(|_| shapes::gear(14)), 0.0)),
    solid("torus faces", Family::Faces, Source::Made(|_| shapes::torus(48)), 0.0),
    solid("rings, whole picture", Family::Pictures, Source::Made(|_| meshes::rings()), 0.0),
    quick(Scene { keys: ALONG, ..solid("floor at a slant", Family::Textures, Source::Textured(textured::floor), 0.0) }),
    solid("textured torus", Family::Textures, Source::Textured(textured::torus), 0.0),
    quick(solid("gear", Family::Whole, Source::Made(|_| shapes::gear(14)), 1.5)),
    solid("rings", Family::Whole, Source::Made(|_| meshes::rings()), 1.0),
    solid("ball of 20,480", Family::Whole, Source::Made(|_| meshes::icosphere(5)), 0.5),
    Scene { keys: ALONG, ..solid("floor", Family::WholeTextures, Source::Textured(textured::floor), 0.0) },
    solid("torus of tiles", Family::WholeTextures, Source::Textured(textured::torus), 0.0),
];

/// Scenes that no table is made from: what a table says of techniques must hold for these too.
pub const UNSEEN: &[Scene] = &[
    solid("ball", Family::Wires, Source::Made(|_| meshes::icosphere(4)), 1.0),
    solid("torus", Family::Wires, Source::Made(|_| shapes::torus(36)), 2.0),
    solid("cow", Family::Wires, Source::Model("cow.obj", |_| shapes::torus(54)), 1.0),
    solid("teapot", Family::Wires, Source::Model("teapot.obj", |_| shapes::torus(60)), 0.7),
    solid("fandisk", Family::Wires, Source::Model("fandisk.obj", |_| shapes::gear(40)), 0.5),
    solid("ball, whole picture", Family::Pictures, Source::Made(|_| meshes::icosphere(4)), 0.0),
    solid("torus, whole picture", Family::Pictures, Source::Made(|_| shapes::torus(36)), 0.0),
    solid("gear, whole picture", Family::Pictures, Source::Made(|_| shapes::gear(23)), 0.0),
    solid("cow, whole picture", Family::Pictures, Source::Model("cow.obj", |_| shapes::torus(54)), 0.0),
    solid("teapot, whole picture", Family::Pictures, Source::Model("teapot.obj", |_| shapes::torus(60)), 0.0),
    solid("fandisk, whole picture", Family::Pictures, Source::Model("fandisk.obj", |_| shapes::gear(40)), 0.0),
    solid("bunny, whole picture", Family::Pictures, Source::Model("stanford-bunny.obj", |_| shapes::torus(256)), 0.0),
    solid("torus silhouette, coarse", Family::Outlines, Source::Made(|_| shapes::torus(20)), 2.0),
    solid("balls' silhouettes", Family::Outlines, Source::Made(|_| shapes::two_balls()), 4.0),
    solid("cow's silhouette", Family::Outlines, Source::Model("cow.obj", |_| shapes::torus(54)), 3.0),
];

/// The small scenes that the test suite measures.
pub const SMALL: &[&str] = &["12 px grid", "48-fan"];

const fn flat(name: &'static str, made: fn(u32) -> String, width_px: f64) -> Scene {
    Scene { is_flat: true, ..solid(name, Family::Wires, Source::Made(made), width_px) }
}

const fn solid(name: &'static str, family: Family, source: Source, width_px: f64) -> Scene {
    Scene { name, family, source, is_flat: false, keys: &[], width_px, is_quick: false }
}

const fn quick(scene: Scene) -> Scene {
    Scene { is_quick: true, ..scene }
}

impl Scene {
    /// The mesh, and what it is.
    pub fn mesh(&self, size_px: u32) -> Mesh {
        let limits = Limits::default();
        let bundle = Bundle::of_one(self.bytes(size_px));
        meshsnap_render::import::import(&bundle, None, &limits, &mut Budget::new(&limits), &Deadline::default())
            .unwrap_or_else(|e| panic!("{}: {e}", self.name))
            .0
    }

    fn bytes(&self, size_px: u32) -> Vec<u8> {
        match self.source {
            Source::Made(made) => made(size_px).into_bytes(),
            Source::Textured(made) => made(),
            Source::Model(file, instead) => {
                std::fs::read(models().join(file)).unwrap_or_else(|_| instead(size_px).into_bytes())
            }
        }
    }

    /// The scene's model where it is not at hand, so that a made mesh takes its place.
    pub fn missing_model(&self) -> Option<&'static str> {
        match self.source {
            Source::Model(file, _) if !models().join(file).is_file() => Some(file),
            _ => None,
        }
    }

    /// A description for readers of the report.
    pub fn about(&self) -> String {
        let what = match self.source {
            Source::Made(_) | Source::Textured(_) => "made by the benchmark".to_owned(),
            Source::Model(file, _) if self.missing_model().is_none() => file.to_owned(),
            Source::Model(file, _) => format!("a made mesh in place of {file}, which is not there"),
        };
        if self.width_px > 0.0 { format!("{what}, lines {} px wide", self.width_px) } else { what }
    }

    /// A request for the scene, `keys` over its own.
    pub fn spec(&self, size_px: u32, keys: &[(&str, String)]) -> Spec {
        let mut all = vec![("size".to_owned(), size_px.to_string())];
        if self.keys.iter().all(|(key, _)| *key != "camera.eye") {
            all.push(("view".into(), if self.is_flat { "front" } else { "iso" }.into()));
        }
        if self.is_flat {
            all.push(("camera.projection".into(), "orthographic".into()));
            all.push(("camera.height".into(), size_px.to_string()));
        }
        all.extend(self.keys.iter().map(|&(k, v)| (k.to_owned(), v.to_owned())));
        all.extend(keys.iter().map(|(k, v)| ((*k).to_owned(), v.clone())));
        let rules = Rules { limits: Limits::default(), backend: BackendChoice::Auto };
        request::read(None, &all, &rules).unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }
}

/// Plans with default limits.
pub fn plan<'a>(mesh: &'a Mesh, spec: &Spec) -> DrawPlan<'a> {
    let mut budget = Budget::new(&Limits::default());
    let scene = meshsnap_render::scene::Scene::new(mesh, spec, &mut budget).expect("a scene");
    plan::build(&scene, &mut budget, &Deadline::default()).expect("a plan")
}

fn models() -> PathBuf {
    let root = std::env::var_os("MESHSNAP_SHARED")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    root.join("models")
}
