//! Pictures for the reports and the baseline of `meshsnap check`: a mesh from each view that is asked
//! for, and its topology from the first of them. Those of reports have marks where rules are broken.
//! Beside a picture that looked otherwise before there are the picture of before and one of the
//! difference, if that can be drawn. Before means the commit of `--since`, if the mesh can be read there, or else the
//! accepted picture in the baseline. With `--update`, nothing is compared.

use std::fs;
use std::path::{Path, PathBuf};

use super::baseline::Baseline;
use crate::error::CliError;
use crate::output::{Destination, Inputs};
use meshsnap_inspect::check::{Check, Place};
use meshsnap_inspect::diff::pictures::{Picture, flip, flip_heat, sniff};
use meshsnap_inspect::drawing;
use meshsnap_render::backend::Backends;
use meshsnap_render::encode;
use meshsnap_render::image::{Image, ImageFormat};
use meshsnap_render::limits::{Deadline, Limits};
use meshsnap_render::pipeline::Model;
use meshsnap_render::request::{self, Rules, Words, word_for};
use meshsnap_render::spec::{BackendChoice, NamedView, Spec};

/// Pixels of a picture.
const SIZE: &str = "320x320";

/// Effort of the encoder: the default of `image.effort`.
const EFFORT: u32 = 3;

/// Most faults that are marked in a picture.
const MARKS_MAX: usize = 40;

/// The largest accepted picture that is read, bytes.
const BYTES_MAX: u64 = 16 << 20;

/// The view that shows open and non-manifold edges in colours of their own.
const TOPOLOGY: &str = "topology";

/// Pictures of one view of a file, as PNG.
#[derive(Debug)]
pub struct ViewPictures {
    /// The name of the view.
    pub view: &'static str,
    /// The file as it is, with marks where rules fail.
    pub after: Vec<u8>,
    /// The picture of before, if it differs.
    pub changed: Option<Changed>,
}

/// A picture that is no more as it was.
#[derive(Debug)]
pub struct Changed {
    /// The picture of before.
    pub before: Vec<u8>,
    /// The differences in colour, if the picture of before can be read and is of the same size.
    pub difference: Option<Vec<u8>>,
    /// The mean difference that a person sees (FLIP).
    pub flip: f64,
}

/// The pictures with which those of a file are compared.
pub struct Against<'a> {
    /// The accepted pictures.
    pub baseline: Option<&'a Baseline>,
    /// The pictures are accepted from now on.
    pub is_update: bool,
    /// The file as it was, whose pictures count rather than the accepted ones.
    pub older: Option<&'a Model>,
}

/// The pictures of a run.
pub struct Pictures {
    views: Vec<(&'static str, Spec)>,
    /// The folder that gets them as files.
    folder: Option<PathBuf>,
    limits: Limits,
    inputs: Inputs,
}

/// The view of a name.
pub fn view_of(name: &str) -> Option<NamedView> {
    NamedView::ALL.iter().find(|(word, _)| *word == name).map(|&(_, view)| view)
}

impl Pictures {
    /// Pictures of these views, and of the topology in the first one. None without views.
    pub fn new(
        views: &[NamedView],
        folder: Option<PathBuf>,
        limits: &Limits,
        inputs: Inputs,
    ) -> Result<Option<Self>, CliError> {
        let Some(first) = views.first() else { return Ok(None) };
        let rules = Rules { limits: limits.clone(), backend: BackendChoice::Cpu };
        let spec = |view: NamedView, style: &str| {
            let keys = [("size", SIZE), ("view", word_for(view)), ("style", style), ("backend", "cpu")];
            let keys = keys.map(|(key, value)| (key.to_owned(), value.to_owned()));
            request::read(None, &keys, &rules).map_err(|error| CliError::ours(error.to_string()))
        };
        let named = views.iter().map(|view| Ok((word_for(*view), spec(*view, "auto")?)));
        let views =
            named.chain([spec(*first, TOPOLOGY).map(|spec| (TOPOLOGY, spec))]).collect::<Result<_, CliError>>()?;
        Ok(Some(Self { views, folder, limits: limits.clone(), inputs }))
    }

    /// Draws a file, and compares the pictures with those of its older side, through one camera that is fitted to both,
    /// or with those that were accepted.
    pub fn draw(
        &self,
        model: &Model,
        (mesh, checks): (&str, &[Check]),
        against: &Against<'_>,
        backends: &mut Backends,
    ) -> Result<Vec<ViewPictures>, CliError> {
        let deadline = Deadline::default();
        let failed = checks.iter().filter(|check| !check.ok);
        let places: Vec<Place> = failed.flat_map(|check| check.places.iter().copied()).take(MARKS_MAX).collect();
        let mut all = Vec::new();
        for (view, spec) in &self.views {
            let about = |error: CliError| error.about(&format!("{mesh}, {view}"));
            let older = against.older.filter(|_| !against.is_update);
            let mut draw = |model: &Model, beside, spec: &Spec| {
                drawing::draw(model, beside, spec, backends, &deadline).map_err(|error| about(error.into()))
            };
            let mut image = draw(model, older, spec)?;
            let plain = png(&image)?;
            let before = match (older, against.baseline) {
                (Some(older), _) => Some(png(&draw(older, Some(model), &drawing::with_up(model, spec))?)?),
                (None, Some(baseline)) if against.is_update => {
                    baseline.keep_picture(mesh, view, &plain)?;
                    None
                }
                (None, Some(baseline)) => baseline.picture(mesh, view, BYTES_MAX)?,
                (None, None) => None,
            };
            let changed =
                before.filter(|before| *before != plain).map(|before| self.changed(before, &plain)).transpose()?;
            let is_marked = !places.is_empty();
            if is_marked {
                drawing::mark(&mut image, model, older, spec, &places, &deadline)
                    .map_err(|error| about(error.into()))?;
            }
            all.push(ViewPictures { view, after: if is_marked { png(&image)? } else { plain }, changed });
        }
        Ok(all)
    }

    /// The difference from an accepted picture.
    fn changed(&self, before: Vec<u8>, after: &[u8]) -> Result<Changed, CliError> {
        let read = |bytes: &[u8]| Picture::read(bytes, sniff(bytes)?, &self.limits).ok();
        let pair = read(&before).zip(read(after));
        let seen = pair.as_ref().and_then(|(a, b)| flip(a, b));
        let heat = pair.and_then(|(a, b)| flip_heat(&a, &b));
        let difference = heat.map(|heat| png(&heat)).transpose()?;
        Ok(Changed { before, difference, flip: seen.map_or(1.0, |seen| seen.mean) })
    }

    /// Writes the pictures of a file into the folder, if there is one. Returns the name of each by its view.
    pub fn write(&self, picture: &Path, pictures: &[ViewPictures]) -> Result<Vec<(&'static str, String)>, CliError> {
        let Some(folder) = &self.folder else { return Ok(Vec::new()) };
        let mut names = Vec::new();
        for ViewPictures { view, after, changed } in pictures {
            let write = |kind: &str, bytes: &[u8]| -> Result<String, CliError> {
                let path = folder.join(picture).with_extension(format!("{kind}.png"));
                let name = path.to_string_lossy().into_owned();
                let unwritable = |error: std::io::Error| CliError::usage(format!("{name}: cannot be written: {error}"));
                fs::create_dir_all(path.parent().unwrap_or(Path::new("."))).map_err(unwritable)?;
                Destination::new(&name, &self.inputs)?.write(&name, bytes)?;
                Ok(name)
            };
            if let Some(Changed { before, difference, .. }) = changed {
                write(&format!("{view}.before"), before)?;
                if let Some(difference) = difference {
                    write(&format!("{view}.difference"), difference)?;
                }
            }
            names.push((*view, write(view, after)?));
        }
        Ok(names)
    }
}

fn png(image: &Image) -> Result<Vec<u8>, CliError> {
    encode::encode(image, ImageFormat::Png, EFFORT, &Deadline::default())
        .map_err(|error| CliError::ours(error.to_string()))
}
