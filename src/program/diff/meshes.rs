//! The comparison of two meshes by `meshsnap diff`: it prints the differences as text or JSON, and writes pictures of
//! them if they are asked for.

use std::sync::Arc;

use super::{DiffArgs, Output, Outputs};
use crate::bundle::{self, NamedFiles};
use crate::error::CliError;
use crate::progress::Progress;
use crate::{files, siblings};
use meshsnap_inspect::diff::{self, Compared, PICTURE_KEYS};
use meshsnap_inspect::drawing::{self, Side};
use meshsnap_render::backend::cpu::DrawingThreads;
use meshsnap_render::backend::{Backends, GpuHost, HardwareHint};
use meshsnap_render::import::Options;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::pipeline::Model;
use meshsnap_render::request::{self, Rules};
use meshsnap_render::spec::{BackendChoice, Spec};
use meshsnap_server::config::{cores, why_no_gpu};

/// Pixels of each side, where it is a picture of its own.
const SIZE: &str = "512x512";

/// Compares two meshes and prints the difference. Returns whether they are the same.
pub fn run(arguments: &DiffArgs, limits: &Limits) -> Result<bool, CliError> {
    let DiffArgs { a, b, .. } = arguments;
    let outputs = Outputs::of(arguments)?;
    let progress = Progress::start("reading");
    let (named_a, named_b) = (read(arguments, a, limits)?, read(arguments, b, limits)?);
    progress.next("parsing");
    let (model_a, model_b) = (open(arguments, a, &named_a, limits)?, open(arguments, b, &named_b, limits)?);
    progress.next("comparing");
    let about = |error: CliError| error.about(&format!("{a} and {b}"));
    let mut compared = diff::compare(&model_a, &model_b, arguments.max_distance, &Deadline::default())
        .map_err(|error| about(CliError::from(error)))?;
    if have_same_bytes(&named_a, &named_b) {
        compared.difference.summary = vec!["the files are equal, byte for byte".to_owned()];
    }
    if !outputs.is_empty() {
        progress.next("drawing");
        write([&model_a, &model_b], &compared, &outputs, limits).map_err(about)?;
    }
    drop(progress);
    let text = match arguments.json {
        true => super::json(&compared.difference)?,
        false => compared.difference.text(),
    };
    files::print(text.as_bytes())?;
    Ok(compared.difference.same)
}

/// Reads a mesh, and what it refers to if that is asked for.
fn read(arguments: &DiffArgs, name: &str, limits: &Limits) -> Result<NamedFiles, CliError> {
    let mut names = vec![name.to_owned()];
    if arguments.siblings && name != "-" {
        let options = Options::from(arguments.format_in.format());
        names.extend(siblings::all_beside(&names, None, options, limits)?);
    }
    bundle::read(&names, None, limits)
}

fn open(arguments: &DiffArgs, name: &str, named: &NamedFiles, limits: &Limits) -> Result<Model, CliError> {
    let format = arguments.format_in.format();
    meshsnap_inspect::read(&named.bundle, format, limits, Budget::new(limits), &Deadline::default())
        .map_err(|error| CliError::from(error).about(name))
}

/// True if both are the same files, whatever the folder and the name of the mesh.
fn have_same_bytes(a: &NamedFiles, b: &NamedFiles) -> bool {
    let (a, b) = (a.bundle.files(), b.bundle.files());
    match (a, b) {
        ([a], [b]) => a.bytes == b.bytes,
        _ => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.path == b.path && a.bytes == b.bytes),
    }
}

/// Writes pictures, all through one camera.
fn write(models: [&Model; 2], compared: &Compared, outputs: &Outputs<'_>, limits: &Limits) -> Result<(), CliError> {
    let rules = Rules { limits: limits.clone(), backend: BackendChoice::Cpu };
    let spec = |keys: &[(&str, &str)]| {
        let keys: Vec<_> = keys.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        request::read(None, &keys, &rules).map_err(|error| CliError::ours(error.to_string()))
    };
    let (heat, plain) = (spec(&PICTURE_KEYS)?, spec(&[("size", SIZE), ("backend", "cpu")])?);
    let of_one = Spec { image: plain.image, ..heat.clone() };
    let gpu = Arc::new(GpuHost::new(HardwareHint::unless(why_no_gpu()), None));
    let drawing = Arc::new(DrawingThreads::new(cores() as usize));
    drawing.install(|| {
        let mut backends = Backends::sharing(gpu.clone(), drawing.clone());
        let mut draw = |sides: &[Side], spec: &Spec| {
            let deadline = Deadline::default();
            drawing::draw_difference(models, compared, sides, spec, &plain, &mut backends, &deadline)
                .map(|drawn| drawn.image)
                .map_err(CliError::from)
        };
        if let Some(Output { name, destination }) = &outputs.heat {
            let image = draw(&[Side::HeatBefore, Side::HeatAfter], &heat)?;
            destination.write(name, &super::encode(name, &image)?)?;
        }
        if outputs.has_sides() {
            let [before, after] = [Side::Before, Side::After].map(|side| draw(&[side], &of_one));
            let colored = if compared.is_seen_before() { Side::HeatBefore } else { Side::HeatAfter };
            outputs.write_sides([&before?, &after?], &draw(&[colored], &of_one)?)?;
        }
        Ok(())
    })
}
