//! Reads an FBX file in another process: what goes there, what comes back, and the check of that. The other process
//! has read a stranger's file in C, so that its answer is a stranger's too.

use serde::{Deserialize, Serialize};

use super::scene;
use crate::import::bundle::{Bundle, BundleFile, FileUse, Missing, Origin};
use crate::import::context::Context;
use crate::import::isolate::{self, Isolation, Order};
use crate::import::raw::RawMesh;
use crate::import::{FileMetadata, Folder, Format, ImportReport, MeshError, MeshFault, text};
use crate::limits::{Budget, Deadline, LimitExceeded, Limits};
use crate::mesh::material::{AlphaMode, ImageContent, ImageSource, TextureRef, Wrap};
use crate::mesh::{LineOrPoint, MaterialSlot, UpAxis};
use crate::warning::Warning;

/// What the other process knows beside the file.
#[derive(Serialize, Deserialize)]
struct Head {
    /// [`Limits`] that matter here: memory, triangles, nodes.
    limits: [u64; 3],
    /// Bytes that the job has spent before.
    spent_bytes: u64,
    /// Who gave the files, as a number.
    origin: u8,
    /// The paths of the bundle's files, and which of them is the mesh.
    paths: Vec<String>,
    entry: u32,
    counts_loose: bool,
}

/// What comes back.
#[derive(Serialize, Deserialize)]
enum Answer {
    Mesh(Box<Read>),
    Refused(Refusal),
}

#[derive(Serialize, Deserialize)]
struct Refusal {
    fault: u8,
    detail: String,
    /// What was counted, the count, the limit, and the number of its flag.
    limit: Option<(String, u64, u64, u8)>,
}

/// A mesh, with the fields of [`RawMesh`] that the importer fills.
#[derive(Serialize, Deserialize)]
struct Read {
    positions: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    colors: Vec<[f32; 4]>,
    triangles: Vec<[u32; 3]>,
    edge_masks: Vec<u8>,
    triangle_materials: Vec<u32>,
    lines_and_points: Vec<([u32; 2], u32)>,
    materials: Vec<Material>,
    images: Vec<(String, Image)>,
    up: u8,
    file_vertices: u64,
    loose_vertices: Option<u64>,
    polygons_by_arity: [u64; 13],
    /// Dropped faces and lines, in the order of [`ImportReport`].
    dropped: [u64; 4],
    /// Codes by their place in [`CODES`], with details.
    warnings: Vec<(u8, String)>,
    generator: Option<String>,
    /// Nodes, meshes, animations, skins, cameras.
    counts: [Option<u64>; 5],
    spent_bytes: u64,
    missing: Vec<(String, String)>,
}

#[derive(Serialize, Deserialize)]
struct Material {
    name: String,
    base_color: Option<[f32; 4]>,
    metallic: Option<f32>,
    roughness: Option<f32>,
    emissive: Option<[f32; 3]>,
    /// Opaque, mask, blend; and the cutoff.
    alpha: (u8, f32),
    base_texture: Option<Texture>,
    normal_texture: Option<Texture>,
    emissive_texture: Option<Texture>,
}

#[derive(Serialize, Deserialize)]
struct Texture {
    image: u32,
    transform: [[f32; 3]; 2],
    wrap: [u8; 2],
    nearest: bool,
}

#[derive(Serialize, Deserialize)]
enum Image {
    Embedded(Vec<u8>),
    OfBundle(u32),
    Absent,
}

/// Codes of warnings about FBX files.
const CODES: &[&str] = &[
    "polygons_fanned",
    "curves_ignored",
    "deformers_ignored",
    "textures_missing",
    "maps_ignored",
    "opacity_ignored",
    "hidden_ignored",
    "levels_ignored",
    "short_faces_ignored",
];
const FAULTS: &[MeshFault] = &[
    MeshFault::Broken,
    MeshFault::Unrecognised,
    MeshFault::Empty,
    MeshFault::OutsideBundle,
    MeshFault::Unsupported,
    MeshFault::DecoderFailed,
    MeshFault::Stopped,
];
const FLAGS: &[&str] = &["--limit-memory-bytes", "--limit-triangles", "--limit-nodes"];
const ORIGINS: &[Origin] = &[Origin::Request, Origin::Command, Origin::Library];
const AXES: &[UpAxis] = &[UpAxis::X, UpAxis::NegX, UpAxis::Y, UpAxis::NegY, UpAxis::Z, UpAxis::NegZ];
const WRAPS: &[Wrap] = &[Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
/// The other process has the paths of the bundle's files and not their bytes: these stand for them, with the
/// file's number behind. A texture in the FBX file that begins so means a file of its own bundle.
const STAND_IN: &[u8] = b"\0meshsnap: file ";

/// Reads the file in the other process.
pub fn read(bytes: &[u8], isolation: &dyn Isolation, cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let (paths, entry) = cx.bundle.paths();
    let Limits { memory_bytes, triangles, nodes, .. } = *cx.limits;
    let origin = place(ORIGINS, &cx.bundle.origin());
    let spent_bytes = cx.budget.spent_bytes();
    let head = Head {
        limits: [memory_bytes, triangles, nodes],
        spent_bytes,
        origin,
        paths,
        entry,
        counts_loose: cx.counts_loose,
    };
    let head = postcard::to_stdvec(&head).map_err(|_| MeshError::broken("the names of the files are too long"))?;
    let head = [&[isolate::FBX], head.as_slice()].concat();
    let memory_bytes = memory_bytes.saturating_sub(spent_bytes);
    let lend = |bytes| cx.budget.lend_beside(bytes);
    let answer = isolation.decode(&Order { head: &head, file: bytes, memory_bytes, lend: &lend }, cx.deadline)?;
    // The lists in memory are at most a few times as long as what came.
    cx.budget.spend("the FBX file", answer.len() as u64, 1)?;
    let foul = || MeshError::new(MeshFault::DecoderCrashed, "the decoder of this format answered with nonsense");
    match postcard::from_bytes(&answer).map_err(|_| foul())? {
        Answer::Refused(refusal) => Err(refusal.error().ok_or_else(foul)?),
        Answer::Mesh(mesh) => mesh.check(cx)?.ok_or_else(foul),
    }
}

/// What the other process does with an order.
pub fn answer(head: &[u8], bytes: &[u8]) -> Vec<u8> {
    let read = match postcard::from_bytes::<Head>(head) {
        Ok(head) => read_there(&head, bytes),
        Err(_) => Err(MeshError::broken("the order cannot be read")),
    };
    let answer = match read {
        Ok(read) => Answer::Mesh(Box::new(read)),
        Err(error) => Answer::Refused(Refusal::of(&error)),
    };
    postcard::to_stdvec(&answer).unwrap_or_default()
}

fn read_there(head: &Head, bytes: &[u8]) -> Result<Read, MeshError> {
    let [memory_bytes, triangles, nodes] = head.limits;
    let limits = Limits { memory_bytes, triangles, nodes, ..Limits::default() };
    let mut budget = Budget::new(&limits);
    budget.spend("the files", head.spent_bytes, 1)?;
    let stand_in = |(number, path): (usize, &String)| BundleFile {
        path: path.clone(),
        bytes: [STAND_IN, &(number as u32).to_le_bytes()].concat().into(),
    };
    let files: Vec<BundleFile> = head.paths.iter().enumerate().map(stand_in).collect();
    let entry = (head.entry as usize).min(files.len().saturating_sub(1));
    let file_use = FileUse::default();
    let origin = ORIGINS.get(usize::from(head.origin)).copied().unwrap_or_default();
    let bundle = Bundle::default().given_by(origin).watched_by(&file_use);
    let folder = Folder::new(files, entry).of_bundle(&bundle);
    let deadline = Deadline::default();
    let mut cx = Context {
        limits: &limits,
        budget: &mut budget,
        deadline: &deadline,
        bundle: &folder,
        time_s: None,
        counts_loose: head.counts_loose,
    };
    let raw = scene::read(bytes, &mut cx)?;
    let missing = file_use.missing().into_iter().map(|Missing { folder, name }| (folder, name)).collect();
    Ok(Read { spent_bytes: budget.spent_bytes(), missing, ..Read::of(raw) })
}

impl Refusal {
    fn of(error: &MeshError) -> Self {
        let limit = match &error.fault {
            MeshFault::Limit(LimitExceeded { what, given, limit, flag }) => {
                Some((what.clone(), *given, *limit, place(FLAGS, flag)))
            }
            _ => None,
        };
        Self { fault: place(FAULTS, &error.fault), detail: error.detail.clone(), limit }
    }

    fn error(self) -> Option<MeshError> {
        if let Some((what, given, limit, flag)) = self.limit {
            let flag = FLAGS.get(usize::from(flag))?;
            return Some(LimitExceeded { what: text::cut(&what, 200), given, limit, flag }.into());
        }
        Some(MeshError::new(FAULTS.get(usize::from(self.fault))?.clone(), printable(&self.detail)))
    }
}

impl Read {
    fn of(raw: RawMesh) -> Self {
        let ImportReport { metadata, .. } = raw.report;
        let image = |image: ImageSource| {
            let content = match &image.content {
                ImageContent::Absent => Image::Absent,
                ImageContent::Encoded(bytes) => match bytes.strip_prefix(STAND_IN).map(<[u8; 4]>::try_from) {
                    Some(Ok(number)) => Image::OfBundle(u32::from_le_bytes(number)),
                    _ => Image::Embedded(bytes.to_vec()),
                },
            };
            (image.name, content)
        };
        Self {
            positions: raw.positions,
            normals: raw.normals,
            uvs: raw.uvs,
            colors: raw.colors,
            triangles: raw.triangles,
            edge_masks: raw.edge_masks,
            triangle_materials: raw.triangle_materials,
            lines_and_points: raw.lines_and_points.iter().map(|one| (one.ends, one.material)).collect(),
            materials: raw.materials.into_iter().map(Material::of).collect(),
            images: raw.images.into_iter().map(image).collect(),
            up: place(AXES, &raw.up),
            file_vertices: raw.report.file_vertices,
            loose_vertices: raw.report.loose_vertices,
            polygons_by_arity: raw.report.polygons_by_arity,
            dropped: [
                raw.report.dropped_nonfinite_faces,
                raw.report.dropped_degenerate_faces,
                raw.report.dropped_collapsed_faces,
                raw.report.dropped_lines_and_points,
            ],
            warnings: raw.report.warnings.into_iter().map(|w| (place(CODES, &w.code), w.detail)).collect(),
            generator: metadata.generator,
            counts: [metadata.nodes, metadata.meshes, metadata.animations, metadata.skins, metadata.cameras],
            spent_bytes: 0,
            missing: Vec::new(),
        }
    }

    /// The mesh, paid for and checked like any other stranger's bytes; None if it is not what an importer makes.
    fn check(self, cx: &mut Context<'_>) -> Result<Option<RawMesh>, MeshError> {
        cx.check_triangles(self.triangles.len() as u64)?;
        let spent = self.spent_bytes.saturating_sub(cx.budget.spent_bytes());
        cx.budget.spend("the FBX file", spent, 1)?;
        for (folder, name) in self.missing.iter().take(100) {
            cx.bundle.note_missing(folder, name);
        }
        let Some(images) = images_of(self.images, cx)? else { return Ok(None) };
        let lists = Lists {
            vertices: self.positions.len(),
            triangles: self.triangles.len(),
            materials: self.materials.len(),
            images: images.len(),
        };
        let materials: Option<Vec<MaterialSlot>> = self.materials.into_iter().map(|m| m.slot(&lists)).collect();
        let warning = |(code, detail): (u8, String)| {
            Some(Warning { code: CODES.get(usize::from(code))?, detail: printable(&detail) })
        };
        let warnings: Option<Vec<Warning>> = self.warnings.into_iter().map(warning).collect();
        let (Some(materials), Some(warnings), Some(&up)) = (materials, warnings, AXES.get(usize::from(self.up))) else {
            return Ok(None);
        };
        let is_whole = lists.fit(&self.triangles, &self.lines_and_points)
            && [self.normals.len(), self.uvs.len(), self.colors.len()].iter().all(|&n| n == 0 || n == lists.vertices)
            && self.edge_masks.len() == lists.triangles
            && self.edge_masks.iter().all(|&mask| mask < 8)
            && self.triangle_materials.len() == lists.triangles
            && self.triangle_materials.iter().all(|&material| lists.has_material(material));
        if !is_whole {
            return Ok(None);
        }
        let [nodes, meshes, animations, skins, cameras] = self.counts;
        let [dropped_nonfinite_faces, dropped_degenerate_faces, dropped_collapsed_faces, dropped_lines_and_points] =
            self.dropped;
        let generator = self.generator.map(|generator| printable(&generator));
        let report = ImportReport {
            format: Format::Fbx,
            file_vertices: self.file_vertices,
            loose_vertices: self.loose_vertices,
            polygons_by_arity: self.polygons_by_arity,
            dropped_nonfinite_faces,
            dropped_degenerate_faces,
            dropped_collapsed_faces,
            dropped_lines_and_points,
            warnings,
            metadata: FileMetadata { generator, nodes, meshes, animations, skins, cameras, ..FileMetadata::default() },
            ..ImportReport::default()
        };
        let lines_and_points = self.lines_and_points.into_iter();
        Ok(Some(RawMesh {
            positions: self.positions,
            normals: self.normals,
            uvs: self.uvs,
            colors: self.colors,
            triangles: self.triangles,
            edge_masks: self.edge_masks,
            triangle_materials: self.triangle_materials,
            lines_and_points: lines_and_points.map(|(ends, material)| LineOrPoint { ends, material }).collect(),
            materials,
            images,
            up,
            report,
            ..RawMesh::default()
        }))
    }
}

/// The images, those of the bundle paid for; None if one is not there.
fn images_of(images: Vec<(String, Image)>, cx: &mut Context<'_>) -> Result<Option<Vec<ImageSource>>, MeshError> {
    let mut found = Vec::with_capacity(images.len());
    for (name, image) in images {
        let content = match image {
            Image::Absent => ImageContent::Absent,
            Image::Embedded(bytes) => ImageContent::Encoded(bytes.into()),
            Image::OfBundle(number) => match cx.bundle.try_file(number as usize) {
                Some(file) => {
                    cx.budget.spend("a texture file", file.bytes.len() as u64, 1)?;
                    ImageContent::Encoded(file.bytes.as_ref().into())
                }
                None => return Ok(None),
            },
        };
        found.push(ImageSource { name: printable(&name), content });
    }
    Ok(Some(found))
}

/// The lengths of lists that indices refer to.
struct Lists {
    vertices: usize,
    triangles: usize,
    materials: usize,
    images: usize,
}

impl Lists {
    fn has_material(&self, material: u32) -> bool {
        (material as usize) < self.materials.max(1)
    }

    fn fit(&self, triangles: &[[u32; 3]], lines_and_points: &[([u32; 2], u32)]) -> bool {
        let is_vertex = |&vertex: &u32| (vertex as usize) < self.vertices;
        triangles.iter().flatten().all(is_vertex)
            && lines_and_points
                .iter()
                .all(|(ends, material)| ends.iter().all(is_vertex) && self.has_material(*material))
    }
}

impl Material {
    fn of(slot: MaterialSlot) -> Self {
        let alpha = match slot.alpha {
            AlphaMode::Opaque => (0, 0.0),
            AlphaMode::Mask(cutoff) => (1, cutoff),
            AlphaMode::Blend => (2, 0.0),
        };
        let texture = |texture: TextureRef| Texture {
            image: texture.image,
            transform: texture.transform,
            wrap: texture.wrap.map(|wrap| place(WRAPS, &wrap)),
            nearest: texture.nearest,
        };
        Self {
            name: slot.name,
            base_color: slot.base_color,
            metallic: slot.metallic,
            roughness: slot.roughness,
            emissive: slot.emissive,
            alpha,
            base_texture: slot.base_texture.map(texture),
            normal_texture: slot.normal_texture.map(texture),
            emissive_texture: slot.emissive_texture.map(texture),
        }
    }

    /// The slot; None if a number is outside of what the importer makes, or an image does not exist.
    fn slot(self, lists: &Lists) -> Option<MaterialSlot> {
        let within = |values: &[f32], most: f32| values.iter().all(|value| (0.0..=most).contains(value));
        let is_good = self.base_color.is_none_or(|color| within(&color, 1.0))
            && self.metallic.is_none_or(|value| within(&[value], 1.0))
            && self.roughness.is_none_or(|value| within(&[value], 1.0))
            && self.emissive.is_none_or(|color| within(&color, 1e4));
        let alpha = match self.alpha {
            (0, _) => AlphaMode::Opaque,
            (1, cutoff) if within(&[cutoff], 1.0) => AlphaMode::Mask(cutoff),
            (2, _) => AlphaMode::Blend,
            _ => return None,
        };
        let texture = |texture: Option<Texture>| match texture {
            None => Some(None),
            Some(texture) => texture.checked(lists).map(Some),
        };
        let slot = MaterialSlot {
            name: printable(&self.name),
            base_color: self.base_color,
            metallic: self.metallic,
            roughness: self.roughness,
            emissive: self.emissive,
            alpha,
            base_texture: texture(self.base_texture)?,
            normal_texture: texture(self.normal_texture)?,
            emissive_texture: texture(self.emissive_texture)?,
            ..MaterialSlot::default()
        };
        is_good.then_some(slot)
    }
}

impl Texture {
    fn checked(self, lists: &Lists) -> Option<TextureRef> {
        let wrap = |number: u8| WRAPS.get(usize::from(number)).copied();
        let is_good = (self.image as usize) < lists.images && self.transform.iter().flatten().all(|n| n.is_finite());
        let wrap = [wrap(self.wrap[0])?, wrap(self.wrap[1])?];
        let texture = TextureRef::new(self.image);
        is_good.then_some(TextureRef { transform: self.transform, wrap, nearest: self.nearest, ..texture })
    }
}

/// The place of a value in a list; past its end for one that is not there.
fn place<T: PartialEq>(all: &[T], value: &T) -> u8 {
    all.iter().position(|one| one == value).unwrap_or(all.len()) as u8
}

/// Text of the other process without control characters, cut to a length that messages have.
fn printable(text: &str) -> String {
    let text: String = text.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).take(1024).collect();
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::isolate::IsolationError;
    use crate::import::normalise;
    use crate::import::test_random::Random;

    const FILES: [&[u8]; 2] = [
        include_bytes!("../../../../fuzz/seeds/fbx/cube.fbx"),
        include_bytes!("../../../../fuzz/seeds/fbx/layers.fbx"),
    ];

    /// Answers in this process, and changes the answer.
    struct Changed(Box<dyn Fn(Vec<u8>) -> Vec<u8> + Send + Sync>);

    impl Isolation for Changed {
        fn decode(&self, order: &Order<'_>, _: &Deadline) -> Result<Vec<u8>, IsolationError> {
            let answer = answer(&order.head[1..], order.file);
            Ok((self.0)(answer))
        }
    }

    /// What becomes of a file: its triangles, if the answer is believed and can be drawn.
    fn outcome(file: &[u8], change: impl Fn(Vec<u8>) -> Vec<u8> + Send + Sync + 'static) -> Result<usize, MeshError> {
        let limits = Limits::default();
        let (mut budget, deadline) = (Budget::new(&limits), Deadline::default());
        let files = vec![BundleFile { path: "a.fbx".into(), bytes: file.to_vec().into() }];
        let folder = Folder::new(files, 0);
        let mut cx = Context {
            limits: &limits,
            budget: &mut budget,
            deadline: &deadline,
            bundle: &folder,
            time_s: None,
            counts_loose: false,
        };
        let raw = read(file, &Changed(Box::new(change)), &mut cx)?;
        normalise(raw, &mut cx).map(|imported| imported.mesh.triangles.len())
    }

    #[test]
    fn an_answer_is_checked_like_any_strangers_bytes() {
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let (mut refused, mut believed) = (0, 0);
        for file in FILES {
            assert!(outcome(file, |answer| answer).unwrap() > 0);
            for cut in 0..64 {
                let half = outcome(file, move |answer| answer[..answer.len() * cut / 64].to_vec()).unwrap_err();
                assert_eq!(half.fault, MeshFault::DecoderCrashed, "{half}");
            }
            for _ in 0..2000 {
                let changes: Vec<(u64, u8)> =
                    (0..1 + random.below(4)).map(|_| (random.below(1 << 40), random.below(256) as u8)).collect();
                let changed = outcome(file, move |mut answer| {
                    let length = answer.len() as u64;
                    changes.iter().for_each(|&(at, byte)| answer[(at % length) as usize] = byte);
                    answer
                });
                match changed {
                    Ok(_) => believed += 1,
                    Err(_) => refused += 1,
                }
            }
        }
        // Coordinates may be any numbers; lengths and indices may not.
        assert!(refused > 100 && believed > 100, "{refused} refused, {believed} believed");
    }
}
