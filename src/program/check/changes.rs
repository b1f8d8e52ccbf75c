//! The changes of a mesh since a git commit (`meshsnap check --since`), as sentences in the words of `meshsnap diff`,
//! and the mesh as it was in that commit, if it can be read, for the pictures of before.

use std::path::Path;

use super::since::Commit;
use meshsnap_inspect::diff;
use meshsnap_render::import::{Bundle, BundleFile, Options, Origin};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::pipeline::Model;

/// The changes of a mesh.
#[derive(Default)]
pub struct Changes {
    /// Sentences, as those of `meshsnap diff`.
    pub sentences: Vec<String>,
    /// The mesh as it is in the commit, if it can be read.
    pub older: Option<Model>,
}

/// The changes of a mesh. `sources` are the files that were read, the mesh first: each with its path in the
/// bundle. The older side is read with the same files as they are in the commit.
pub fn since(
    commit: &Commit,
    model: &Model,
    sources: &[(String, String)],
    options: Options,
    limits: &Limits,
) -> Changes {
    let bundle = match bundle(commit, sources, limits) {
        Ok(Some(bundle)) => bundle,
        Ok(None) => return Changes { sentences: vec!["the file is new".to_owned()], older: None },
        Err(why) => return unreadable(&why),
    };
    let deadline = Deadline::default();
    let older = match meshsnap_inspect::read(&bundle, options, limits, Budget::new(limits), &deadline) {
        Ok(older) => older,
        Err(error) => return unreadable(&error.to_string()),
    };
    let sentences = match diff::compare(&older, model, None, &deadline) {
        Ok(compared) => compared.difference.summary,
        Err(error) => vec![format!("it cannot be compared with its older side: {error}")],
    };
    Changes { sentences, older: Some(older) }
}

fn unreadable(why: &str) -> Changes {
    Changes { sentences: vec![format!("its older side cannot be read: {why}")], older: None }
}

/// The files as they are in the commit; None if the mesh is not there.
fn bundle(commit: &Commit, sources: &[(String, String)], limits: &Limits) -> Result<Option<Bundle>, String> {
    let (mut files, mut left) = (Vec::with_capacity(sources.len()), limits.memory_bytes);
    for (number, (name, path)) in sources.iter().enumerate() {
        match commit.file(Path::new(name), left)? {
            Some(bytes) => {
                left -= bytes.len() as u64;
                files.push(BundleFile::new(path, bytes).map_err(|error| error.to_string())?);
            }
            None if number == 0 => return Ok(None),
            None => {}
        }
    }
    Ok(Some(Bundle::of_files(files).given_by(Origin::Command)))
}
