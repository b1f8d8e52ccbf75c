//! Baselines of `meshsnap check`: folders of accepted faults, which `--update` writes. A mesh with
//! faults has a JSON file there. A fault that is in it, with no larger number and (if all of its
//! places were recorded) no new place, does not fail the mesh again. If views are asked for, the
//! folder also has the accepted pictures of each mesh.

use std::fs;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::bundle::comparable;
use crate::error::CliError;
use crate::files;
use crate::output::{Destination, Inputs};
use meshsnap_inspect::check::{Check, Figure, Level, Place, Verdict};

/// The largest file that is read, bytes.
const BYTES_MAX: u64 = 4 << 20;

/// A folder of accepted faults.
#[derive(Debug)]
pub struct Baseline {
    folder: PathBuf,
    /// The folder to which the paths of meshes are relative.
    root: PathBuf,
}

/// The file of a mesh.
#[derive(Serialize)]
struct File<'a> {
    sha256: Option<&'a str>,
    faults: Vec<AcceptedFault<'a>>,
}

/// An accepted fault.
#[derive(Serialize)]
struct AcceptedFault<'a> {
    rule: &'a str,
    level: Level,
    found: Option<Figure>,
    detail: &'a str,
    #[serde(rename = "where")]
    places: &'a [Place],
}

/// The same as it is read. Fields that are not needed may be absent or new.
#[derive(Deserialize)]
struct Known {
    faults: Vec<KnownFault>,
}

#[derive(Deserialize)]
struct KnownFault {
    rule: String,
    #[serde(default)]
    found: Option<Value>,
    #[serde(default, rename = "where")]
    places: Vec<Value>,
}

impl Baseline {
    /// A baseline in `folder`, for meshes below `root`.
    pub fn new(folder: PathBuf, root: &Path) -> Self {
        Self { folder, root: comparable(root) }
    }

    /// Marks the faults that are known.
    pub fn apply(&self, verdict: &mut Verdict) -> Result<(), CliError> {
        let path = self.file_of(&verdict.path)?;
        let name = path.display().to_string();
        if let Err(error) = fs::metadata(&path)
            && matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
        {
            return Ok(());
        }
        let of_command = |error: CliError| CliError { exit_code: 2, ..error };
        let bytes = files::read(&name, BYTES_MAX).map_err(of_command)?;
        let known: Known = serde_json::from_slice(&bytes).map_err(|error| {
            CliError::usage(format!("{name}: is no baseline: {error}; write it anew with --update"))
        })?;
        for check in verdict.checks.iter_mut().filter(|check| !check.ok) {
            check.known = known.faults.iter().any(|fault| fault.covers(check));
        }
        verdict.judge();
        Ok(())
    }

    /// Accepts the faults of a mesh: writes its file, or takes it away where there is none.
    pub fn update(&self, verdict: &mut Verdict) -> Result<(), CliError> {
        let path = self.file_of(&verdict.path)?;
        let name = path.display().to_string();
        let unwritable = |error: std::io::Error| CliError::usage(format!("{name}: cannot be written: {error}"));
        let faults: Vec<AcceptedFault<'_>> =
            verdict.checks.iter().filter(|check| !check.ok).map(AcceptedFault::of).collect();
        if faults.is_empty() {
            return match fs::remove_file(&path) {
                Err(error) if !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                    Err(unwritable(error))
                }
                _ => Ok(()),
            };
        }
        let file = File { sha256: verdict.sha256.as_deref(), faults };
        let text = serde_json::to_string_pretty(&file).map_err(|error| CliError::ours(error.to_string()))? + "\n";
        fs::create_dir_all(path.parent().unwrap_or(Path::new("."))).map_err(unwritable)?;
        Destination::new(&name, &Inputs::default())?.write(&name, text.as_bytes())?;
        verdict.checks.iter_mut().filter(|check| !check.ok).for_each(|check| check.known = true);
        verdict.judge();
        Ok(())
    }

    /// The accepted picture of a view; none if there is none.
    pub fn picture(&self, mesh: &str, view: &str, bytes_max: u64) -> Result<Option<Vec<u8>>, CliError> {
        read_if_there(&self.file(mesh, &format!("{view}.png"))?, bytes_max)
            .map_err(|error| CliError { exit_code: 2, ..error })
    }

    /// Accepts the picture of a view.
    pub fn keep_picture(&self, mesh: &str, view: &str, png: &[u8]) -> Result<(), CliError> {
        let path = self.file(mesh, &format!("{view}.png"))?;
        let name = path.display().to_string();
        let unwritable = |error: std::io::Error| CliError::usage(format!("{name}: cannot be written: {error}"));
        fs::create_dir_all(path.parent().unwrap_or(Path::new("."))).map_err(unwritable)?;
        Destination::new(&name, &Inputs::default())?.write(&name, png)
    }

    /// The file of a mesh's faults.
    fn file_of(&self, mesh: &str) -> Result<PathBuf, CliError> {
        self.file(mesh, "json")
    }

    /// A file of a mesh: its path below the root, with an extension more.
    fn file(&self, mesh: &str, extension: &str) -> Result<PathBuf, CliError> {
        let absolute = comparable(mesh);
        let relative = absolute.strip_prefix(&self.root).ok();
        let is_plain = |path: &Path| path.components().all(|part| matches!(part, Component::Normal(_)));
        let Some(relative) = relative.filter(|path| is_plain(path)) else {
            let root = self.root.display();
            return Err(CliError::usage(format!("{mesh}: lies outside of {root}, to which the baseline belongs")));
        };
        let mut path = self.folder.join(relative).into_os_string();
        path.push(format!(".{extension}"));
        Ok(path.into())
    }
}

impl<'a> AcceptedFault<'a> {
    fn of(check: &'a Check) -> Self {
        let Check { rule, level, found, detail, places, .. } = check;
        Self { rule, level: *level, found: *found, detail, places }
    }
}

impl KnownFault {
    /// True if a broken rule is no more broken than was accepted: no larger number, and no new place as far as
    /// all places are recorded.
    fn covers(&self, check: &Check) -> bool {
        let numbers = |value: &Value| -> Option<Vec<f64>> {
            match value {
                Value::Number(number) => Some(vec![number.as_f64()?]),
                Value::Array(list) => list.iter().map(Value::as_f64).collect(),
                _ => None,
            }
        };
        if self.rule != check.rule {
            return false;
        }
        let before = self.found.as_ref().and_then(numbers);
        let is_no_more = match (&before, check.found) {
            (Some(before), Some(Figure::Count(now))) => before.len() == 1 && now as f64 <= before[0],
            (Some(before), Some(Figure::Size(now))) => {
                before.len() == 3 && now.iter().zip(before).all(|(now, before)| now <= before)
            }
            (_, None) => true,
            (None, Some(_)) => false,
        };
        let has_all_places = before.is_some_and(|before| before == [self.places.len() as f64]);
        let is_recorded = |place: &Place| serde_json::to_value(place).is_ok_and(|place| self.places.contains(&place));
        is_no_more && (!has_all_places || check.places.iter().all(is_recorded))
    }
}

/// The bytes of a file; none if there is no such file.
fn read_if_there(path: &Path, bytes_max: u64) -> Result<Option<Vec<u8>>, CliError> {
    match fs::metadata(path) {
        Ok(data) if data.is_file() => files::read(&path.to_string_lossy(), bytes_max).map(|bytes| Some(bytes.to_vec())),
        _ => Ok(None),
    }
}
