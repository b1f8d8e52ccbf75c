//! Sends each mesh of the test data to a server: valid files are drawn, on both back-ends alike,
//! and broken ones are refused. A file counts as broken if the Khronos glTF validator found errors
//! in it; its reports lie beside the glTF files. Each exception has a reason in `explained.rs`.
//!
//!     cargo test --test suite agreement -- --nocapture
//!
//! prints it all as a Markdown table.

use crate::formats::real_files::explained::{EXPLAINED, UNLIKE};
use crate::support::data::{self, files};
use crate::support::files::bundle::zipped;
use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::server::{Answer, Server};
use meshsnap_inspect::report::Extras;
use meshsnap_render::image::Image;
use meshsnap_render::import::{Bundle, BundleFile, Format, survey};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The request for every file.
const LOOK: &str = "size=64&samples=4&style=smooth&background=transparent";
/// Extensions of files that are meshes; one of a fuzzer has none.
const MESHES: [&str; 7] = ["obj", "stl", "ply", "off", "gltf", "glb", ""];
/// Extensions of files that go along with a mesh, or speak of it.
const BESIDE: [&str; 7] = ["mtl", "bin", "png", "jpg", "webp", "ktx2", "json"];

#[test]
fn the_validator_and_meshsnap_agree_or_it_is_said_why_not() {
    let rows = rows_of(&[data::folder("models"), data::folder("corpus")]);
    let counts = [rows.len(), drawn(&rows), rows.iter().filter(|row| row.is_counted()).count()];
    assert_eq!(counts, [181, 68, 62], "files, drawn, compared with the validator's totals");
    assert_eq!(rows.iter().filter(|row| row.validator.is_some()).count(), 97);
    for (name, _) in EXPLAINED.iter().chain(UNLIKE) {
        assert!(rows.iter().any(|row| row.name == *name), "{name} is explained, and is not there");
    }
}

#[test]
fn large_models_are_drawn_alike_on_both_back_ends() {
    let Some(models) = data::large_folder("models") else { return };
    let rows = rows_of(&[models]);
    // The folder may grow.
    assert!(rows.len() >= 44, "only {} files", rows.len());
    assert_eq!(drawn(&rows), rows.len());
}

fn drawn(rows: &[Row]) -> usize {
    rows.iter().filter(|row| row.status == 200).count()
}

/// Sends all meshes of the folders to a server, and fails where one has a fault.
fn rows_of(folders: &[PathBuf]) -> Vec<Row> {
    // What is compared is files, not times: a busy machine may take long for the largest.
    let server = Server::start(&["--workers", "1", "--limit-job-ms", "10m"]);
    let bench = Bench { server, has_gpu: gpus().is_some() };
    let mut rows = Vec::new();
    for folder in folders {
        for path in files(folder).iter().filter(|path| is_mesh(path)) {
            let name = path.strip_prefix(folder.parent().unwrap()).unwrap().to_string_lossy().into_owned();
            rows.push(bench.row(name, path));
        }
    }
    print(&rows);
    let faults: Vec<String> = rows.iter().flat_map(|row| row.faults.clone()).collect();
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
    let compared = rows.iter().filter(|row| row.likeness.is_some()).count();
    assert_eq!(compared, if bench.has_gpu { drawn(&rows) } else { 0 });
    rows
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

fn is_mesh(path: &Path) -> bool {
    let extension = extension(path);
    let is_mesh = MESHES.contains(&extension.as_str());
    let is_beside = BESIDE.contains(&extension.as_str()) || path.ends_with("README.md");
    assert!(is_mesh != is_beside, "{}: neither a mesh nor what goes with one", path.display());
    is_mesh
}

/// Draw calls, vertices and triangles.
type Totals = [u64; 3];

/// The validator's report.
struct Verdict {
    errors: u64,
    first: String,
    /// None where it could not read the file.
    totals: Option<Totals>,
}

impl Verdict {
    fn of(path: &Path) -> Option<Self> {
        let report = std::fs::read(format!("{}.report.json", path.display())).ok()?;
        let report: Value = serde_json::from_slice(&report).unwrap();
        let messages = report["issues"]["messages"].as_array();
        let first = messages.and_then(|all| all.iter().find(|message| message["severity"] == 0));
        let first = first.map_or_else(String::new, |message| message["code"].as_str().unwrap().to_owned());
        let errors = report["issues"]["numErrors"].as_u64().unwrap();
        assert_eq!(errors == 0, first.is_empty(), "{}", path.display());
        let info = &report["info"];
        let totals = ["drawCallCount", "totalVertexCount", "totalTriangleCount"].map(|key| info[key].as_u64());
        Some(Self { errors, first, totals: info.is_object().then(|| totals.map(Option::unwrap)) })
    }
}

/// A line of the table.
struct Row {
    name: String,
    validator: Option<Verdict>,
    status: u16,
    /// Of a refusal.
    code: String,
    /// Of what could be read; glTF alone.
    totals: Option<Totals>,
    /// Of the CPU's picture and the GPU's.
    likeness: Option<Likeness>,
    why: Option<&'static str>,
    faults: Vec<String>,
}

struct Bench {
    server: Server,
    has_gpu: bool,
}

impl Bench {
    fn row(&self, name: String, path: &Path) -> Row {
        let validator = Verdict::of(path);
        let files = upload(path);
        let answer = self.draw(&files, validator.is_some(), "cpu");
        let mut row = Row {
            code: if answer.status == 200 { String::new() } else { answer.json()["code"].as_str().unwrap().to_owned() },
            status: answer.status,
            totals: totals(&files, validator.is_some(), answer.status == 200),
            likeness: None,
            why: EXPLAINED.iter().find(|(known, _)| *known == name).map(|(_, why)| *why),
            name,
            validator,
            faults: Vec::new(),
        };
        if answer.status == 200 && self.has_gpu {
            let other = self.draw(&files, row.validator.is_some(), "gpu");
            assert_eq!(other.status, 200, "{}: {}", row.name, String::from_utf8_lossy(&other.body));
            assert_eq!([&answer, &other].map(|a| a.header("x-render-backend")), [Some("cpu"), Some("gpu")]);
            row.likeness = Some(Likeness::of(&picture(&answer), &picture(&other)));
        }
        row.judge(&answer);
        row
    }

    /// The entry comes first. The format is named only where the validator was told it, too.
    fn draw(&self, files: &[(String, Vec<u8>)], is_said_gltf: bool, backend: &str) -> Answer {
        let format = if is_said_gltf { "&format_in=gltf" } else { "" };
        let query = format!("/v1/render?{LOOK}&backend={backend}{format}");
        match files {
            [(_, single)] => self.server.post(&query, single),
            [(entry, _), ..] => {
                let entry: String = entry.bytes().map(|byte| format!("%{byte:02x}")).collect();
                let files: Vec<_> = files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
                self.server.post(&format!("{query}&entry={entry}"), &zipped(&files))
            }
            [] => panic!("nothing to send"),
        }
    }
}

/// A file, and what lies beside it.
fn upload(path: &Path) -> Vec<(String, Vec<u8>)> {
    let goes_along = |other: &PathBuf| {
        other.parent() == path.parent() && BESIDE.contains(&extension(other).as_str()) && extension(other) != "json"
    };
    let beside = files(path.parent().unwrap()).into_iter().filter(goes_along);
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    let all = std::iter::once(path.to_path_buf()).chain(beside);
    all.map(|path| (name(&path), std::fs::read(&path).unwrap())).collect()
}

/// The content of the file's meshes by `inspect --json`; where nothing can be drawn, by the
/// importer.
fn totals(files: &[(String, Vec<u8>)], is_said_gltf: bool, is_drawn: bool) -> Option<Totals> {
    let format = is_said_gltf.then_some(Format::Gltf);
    let entry = files[0].0.clone();
    let files = files.iter().map(|(name, bytes)| BundleFile::new(name, bytes.clone()).unwrap()).collect();
    let (bundle, limits) = (Bundle::of_files(files).with_entry(Some(entry)), Limits::default());
    let surveyed = survey(&bundle, format, &limits, &mut Budget::new(&limits), &Deadline::default());
    let surveyed = surveyed.ok()?.content.map(|c| [c.draw_calls, c.vertices, c.triangles]);
    if is_drawn {
        let report = meshsnap_inspect::report::inspect(
            &bundle,
            format,
            Extras::default(),
            &limits,
            &mut Budget::new(&limits),
            &Deadline::default(),
            &mut |_| {},
        )
        .unwrap();
        let report: Value = serde_json::from_str(&report.json().unwrap()).unwrap();
        let content = &report["file_content"];
        let inspected = ["draw_calls", "vertices", "triangles"].map(|key| content[key].as_u64());
        assert_eq!(inspected, [0, 1, 2].map(|k| surveyed.map(|totals| totals[k])), "{report}");
    }
    surveyed
}

fn picture(answer: &Answer) -> Image {
    let picture = image::load_from_memory(&answer.body).unwrap().to_rgba8();
    Image { width_px: picture.width(), height_px: picture.height(), rgba: picture.into_raw().into() }
}

impl Row {
    /// True if its totals were compared with the validator's.
    fn is_counted(&self) -> bool {
        self.totals.is_some() && self.validator.is_some()
    }

    /// Collects its faults.
    fn judge(&mut self, answer: &Answer) {
        let mut faults = Vec::new();
        let is_valid = self.validator.as_ref().is_none_or(|validator| validator.errors == 0);
        // A broken file is not refused for its fault where there is merely nothing in it.
        let is_read = self.status == 200 || self.code == "mesh_empty";
        let agrees = if is_valid { self.status == 200 } else { !is_read && self.status == 422 };
        match (agrees, self.why) {
            (true, Some(_)) => faults.push("is explained, and there is nothing to explain".to_owned()),
            (false, None) => faults.push(format!("valid: {is_valid}, {} {}", self.status, self.code)),
            _ => {}
        }
        if !matches!(self.status, 200 | 413 | 415 | 422) {
            faults.push(format!("{}", self.status));
        }
        if self.status == 200 && picture(answer).rgba.chunks(4).all(|pixel| pixel[3] == 0) {
            faults.push("the picture is blank".to_owned());
        }
        let theirs = self.validator.as_ref().and_then(|validator| validator.totals);
        if is_read && self.validator.is_some() && self.totals != theirs {
            faults.push(format!("{:?}, and the validator counts {theirs:?}", self.totals));
        }
        let is_unlike = self.likeness.is_some_and(|likeness| !likeness.is_within(Tolerance::TWINS));
        let is_said = UNLIKE.iter().any(|(known, _)| *known == self.name);
        if is_unlike != is_said && self.likeness.is_some() {
            faults.push(format!("CPU and GPU: {:?}", self.likeness));
        }
        self.faults = faults.into_iter().map(|fault| format!("{}: {fault}", self.name)).collect();
    }
}

fn print(rows: &[Row]) {
    let counted = |totals: Option<Totals>| {
        totals
            .map_or_else(String::new, |[calls, vertices, triangles]| format!(", {vertices} v {triangles} t {calls} dc"))
    };
    println!("\nv: vertices, t: triangles, dc: draw calls\n");
    println!("| file | validator | meshsnap | cpu = gpu | why |\n|---|---|---|---|---|");
    for row in rows {
        let validator = row.validator.as_ref().map_or_else(String::new, |validator| {
            let verdict = match validator.errors {
                0 => "valid".to_owned(),
                1 => format!("1 error, {}", validator.first),
                n => format!("{n} errors, {}", validator.first),
            };
            verdict + &counted(validator.totals)
        });
        let ours = format!("{} {}", row.status, row.code).trim().to_owned() + &counted(row.totals);
        let same = match row.likeness {
            Some(likeness) if likeness.differing() == 0 => "equal".to_owned(),
            Some(likeness) => likeness.to_string(),
            None if row.status == 200 => "no Vulkan".to_owned(),
            None => String::new(),
        };
        println!("| {} | {validator} | {ours} | {same} | {} |", row.name, row.why.unwrap_or_default());
    }
    let count = |is: &dyn Fn(&Row) -> bool| rows.iter().filter(|row| is(row)).count();
    let compared = count(&|row| row.likeness.is_some());
    println!(
        "\n{} files: {} drawn, {compared} of them on both back-ends; {} refused; {} explained; {} of {} with the validator's \
         totals",
        rows.len(),
        count(&|row| row.status == 200),
        count(&|row| row.status != 200),
        count(&|row| row.why.is_some()),
        count(&|row| row.is_counted() && row.faults.is_empty()),
        count(&Row::is_counted),
    );
}
