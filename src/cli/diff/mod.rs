//! `meshsnap diff`: says what differs between two meshes, or two pictures.

mod meshes;
mod pictures;

use std::fs::{self, File};
use std::io::Read as _;

use clap::builder::PossibleValuesParser;
use clap::{Args, ValueHint};
use image::ImageFormat;
use serde::Serialize;

use super::isolation;
use super::output::{Destination, Inputs};
use super::render::by_extension;
use super::settings::LimitSettings;
use crate::cli::error::CliError;
use crate::diff::pictures::sniff;
use crate::encode;
use crate::image::Image;
use crate::import::Format;
use crate::limits::Deadline;

/// Bytes by which a picture is told from a mesh.
const HEAD_BYTES: u64 = 64;

/// Effort of the encoder: the default of `image.effort`.
const EFFORT: u32 = 3;

/// Examples at the end of `--help`.
pub const EXAMPLES: &str = "\
Examples:
  meshsnap diff old/hinge.stl new/hinge.stl
  meshsnap diff hinge.stl hinge.glb --max-distance 0.01
  meshsnap diff a.obj b.obj --siblings --json
  meshsnap diff old.stl new.stl -o heat.png
  meshsnap diff golden.png drawn.png --max-error 2 --max-pixels 10 -o heat.png

Vertex order, face order and the format do not count, nor does what encodings round away: a millionth of the
bounding box's diagonal. Of pictures, every pixel counts. Exit codes: 0 both are the same, 1 they differ or one cannot be read, 2 the command line is
at fault, 3 meshsnap or the machine is.";

/// Arguments of `diff`.
#[derive(Args)]
pub struct DiffArgs {
    /// Mesh or picture (PNG, WebP, JPEG) as it was; `-` for a mesh from standard input
    #[arg(value_name = "A", value_hint = ValueHint::FilePath)]
    a: String,
    /// Mesh or picture as it is; `-` for a mesh from standard input
    #[arg(value_name = "B", value_hint = ValueHint::FilePath)]
    b: String,
    /// Picture of the difference: of meshes both sides through one camera, in the colours of their distance; of
    /// pictures the second one in grey, with what differs in colour
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    output: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Largest distance between the surfaces that counts as the same, in the files' units [default: what encodings
    /// round away]
    #[arg(long, value_name = "D", value_parser = distance, allow_negative_numbers = true, value_hint = ValueHint::Other)]
    max_distance: Option<f64>,
    /// Pixels of pictures that may differ [default: 0]
    #[arg(long, value_name = "N", value_hint = ValueHint::Other)]
    max_pixels: Option<u64>,
    /// Largest difference of a channel at which a pixel counts as the same, in steps of 255 [default: 0]
    #[arg(long, value_name = "E", value_parser = distance, allow_negative_numbers = true, value_hint = ValueHint::Other)]
    max_error: Option<f64>,
    /// Read the files that a mesh refers to from its own folder, to compare materials and textures
    #[arg(long)]
    siblings: bool,
    #[arg(
        long,
        value_name = "FORMAT",
        help = "Format of the meshes, where their bytes do not tell",
        value_parser = PossibleValuesParser::new(Format::names()),
        ignore_case = true
    )]
    format_in: Option<String>,
    #[command(flatten)]
    limits: LimitSettings,
}

fn distance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(distance) if distance.is_finite() && distance >= 0.0 => Ok(distance),
        _ => Err("give a number from 0 on, such as 0.01".to_owned()),
    }
}

/// Prints the difference. Fails where there is one.
pub fn run(arguments: &DiffArgs) -> Result<(), CliError> {
    isolation::on_demand();
    let DiffArgs { a, b, .. } = arguments;
    if a == "-" && b == "-" {
        return Err(CliError::usage("`-`, standard input, can be given once"));
    }
    let limits = arguments.limits.config().limits;
    let is_same = match [a, b].map(|name| picture_format(name)) {
        [Some(a), Some(b)] => {
            refuse(arguments.max_distance.is_some(), "--max-distance is for meshes, and these are pictures")?;
            refuse(arguments.siblings, "--siblings is for meshes, and these are pictures")?;
            pictures::run(arguments, [a, b], &limits)?
        }
        [None, None] => {
            let has_other = arguments.max_pixels.is_some() || arguments.max_error.is_some();
            refuse(has_other, "--max-pixels and --max-error are for pictures (PNG, WebP, JPEG), and these are none")?;
            meshes::run(arguments, &limits)?
        }
        [of_a, _] => {
            let (picture, other) = if of_a.is_some() { (a, b) } else { (b, a) };
            return Err(CliError::usage(format!("{picture} is a picture and {other} is none: give two of a kind")));
        }
    };
    if is_same { Ok(()) } else { Err(CliError::silent(1)) }
}

fn refuse(is_wrong: bool, sentence: &str) -> Result<(), CliError> {
    if is_wrong { Err(CliError::usage(sentence)) } else { Ok(()) }
}

/// The format of a picture, by its first bytes. None for other files, those that cannot be read, and standard input.
fn picture_format(name: &str) -> Option<ImageFormat> {
    let mut head = Vec::new();
    if name == "-" || !fs::metadata(name).ok()?.is_file() {
        return None;
    }
    File::open(name).ok()?.take(HEAD_BYTES).read_to_end(&mut head).ok()?;
    sniff(&head)
}

/// The picture to write, with its place.
fn output(arguments: &DiffArgs) -> Result<Option<(&str, Destination)>, CliError> {
    let Some(name) = arguments.output.as_deref() else { return Ok(None) };
    if name == "-" {
        return Err(CliError::usage("-o -: standard output has the difference; name a file"));
    }
    format_of(name)?;
    let inputs = Inputs::of([&arguments.a, &arguments.b].into_iter().map(String::as_str));
    Ok(Some((name, Destination::new(name, &inputs)?)))
}

/// The format that a file's extension names.
fn format_of(name: &str) -> Result<crate::image::ImageFormat, CliError> {
    by_extension(name, None).map(|format| format.unwrap_or(crate::image::ImageFormat::Png))
}

/// The bytes of a picture with this name.
fn encode(name: &str, image: &Image) -> Result<Vec<u8>, CliError> {
    encode::encode(image, format_of(name)?, EFFORT, &Deadline::default())
        .map_err(|error| CliError::ours(error.to_string()))
}

fn json(difference: &impl Serialize) -> Result<String, CliError> {
    serde_json::to_string_pretty(difference).map(|json| json + "\n").map_err(|error| CliError::ours(error.to_string()))
}
