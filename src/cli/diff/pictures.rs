//! What differs between two pictures.

use image::ImageFormat;

use super::{DiffArgs, encode};
use crate::cli::error::CliError;
use crate::cli::files;
use crate::diff::pictures::{self, Picture, Tolerance};
use crate::limits::Limits;

/// Compares two pictures and prints the difference. Returns whether they are the same.
pub fn run(arguments: &DiffArgs, formats: [ImageFormat; 2], limits: &Limits) -> Result<bool, CliError> {
    let DiffArgs { a, b, .. } = arguments;
    let read = |name: &str, format| {
        let bytes = files::read(name, limits.memory_bytes / 6)?;
        Picture::read(&bytes, format, limits).map_err(|error| CliError::input(format!("{name}: {error}")))
    };
    let (a, b) = (read(a, formats[0])?, read(b, formats[1])?);
    let tolerance =
        Tolerance { pixels: arguments.max_pixels.unwrap_or_default(), error: arguments.max_error.unwrap_or_default() };
    let difference = pictures::compare(&a, &b, tolerance);
    if let Some((name, destination)) = super::output(arguments)? {
        match pictures::heat(&a, &b, tolerance) {
            Some(heat) => destination.write(name, &encode(name, &heat)?)?,
            None => say!("meshsnap: {name}: is not written: the pictures have different sizes"),
        }
    }
    let text = match arguments.json {
        true => super::json(&difference)?,
        false => difference.text(),
    };
    files::print(text.as_bytes())?;
    Ok(difference.same)
}
