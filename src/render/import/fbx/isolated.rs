//! The reading of an FBX file in another process: the order that is sent, the answer that comes
//! back, and the checks of the answer. The file may be hostile and its parser is written in C, so
//! the process that parsed it is not trusted: its answer is checked like a stranger's file.
//!
//! The head of the order and the answer are written by serde as `postcard`. This form is private to
//! two processes of one program. For it alone, and with the feature `isolate` alone, [`RawMesh`]
//! and the types in it derive `Serialize`.

use serde::{Deserialize, Serialize};

use super::scene;
use crate::import::bundle::{Bundle, BundleFile, FileUse, Missing, Origin};
use crate::import::context::Context;
use crate::import::isolate::{self, Isolation, Order};
use crate::import::raw::RawMesh;
use crate::import::{Folder, Format, MeshError, MeshFault, text};
use crate::limits::{Budget, Deadline, LimitExceeded, Limits};
use crate::mesh::MaterialSlot;
use crate::mesh::material::{AlphaMode, ImageContent, TextureRef};
use crate::warning::Warning;

/// What the other process knows beside the file.
#[derive(Serialize, Deserialize)]
struct Head {
    /// [`Limits`] that matter here: memory, triangles, nodes.
    limits: [u64; 3],
    /// Bytes that the job has spent before.
    spent_bytes: u64,
    origin: Origin,
    /// The paths of the bundle's files, and which of them is the mesh.
    paths: Vec<String>,
    entry: u32,
    counts_loose: bool,
}

/// What comes back.
#[derive(Serialize, Deserialize)]
enum Answer {
    Mesh(Box<Read>),
    /// The error, and the place in [`FLAGS`] of the flag that a limit names.
    Refused(MeshError, u8),
}

#[derive(Serialize, Deserialize)]
struct Read {
    raw: RawMesh,
    /// The codes of the mesh's warnings, by their places in [`CODES`].
    codes: Vec<u8>,
    spent_bytes: u64,
    missing: Vec<Missing>,
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
const FLAGS: &[&str] = &["--limit-memory-bytes", "--limit-triangles", "--limit-nodes"];
/// The other process has the paths of the bundle's files and not their bytes: these stand for them, with the
/// file's number behind. A texture in the FBX file that begins so means a file of its own bundle.
const STAND_IN: &[u8] = b"\0meshsnap: file ";

/// Reads the file in the other process.
pub fn read(bytes: &[u8], isolation: &dyn Isolation, cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let (paths, entry) = cx.bundle.paths();
    let Limits { memory_bytes, triangles, nodes, .. } = *cx.limits;
    let spent_bytes = cx.budget.spent_bytes();
    let head = Head {
        limits: [memory_bytes, triangles, nodes],
        spent_bytes,
        origin: cx.bundle.origin(),
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
        Answer::Refused(error, flag) => Err(checked_error(error, flag).ok_or_else(foul)?),
        Answer::Mesh(read) => read.check(cx)?.ok_or_else(foul),
    }
}

/// What the other process does with an order.
pub fn answer(head: &[u8], bytes: &[u8]) -> Vec<u8> {
    let read = match postcard::from_bytes::<Head>(head) {
        Ok(head) => read_there(head, bytes),
        Err(_) => Err(MeshError::broken("the order cannot be read")),
    };
    let answer = match read {
        Ok(read) => Answer::Mesh(Box::new(read)),
        Err(error) => {
            let flag = match &error.fault {
                MeshFault::Limit(limit) => place(FLAGS, limit.flag),
                _ => 0,
            };
            Answer::Refused(error, flag)
        }
    };
    postcard::to_stdvec(&answer).unwrap_or_default()
}

fn read_there(head: Head, bytes: &[u8]) -> Result<Read, MeshError> {
    let [memory_bytes, triangles, nodes] = head.limits;
    let limits = Limits { memory_bytes, triangles, nodes, ..Limits::default() };
    let mut budget = Budget::new(&limits);
    budget.spend("the files", head.spent_bytes, 1)?;
    let stand_in = |(number, path): (usize, String)| BundleFile {
        path,
        bytes: [STAND_IN, &(number as u32).to_le_bytes()].concat().into(),
    };
    let files: Vec<BundleFile> = head.paths.into_iter().enumerate().map(stand_in).collect();
    let entry = (head.entry as usize).min(files.len().saturating_sub(1));
    let file_use = FileUse::default();
    let bundle = Bundle::default().given_by(head.origin).watched_by(&file_use);
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
    let codes = raw.report.warnings.iter().map(|warning| place(CODES, warning.code)).collect();
    Ok(Read { raw, codes, spent_bytes: budget.spent_bytes(), missing: file_use.missing() })
}

/// The place of a name in a list; past its end for one that is not there.
fn place(names: &[&str], name: &str) -> u8 {
    names.iter().position(|&one| one == name).unwrap_or(names.len()) as u8
}

/// The error of the other process; None if the importer has no such error.
fn checked_error(error: MeshError, flag: u8) -> Option<MeshError> {
    match error.fault {
        MeshFault::Limit(limit) => {
            let flag = FLAGS.get(usize::from(flag))?;
            Some(LimitExceeded { what: text::cut(printable(&limit.what), 200), flag, ..limit }.into())
        }
        MeshFault::BundleBroken | MeshFault::EntryUnclear | MeshFault::DecoderCrashed => None,
        fault => Some(MeshError::new(fault, printable(&error.detail))),
    }
}

impl Read {
    /// The mesh, paid for and checked like any other stranger's bytes; None if it is not what the importer makes.
    fn check(self, cx: &mut Context<'_>) -> Result<Option<RawMesh>, MeshError> {
        let Self { mut raw, codes, spent_bytes, missing } = self;
        cx.check_triangles(raw.triangles.len() as u64)?;
        let spent = spent_bytes.saturating_sub(cx.budget.spent_bytes());
        cx.budget.spend("the FBX file", spent, 1)?;
        for Missing { folder, name } in missing.iter().take(100) {
            cx.bundle.note_missing(folder, name);
        }
        let is_good = is_whole(&raw) && check_warnings(&mut raw.report.warnings, &codes) && put_images(&mut raw, cx)?;
        for name in raw.materials.iter_mut().map(|slot| &mut slot.name).chain(&mut raw.report.metadata.generator) {
            *name = printable(name);
        }
        Ok(is_good.then_some(raw))
    }
}

/// True if all lists go together and all indices and numbers are in range.
fn is_whole(raw: &RawMesh) -> bool {
    let (vertices, triangles) = (raw.positions.len(), raw.triangles.len());
    let is_vertex = |&vertex: &u32| (vertex as usize) < vertices;
    let has_material = |&material: &u32| (material as usize) < raw.materials.len().max(1);
    let attributes = [raw.normals.len(), raw.uvs.len(), raw.second_uvs.len(), raw.colors.len()];
    let metadata = &raw.report.metadata;
    raw.report.format == Format::Fbx
        && metadata.extensions_used.is_empty()
        && metadata.extensions_required.is_empty()
        && raw.triangles.iter().flatten().all(is_vertex)
        && raw.lines_and_points.iter().all(|one| one.ends.iter().all(is_vertex) && has_material(&one.material))
        && attributes.iter().all(|&count| count == 0 || count == vertices)
        && raw.edge_masks.len() == triangles
        && raw.edge_masks.iter().all(|&mask| mask < 8)
        && raw.triangle_materials.len() == triangles
        && raw.triangle_materials.iter().all(has_material)
        && raw.materials.iter().all(|slot| is_slot(slot, raw.images.len()))
}

/// True if the numbers of a material are in range and its images exist.
fn is_slot(slot: &MaterialSlot, images: usize) -> bool {
    let is_factor = |value: &f32| (0.0..=1.0).contains(value);
    let is_texture = |texture: &TextureRef| {
        (texture.image as usize) < images && texture.transform.as_flattened().iter().all(|n| n.is_finite())
    };
    let is_alpha = match &slot.alpha {
        AlphaMode::Opaque | AlphaMode::Blend => true,
        AlphaMode::Mask(cutoff) => is_factor(cutoff),
    };
    let mut factors = slot.base_color.iter().flatten().chain(&slot.metallic).chain(&slot.roughness);
    let textures = [
        &slot.base_texture,
        &slot.metallic_roughness_texture,
        &slot.normal_texture,
        &slot.emissive_texture,
        &slot.occlusion_texture,
    ];
    factors.all(is_factor)
        && slot.occlusion_texture_strength.iter().all(is_factor)
        && slot.emissive.iter().flatten().all(|value| (0.0..=1e4).contains(value))
        && slot.normal_scale.is_none_or(f32::is_finite)
        && is_alpha
        && textures.into_iter().flatten().all(is_texture)
}

/// Gives warnings their codes. False if one is not known.
fn check_warnings(warnings: &mut [Warning], codes: &[u8]) -> bool {
    for (warning, &code) in warnings.iter_mut().zip(codes) {
        warning.code = CODES.get(usize::from(code)).copied().unwrap_or_default();
        warning.detail = printable(&warning.detail);
    }
    codes.len() == warnings.len() && warnings.iter().all(|warning| !warning.code.is_empty())
}

/// Puts the files of the bundle, which are paid for, where stand-ins are. False if one is not there.
fn put_images(raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<bool, MeshError> {
    for image in &mut raw.images {
        image.name = printable(&image.name);
        let ImageContent::Encoded(bytes) = &mut image.content else { continue };
        let Some(Ok(number)) = bytes.strip_prefix(STAND_IN).map(<[u8; 4]>::try_from) else { continue };
        let Some(file) = cx.bundle.try_file(u32::from_le_bytes(number) as usize) else { return Ok(false) };
        cx.budget.spend("a texture file", file.bytes.len() as u64, 1)?;
        *bytes = file.bytes.as_ref().into();
    }
    Ok(true)
}

/// Text of the other process without control characters, cut to a length that messages have.
fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).take(1024).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::isolate::IsolationError;
    use crate::import::normalise;
    use crate::import::test_random::Random;
    use crate::mesh::LineOrPoint;
    use crate::mesh::material::ImageSource;

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
        normalise(raw, &mut cx).map(|(mesh, _)| mesh.triangles.len())
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

    #[test]
    fn a_mesh_that_no_importer_makes_is_refused() {
        fn slot(read: &mut Read, slot: MaterialSlot) {
            read.raw.materials.push(slot);
        }
        let spoils: &[fn(&mut Read)] = &[
            |read| read.raw.positions.truncate(1),
            |read| read.raw.normals.push([0.0; 3]),
            |read| read.raw.uvs.push([0.0; 2]),
            |read| read.raw.second_uvs.push([0.0; 2]),
            |read| read.raw.colors.push([0.0; 4]),
            |read| read.raw.triangles[0][2] = read.raw.positions.len() as u32,
            |read| read.raw.edge_masks[0] = 8,
            |read| read.raw.edge_masks.push(0),
            |read| read.raw.triangle_materials[0] = 9,
            |read| read.raw.triangle_materials.truncate(1),
            |read| read.raw.lines_and_points.push(LineOrPoint::point(u32::MAX, 0)),
            |read| read.raw.lines_and_points.push(LineOrPoint::point(0, 9)),
            |read| read.raw.report.format = Format::Glb,
            |read| read.raw.report.metadata.extensions_used.push("x".into()),
            |read| read.raw.report.metadata.extensions_required.push("x".into()),
            |read| read.raw.report.warnings.push(Warning { code: "", detail: "x".into() }),
            |read| read.codes.push(0),
            |read| {
                read.raw.report.warnings.push(Warning { code: "", detail: "x".into() });
                read.codes.push(200);
            },
            |read| {
                let content = ImageContent::Encoded([STAND_IN, &[9, 0, 0, 0]].concat().into());
                read.raw.images.push(ImageSource { name: "x".into(), content });
            },
            |read| slot(read, MaterialSlot { base_color: Some([0.0, 1.5, 0.0, 1.0]), ..MaterialSlot::default() }),
            |read| slot(read, MaterialSlot { metallic: Some(-1.0), ..MaterialSlot::default() }),
            |read| slot(read, MaterialSlot { roughness: Some(f32::NAN), ..MaterialSlot::default() }),
            |read| slot(read, MaterialSlot { emissive: Some([1e5; 3]), ..MaterialSlot::default() }),
            |read| slot(read, MaterialSlot { alpha: AlphaMode::Mask(2.0), ..MaterialSlot::default() }),
            |read| slot(read, MaterialSlot { normal_scale: Some(f32::INFINITY), ..MaterialSlot::default() }),
            |read| slot(read, MaterialSlot { occlusion_texture_strength: Some(2.0), ..MaterialSlot::default() }),
            |read| slot(read, MaterialSlot { base_texture: Some(TextureRef::new(99)), ..MaterialSlot::default() }),
            |read| slot(read, MaterialSlot { occlusion_texture: Some(TextureRef::new(99)), ..MaterialSlot::default() }),
        ];
        for (number, &spoil) in spoils.iter().enumerate() {
            let refused = outcome(FILES[0], move |answer| {
                let Ok(Answer::Mesh(mut read)) = postcard::from_bytes(&answer) else { panic!("{number}: no mesh") };
                spoil(&mut read);
                postcard::to_stdvec(&Answer::Mesh(read)).unwrap()
            });
            assert_eq!(refused.unwrap_err().fault, MeshFault::DecoderCrashed, "{number}");
        }
    }
}
