//! The comparison of two pictures by `meshsnap diff`: it prints the differences as text or JSON, and writes pictures
//! of them if they are asked for.

use image::ImageFormat;

use super::{DiffArgs, Heat, Output, Outputs, encode};
use crate::error::CliError;
use crate::files;
use meshsnap_inspect::diff::pictures::{self, Picture, Tolerance};
use meshsnap_render::limits::Limits;

/// Compares two pictures and prints the difference. Returns whether they are the same.
pub fn run(arguments: &DiffArgs, formats: [ImageFormat; 2], limits: &Limits) -> Result<bool, CliError> {
    let DiffArgs { a, b, .. } = arguments;
    let read = |name: &str, format| {
        let bytes = files::read(name, limits.memory_bytes / 6)?;
        Picture::read(&bytes, format, limits).map_err(|error| CliError::input(format!("{name}: {error}")))
    };
    let (a, b) = (read(a, formats[0])?, read(b, formats[1])?);
    let DiffArgs { max_pixels: pixels, max_flip: flip, .. } = *arguments;
    let tolerance = Tolerance { pixels, error: arguments.max_error.unwrap_or_default(), flip };
    let outputs = Outputs::of(arguments)?;
    let difference = pictures::compare(&a, &b, tolerance);
    if !outputs.is_empty() {
        let heat = match arguments.heat {
            Heat::Channels => pictures::heat(&a, &b, tolerance),
            Heat::Flip => pictures::flip_heat(&a, &b),
        };
        match heat {
            Some(heat) => {
                if let Some(Output { name, destination }) = &outputs.heat {
                    destination.write(name, &encode(name, &heat)?)?;
                }
                outputs.write_sides([&a.image(), &b.image()], &heat)?;
            }
            None => outputs.refuse("the pictures have different sizes"),
        }
    }
    let text = match arguments.json {
        true => super::json(&difference)?,
        false => difference.text(),
    };
    files::print(text.as_bytes())?;
    Ok(difference.same)
}
