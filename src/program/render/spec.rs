//! The request of a picture (what it shows, and how it looks), put together from the request document in JSON, the
//! short flags and `--set`; each overrides those before it. The output's extension overrides the document's format.
//! The error for a wrong value names the place where the user gave it.

use std::path::Path;

use super::RenderArgs;
use crate::error::CliError;
use crate::files;
use meshsnap_render::image::ImageFormat;
use meshsnap_render::import::Format;
use meshsnap_render::limits::Limits;
use meshsnap_render::request::{self, RequestError, RequestFault, Rules};
use meshsnap_render::spec::{BackendChoice, Spec};

/// Reads the request document, the short flags and `--set`; each overrides those before it.
pub fn read(arguments: &RenderArgs, limits: &Limits) -> Result<Spec, CliError> {
    let document = match &arguments.request {
        Some(path) => Some(files::read(&path.to_string_lossy(), limits.memory_bytes)?),
        None => None,
    };
    let flags = flags(arguments);
    let mut overrides: Vec<(String, String)> =
        flags.iter().map(|(_, key, value)| ((*key).to_owned(), value.clone())).collect();
    overrides.extend(pairs(&arguments.set)?);
    let rules = Rules { limits: limits.clone(), backend: BackendChoice::Auto };
    let mut spec = request::read(document.as_deref(), &overrides, &rules)
        .map_err(|error| at_fault(error, arguments, document.as_deref(), &rules))?;
    // A format on the command line overrides the output's extension, which overrides the document's
    // format.
    overrides.retain(|(key, _)| ["format", "image.format", "image"].contains(&key.as_str()));
    let is_given = request::read(None, &overrides, &rules)?.image.format.is_some();
    let format = if is_given { spec.image.format } else { by_extension(&arguments.output, spec.image.format)? };
    request::set_format(&mut spec, format.unwrap_or(ImageFormat::Png));
    Ok(spec)
}

/// The flags that are short for a key: the flag, the key, and the value that is given.
fn flags(arguments: &RenderArgs) -> Vec<(&'static str, &'static str, String)> {
    let sheet = (!arguments.sheet.is_empty()).then(|| arguments.sheet.join(","));
    let all = [
        ("--style", "style", &arguments.style),
        ("--size", "size", &arguments.size),
        ("--view", "view", &arguments.view),
        ("--sheet", "sheet.views", &sheet),
        ("--turntable", "sheet.turntable", &arguments.turntable),
        ("--up", "up", &arguments.up),
        ("--format", "format", &arguments.format),
        ("--backend", "backend", &arguments.backend),
        ("--samples", "samples", &arguments.samples),
        ("--background", "background", &arguments.background),
    ];
    all.into_iter().filter_map(|(flag, key, value)| Some((flag, key, value.clone()?))).collect()
}

/// The error in the words of its source: a flag, `--set`, or the request document.
fn at_fault(error: RequestError, arguments: &RenderArgs, document: Option<&[u8]>, rules: &Rules) -> CliError {
    let of_document = document.and_then(|document| request::read(Some(document), &[], rules).err());
    if let (Some(error), Some(path)) = (of_document, &arguments.request) {
        return CliError::input(format!("{}: {error}", path.display()));
    }
    let is_value = matches!(error.fault, RequestFault::OutOfRange | RequestFault::WrongType);
    let flag = flags(arguments).into_iter().find(|(_, key, _)| is_value && *key == error.key);
    let in_set = format!("{}=", error.key);
    match flag.filter(|_| !arguments.set.iter().any(|pair| pair.starts_with(&in_set))) {
        Some((flag, ..)) => {
            let raise = error.flag.map(|limit| format!(" (raise it with {limit})")).unwrap_or_default();
            CliError::usage(format!("{flag} is {}, and allowed is {}{raise}", error.given, error.allowed))
        }
        None => CliError::usage(format!("--set: {error}")),
    }
}

/// The keys and values given with `--set`.
pub fn pairs(set: &[String]) -> Result<Vec<(String, String)>, CliError> {
    let pair = |text: &String| match text.split_once('=') {
        Some((key, value)) => Ok((key.to_owned(), value.to_owned())),
        None => Err(CliError::usage(format!("--set {text}: write KEY=VALUE, such as wire.color=#f00"))),
    };
    set.iter().map(pair).collect()
}

/// The format of the output's extension, else that of the document.
pub fn by_extension(output: &str, of_document: Option<ImageFormat>) -> Result<Option<ImageFormat>, CliError> {
    if super::is_folder(output) {
        return Ok(of_document);
    }
    let extension = Path::new(output).extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("png") => Ok(Some(ImageFormat::Png)),
        Some("webp") => Ok(Some(ImageFormat::Webp)),
        Some("jpg" | "jpeg") => Ok(Some(ImageFormat::Jpeg)),
        None => Ok(of_document),
        _ if of_document.is_some() => Ok(of_document),
        Some(other) => {
            let sentence =
                format!("{output}: no image format is called `{other}`; write png, webp or jpg, or give --format");
            Err(CliError::usage(sentence))
        }
    }
}

/// The mesh format that `--format-in` names.
pub fn format_in(name: Option<&str>) -> Option<Format> {
    name.and_then(Format::from_name)
}
