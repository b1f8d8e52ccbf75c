//! `meshsnap diff`: says what differs between two meshes, or two pictures.

mod meshes;
mod pictures;

use std::fs::{self, File};
use std::io::Read as _;

use clap::{Args, ValueEnum, ValueHint};
use image::ImageFormat;
use serde::Serialize;

use super::format_arg::FormatArg;
use super::isolation;
use super::output::{Destination, Inputs};
use super::render::by_extension;
use super::settings::LimitSettings;
use crate::error::CliError;
use meshsnap_inspect::diff::pictures::sniff;
use meshsnap_render::encode;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;

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
    /// Largest mean difference of pictures that a person sees (FLIP), from 0 to 1; pixels then count only beside
    /// --max-pixels
    #[arg(long, value_name = "F", value_parser = share, allow_negative_numbers = true, value_hint = ValueHint::Other)]
    max_flip: Option<f64>,
    /// Numbers that the colours of `-o` show of two pictures
    #[arg(long, value_name = "KIND", value_enum, default_value_t = Heat::Channels)]
    heat: Heat,
    /// Picture of both sides and their difference, beside each other
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    side_by_side: Option<String>,
    /// Animated picture (PNG, WebP) that shows one side and then the other
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    blink: Option<String>,
    /// Read the files that a mesh refers to from its own folder, to compare materials and textures
    #[arg(long)]
    siblings: bool,
    #[command(flatten)]
    format_in: FormatArg,
    #[command(flatten)]
    limits: LimitSettings,
}

/// The numbers that colours show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Heat {
    /// The largest difference of a channel.
    Channels,
    /// The difference that a person sees.
    Flip,
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("give a number from 0 to 1, such as 0.05".to_owned()),
    }
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
            let has_other =
                arguments.max_pixels.is_some() || arguments.max_error.is_some() || arguments.max_flip.is_some();
            let sentence =
                "--max-pixels, --max-error and --max-flip are for pictures (PNG, WebP, JPEG), and these are none";
            refuse(has_other, sentence)?;
            refuse(arguments.heat != Heat::Channels, "--heat is for pictures (PNG, WebP, JPEG), and these are none")?;
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

/// A picture to write: its name and its place.
struct Output<'a> {
    name: &'a str,
    destination: Destination,
}

/// The pictures to write.
struct Outputs<'a> {
    heat: Option<Output<'a>>,
    side_by_side: Option<Output<'a>>,
    blink: Option<Output<'a>>,
}

impl<'a> Outputs<'a> {
    fn of(arguments: &'a DiffArgs) -> Result<Self, CliError> {
        let inputs = Inputs::of([&arguments.a, &arguments.b].into_iter().map(String::as_str));
        let output = |flag: &str, name: &'a Option<String>| -> Result<Option<Output<'a>>, CliError> {
            let Some(name) = name.as_deref() else { return Ok(None) };
            if name == "-" {
                return Err(CliError::usage(format!("{flag} -: standard output has the difference; name a file")));
            }
            format_of(name)?;
            Ok(Some(Output { name, destination: Destination::new(name, &inputs)? }))
        };
        let heat = output("-o", &arguments.output)?;
        let side_by_side = output("--side-by-side", &arguments.side_by_side)?;
        let blink = output("--blink", &arguments.blink)?;
        if let Some(Output { name, .. }) = &blink
            && format_of(name)? == meshsnap_render::image::ImageFormat::Jpeg
        {
            return Err(CliError::usage(format!(
                "--blink {name}: JPEG has no animations; name a .png or a .webp file"
            )));
        }
        Ok(Self { heat, side_by_side, blink })
    }

    /// True if there is none.
    fn is_empty(&self) -> bool {
        self.heat.is_none() && self.side_by_side.is_none() && self.blink.is_none()
    }

    /// True if there is one of both sides as they look.
    fn has_sides(&self) -> bool {
        self.side_by_side.is_some() || self.blink.is_some()
    }

    /// Says of each that it is not written.
    fn refuse(&self, why: &str) {
        for Output { name, .. } in [&self.heat, &self.side_by_side, &self.blink].into_iter().flatten() {
            say!("meshsnap: {name}: is not written: {why}");
        }
    }

    /// Writes both sides, and both with their difference.
    fn write_sides(&self, sides: [&Image; 2], difference: &Image) -> Result<(), CliError> {
        if let Some(Output { name, destination }) = &self.side_by_side {
            destination.write(name, &encode(name, &beside([sides[0], sides[1], difference]))?)?;
        }
        if let Some(Output { name, destination }) = &self.blink {
            let frames = [&*sides[0].rgba, &*sides[1].rgba].concat().into();
            let frames = Image { width_px: sides[0].width_px, height_px: 2 * sides[0].height_px, rgba: frames };
            let bytes = encode::encode_animation(&frames, 2, format_of(name)?, EFFORT, &Deadline::default());
            destination.write(name, &bytes.map_err(|error| CliError::ours(error.to_string()))?)?;
        }
        Ok(())
    }
}

/// Pictures of one size beside each other.
fn beside<const N: usize>(images: [&Image; N]) -> Image {
    let [Image { width_px, height_px, .. }, ..] = images[..] else { return images[0].clone() };
    let bytes = *width_px as usize * 4;
    let rows = 0..*height_px as usize;
    let rgba = rows.flat_map(|row| images.map(|image| &image.rgba[row * bytes..][..bytes])).flatten().copied();
    Image { width_px: width_px * N as u32, height_px: *height_px, rgba: rgba.collect() }
}

/// The format that a file's extension names.
fn format_of(name: &str) -> Result<meshsnap_render::image::ImageFormat, CliError> {
    by_extension(name, None).map(|format| format.unwrap_or(meshsnap_render::image::ImageFormat::Png))
}

/// The bytes of a picture with this name.
fn encode(name: &str, image: &Image) -> Result<Vec<u8>, CliError> {
    encode::encode(image, format_of(name)?, EFFORT, &Deadline::default())
        .map_err(|error| CliError::ours(error.to_string()))
}

fn json(difference: &impl Serialize) -> Result<String, CliError> {
    serde_json::to_string_pretty(difference).map(|json| json + "\n").map_err(|error| CliError::ours(error.to_string()))
}
