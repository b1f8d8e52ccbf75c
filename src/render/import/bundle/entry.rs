//! The choice of the file that holds the mesh among the files of an upload, and of the format that
//! it is read as.
//!
//! The mesh is the file that the client names. Without a name it is the start part of a package such
//! as 3MF, or the only file, or the only one that is a mesh. The format is the client's, or that of the
//! package, or else found from the bytes.

use crate::import::bundle::{Bundle, BundleFile, Origin, UNNAMED, is_zip, show, show_all};
use crate::import::formats::FORMATS;
use crate::import::sniff::foreign;
use crate::import::{Folder, Format, MeshError, MeshFault, sniff};
use crate::limits::Deadline;

/// Finds the mesh among the unpacked files of a bundle: the one that it names as its entry, a package (such as 3MF)
/// that all of its files make up, or the only one that is a mesh. `format` overrides sniffing.
pub fn choose(
    files: Vec<BundleFile>,
    bundle: &Bundle,
    format: Option<Format>,
    deadline: &Deadline,
) -> Result<(Folder, Format), MeshError> {
    let (entry, origin) = (bundle.entry.as_deref(), bundle.origin);
    let packages = FORMATS.iter().filter(|row| entry.is_none() && format.is_none_or(|format| format == row.format));
    for row in packages {
        if let Some(number) = row.package_start.and_then(|start| start(&files)) {
            return Ok((Folder::new(files, number).of_bundle(bundle), row.format));
        }
    }
    let folder = Folder::new(files.clone(), 0).of_bundle(bundle);
    let number = match entry {
        Some(name) => folder
            .at("", name)
            .ok()
            .flatten()
            .or_else(|| folder.of_base_name(name))
            .ok_or_else(|| unknown(name, &files, origin))?,
        None if files.len() == 1 => 0,
        None => only_mesh(&files, format, origin, deadline)?,
    };
    let format = match format {
        Some(format) => {
            refuse_foreign(&files[number], format)?;
            format
        }
        None => {
            let file = &files[number];
            // A single unnamed file needs no name in the error.
            let is_named = files.len() > 1 || file.path != UNNAMED;
            let what = if is_named { format!("\"{}\"", show(&file.path)) } else { origin.unnamed().into() };
            sniff::sniff(&file.bytes, &what, origin)?
        }
    };
    Ok((folder.with_entry(number), format))
}

/// Refuses a file of another kind that a format without a signature would read as garbage.
fn refuse_foreign(file: &BundleFile, format: Format) -> Result<(), MeshError> {
    match foreign::kind_of(&file.bytes).filter(|_| format == Format::Obj) {
        Some(kind) => {
            let sentence = kind.sentence(&format!("\"{}\"", show(&file.path)), &Format::list());
            Err(MeshError::new(MeshFault::Unrecognised, sentence))
        }
        None => Ok(()),
    }
}

fn only_mesh(
    files: &[BundleFile],
    format: Option<Format>,
    origin: Origin,
    deadline: &Deadline,
) -> Result<usize, MeshError> {
    let mut meshes = Vec::new();
    for (number, file) in files.iter().enumerate() {
        deadline.check()?;
        if is_mesh(file, format) {
            meshes.push(number);
        }
    }
    match meshes[..] {
        [number] => Ok(number),
        [] => Err(no_mesh(files, origin)),
        _ => {
            let names = show_all(meshes.iter().map(|&number| files[number].path.as_str()));
            let option = origin.entry_option();
            let detail = format!("several files are meshes: {names}; say which one to draw with {option}");
            Err(MeshError::new(MeshFault::EntryUnclear, detail))
        }
    }
}

/// True if a file is certainly a mesh. Among other files, one that only resembles an STL is more
/// likely a texture.
fn is_mesh(file: &BundleFile, format: Option<Format>) -> bool {
    let by_name = Format::from_extension(&file.extension());
    let sniffed = sniff::sniff_among_others(&file.bytes, by_name);
    match format {
        Some(format) => [by_name, sniffed].into_iter().flatten().any(|found| found.name() == format.name()),
        None => sniffed.is_some(),
    }
}

fn no_mesh(files: &[BundleFile], origin: Origin) -> MeshError {
    if files.is_empty() {
        let detail =
            format!("there are no files in it, and there should be a mesh ({}) and what belongs to it", Format::list());
        return MeshError::new(MeshFault::Unrecognised, detail);
    }
    let names = show_all(files.iter().map(|file| file.path.as_str()));
    let detail = format!("none of the files is a mesh in a known format ({}): there is {names}", Format::list());
    // Only the upload itself is opened as an archive: nested archives could go on without end.
    match files.iter().find(|file| is_zip(&file.bytes)) {
        Some(file) => {
            let detail = format!("{detail}; \"{}\" is {}", show(&file.path), sniff::inner_zip(origin));
            MeshError::new(MeshFault::BundleBroken, detail)
        }
        None => MeshError::new(MeshFault::Unrecognised, detail),
    }
}

fn unknown(name: &str, files: &[BundleFile], origin: Origin) -> MeshError {
    let names = show_all(files.iter().map(|file| file.path.as_str()));
    let detail = format!("{} is \"{}\", and there is no such file among {names}", origin.entry_option(), show(name));
    MeshError::new(MeshFault::EntryUnclear, detail)
}
