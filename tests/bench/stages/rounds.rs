//! Times every stage of one mesh, in turns with the reference loop, and keeps the least time of
//! each.

use std::hint::black_box;
use std::time::Instant;

use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::{DrawError, Renderer as _};
use meshsnap_render::encode;
use meshsnap_render::image::{DEFAULT_EFFORT, Image, ImageFormat};
use meshsnap_render::import::Bundle;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{self, DrawPlan, Prepared};
use meshsnap_render::request::{self, Rules};
use meshsnap_render::scene::Scene;
use meshsnap_render::spec::{BackendChoice, Spec};

use crate::meshes::MeshFile;
use crate::reference::Reference;

/// The looks that are timed: name, and keys of the request.
const LOOKS: &[(&str, &[(&str, &str)])] = &[
    ("flat", &[("style", "flat")]),
    ("smooth", &[("style", "smooth")]),
    ("wire", &[("style", "wire"), ("wire.edges", "triangles"), ("wire.thickness", "1")]),
    ("outline", &[("style", "outline")]),
    ("xray", &[("style", "flat"), ("surface.opacity", "0.5")]),
];

/// A stage's least time.
pub struct Row {
    pub mesh: String,
    pub stage: String,
    pub ms: f64,
    /// Over the reference loop's least time.
    pub ratio: f64,
    /// Throughput or size, where there is one.
    pub note: String,
}

impl Row {
    /// The key of the stored ratios.
    pub fn name(&self) -> String {
        format!("{}, {}", self.mesh, self.stage)
    }
}

/// Least times of every stage, milliseconds.
pub fn measure(file: &MeshFile, threads: usize, rounds: usize) -> Vec<Row> {
    let bundle = Bundle::of_one(file.bytes.clone());
    let mesh = import(&bundle);
    let specs: Vec<Spec> = LOOKS.iter().map(|(_, keys)| spec(keys)).collect();
    let mut cpu = CpuRenderer::new(threads);
    let images: Vec<Image> = specs.iter().map(|spec| draw(&mut cpu, &plan(&mesh, spec)).unwrap()).collect();
    let boxes = Prepared::default().position_boxes(&mesh, &mut Budget::new(&limits())).unwrap();
    let mut reference = Reference::new();
    let mut least = Least::default();
    for _ in 0..rounds {
        least.time("reference", || reference.run());
        least.time("parse", || import(&bundle));
        // A camera for a mesh of which nothing is known, and for one that was drawn before.
        least.time("frame", || Scene::new(&mesh, &specs[0], &mut Budget::new(&limits())).unwrap().camera);
        least.time("frame again", || {
            Scene::framed_by(None, &boxes, &mesh, &specs[0], &mut Budget::new(&limits())).unwrap().camera
        });
        for ((look, _), (spec, image)) in LOOKS.iter().zip(specs.iter().zip(&images)) {
            let plan = least.time(&format!("plan {look}"), || plan(&mesh, spec));
            least.time(&format!("render {look}"), || draw(&mut cpu, &plan).unwrap());
            least.time(&format!("encode {look}"), || png(image));
        }
    }
    let note = |stage: &str| match stage.split_once(' ') {
        None => format!("{:.0} MB/s", file.bytes.len() as f64 / 1e3 / least.of(stage)),
        Some(("encode", look)) => {
            let image = &images[LOOKS.iter().position(|(name, _)| *name == look).unwrap()];
            format!("{} bytes", png(image).len())
        }
        Some(_) => String::new(),
    };
    let reference_ms = least.of("reference");
    let row = |(stage, ms): &(String, f64)| Row {
        mesh: file.name.clone(),
        stage: stage.clone(),
        ms: *ms,
        ratio: ms / reference_ms,
        note: note(stage),
    };
    least.0.iter().filter(|(stage, _)| stage != "reference").map(row).collect()
}

/// Stages in the order in which they first ran, with their least times in milliseconds.
#[derive(Default)]
struct Least(Vec<(String, f64)>);

impl Least {
    fn time<T>(&mut self, stage: &str, run: impl FnOnce() -> T) -> T {
        let began = Instant::now();
        let made = black_box(run());
        let ms = began.elapsed().as_secs_f64() * 1e3;
        match self.0.iter_mut().find(|(name, _)| name == stage) {
            Some((_, least)) => *least = least.min(ms),
            None => self.0.push((stage.to_owned(), ms)),
        }
        made
    }

    fn of(&self, stage: &str) -> f64 {
        self.0.iter().find(|(name, _)| name == stage).unwrap().1
    }
}

/// The default limits, but for memory: the largest mesh has ten million triangles.
fn limits() -> Limits {
    Limits::default().with(|limits| limits.memory_bytes = 16 << 30)
}

/// A mesh.
pub fn import(bundle: &Bundle) -> Mesh {
    let limits = limits();
    meshsnap_render::import::import(bundle, None, &limits, &mut Budget::new(&limits), &Deadline::default()).unwrap().0
}

/// A request of 512 x 512 px from the view `iso`, unless the keys say otherwise.
pub fn spec(keys: &[(&str, &str)]) -> Spec {
    let keys: Vec<_> =
        [("view", "iso")].iter().chain(keys).map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    let rules = Rules { limits: Limits::default(), backend: BackendChoice::Cpu };
    request::read(None, &keys, &rules).unwrap()
}

/// A plan.
pub fn plan<'m>(mesh: &'m Mesh, spec: &Spec) -> DrawPlan<'m> {
    let mut budget = Budget::new(&limits());
    let scene = Scene::new(mesh, spec, &mut budget).unwrap();
    plan::build(&scene, &mut budget, &Deadline::default()).unwrap()
}

fn png(image: &Image) -> Vec<u8> {
    encode::encode(image, ImageFormat::Png, DEFAULT_EFFORT, &Deadline::default()).unwrap()
}

/// The picture.
pub fn draw(cpu: &mut CpuRenderer, plan: &DrawPlan<'_>) -> Result<Image, DrawError> {
    cpu.draw(plan, &Deadline::default())
}
