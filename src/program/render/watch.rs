//! `render --watch`: draws again whenever a file has changed: one that the command names, one in a folder that it
//! names, or, for a single picture, one that `--siblings` finds. The pictures that it writes do not count, nor do
//! hidden files in folders.
//!
//! A file counts as changed if its length or its time of modification is another, or if it comes or
//! goes. The program looks at all files once a second, or less often if there are so many that
//! looking takes long. Notifications of the system make it look sooner; there may be none, as on
//! network file systems or with too many watches.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant, SystemTime};

use notify::{RecommendedWatcher, RecursiveMode, Watcher as _};

use crate::bundle::comparable;
use crate::error::CliError;
use meshsnap_render::pluralise::pluralise;

/// Time without further changes after which a file is taken to be whole.
const QUIET: Duration = Duration::from_millis(50);

/// Time after which the program looks at the files though nothing woke it up.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Files that are looked at, at most.
const FILES_MAX: usize = 100_000;

/// Comparable paths of the files that changed since the last picture.
pub type Changed = BTreeSet<PathBuf>;

/// A command that can be repeated.
pub trait Watched {
    /// Names of the files and folders that the command line has, as they are at this moment.
    fn named(&self) -> Vec<String>;
    /// Names of the files that are read besides. The mesh is read to find them out.
    fn beside(&self) -> Vec<String>;
    /// Comparable paths of the files that are written.
    fn outputs(&self) -> BTreeSet<PathBuf>;
    /// Draws everything, or where `changed` is given, what these files change.
    fn draw(&self, changed: Option<&Changed>) -> Result<(), CliError>;
}

/// Draws, and draws again after each change, until a signal ends the program. Faults of the meshes are
/// printed, and the next change is waited for. A fault of the command line ends it, and so does a first
/// picture of which no file is there.
pub fn run(command: &dyn Watched) -> Result<(), CliError> {
    let mut changed: Option<Changed> = None;
    loop {
        let (beside, outputs) = (command.beside(), command.outputs());
        let inputs = || command.named().into_iter().chain(beside.iter().cloned()).collect::<Vec<_>>();
        // The watches come first, so that a change during the drawing is seen after it.
        let wakes = Wakes::of(&inputs());
        let before = stamps(&inputs(), &outputs);
        let began = Instant::now();
        match command.draw(changed.as_ref()) {
            Err(error) if changed.is_none() && (error.exit_code > 1 || before.is_empty()) => return Err(error),
            Err(error) if error.sentence.is_empty() => {}
            Err(error) => say!("meshsnap: {}", error.sentence),
            Ok(()) => say!("meshsnap: drawn in {} ms", began.elapsed().as_millis()),
        }
        if changed.is_none() {
            let files = pluralise(before.len() as u64, "file", "files");
            say!("meshsnap: waiting for changes of {files}; Ctrl-C ends");
        }
        let mut pause = LOOK_EVERY;
        let after = loop {
            wakes.wait(pause);
            let began = Instant::now();
            let after = stamps(&inputs(), &outputs);
            if after != before {
                break after;
            }
            // Looking takes little of the time, however many files there are.
            pause = LOOK_EVERY.max(began.elapsed() * 20);
        };
        let paths = before.keys().chain(after.keys());
        changed = Some(paths.filter(|path| before.get(*path) != after.get(*path)).cloned().collect());
    }
}

/// The length and the time of a file, of which one differs after a change.
type Stamp = (u64, Option<SystemTime>);

/// The stamps of all files, hidden ones in folders and outputs left out. A file that is not there has none.
fn stamps(inputs: &[String], outputs: &BTreeSet<PathBuf>) -> BTreeMap<PathBuf, Stamp> {
    let mut found = BTreeMap::new();
    for name in inputs {
        add(comparable(name), outputs, &mut found);
    }
    found
}

fn add(path: PathBuf, outputs: &BTreeSet<PathBuf>, found: &mut BTreeMap<PathBuf, Stamp>) {
    let Ok(metadata) = fs::metadata(&path) else { return };
    if metadata.is_dir() {
        let is_hidden = |entry: &fs::DirEntry| entry.file_name().to_string_lossy().starts_with('.');
        for entry in fs::read_dir(&path).into_iter().flatten().flatten() {
            // Links to folders are not followed: they may lead round in circles.
            let is_link_to_folder = entry.file_type().is_ok_and(|kind| kind.is_symlink()) && entry.path().is_dir();
            if !is_hidden(&entry) && !is_link_to_folder {
                add(entry.path(), outputs, found);
            }
        }
    } else if found.len() < FILES_MAX && !outputs.contains(&path) {
        found.insert(path, (metadata.len(), metadata.modified().ok()));
    }
}

/// Notifications of the system that something happened to a file.
struct Wakes {
    notified: Receiver<()>,
    /// Sends while it lives; none where the system offers no notifications.
    _watcher: Option<RecommendedWatcher>,
}

impl Wakes {
    fn of(inputs: &[String]) -> Self {
        let (sender, notified) = channel();
        // Reading is an event too, and no change.
        let wake = move |event: notify::Result<notify::Event>| {
            if !event.is_ok_and(|event| event.kind.is_access() && !is_end_of_writing(event.kind)) {
                let _ = sender.send(());
            }
        };
        let mut watcher = notify::recommended_watcher(wake).ok();
        if let Some(watcher) = &mut watcher {
            for (folder, mode) in folders(inputs) {
                // What cannot be watched is looked at once a second.
                let _ = watcher.watch(&folder, mode);
            }
        }
        Self { notified, _watcher: watcher }
    }

    /// Waits until something happened and no more follows, or until `pause` is over.
    fn wait(&self, pause: Duration) {
        let woken = self.notified.recv_timeout(pause);
        if woken == Err(RecvTimeoutError::Disconnected) {
            return std::thread::sleep(pause);
        }
        let first = Instant::now();
        while woken.is_ok() && first.elapsed() < LOOK_EVERY && self.notified.recv_timeout(QUIET).is_ok() {}
    }
}

fn is_end_of_writing(kind: notify::EventKind) -> bool {
    use notify::event::{AccessKind, AccessMode, EventKind};
    kind == EventKind::Access(AccessKind::Close(AccessMode::Write))
}

/// The folders to watch. Files are watched through their folders: editors write a new file and give it
/// the old one's name.
fn folders(inputs: &[String]) -> BTreeMap<PathBuf, RecursiveMode> {
    let mut folders = BTreeMap::new();
    for name in inputs {
        let path = comparable(name);
        if path.is_dir() {
            folders.insert(path, RecursiveMode::Recursive);
        } else if let Some(folder) = path.parent() {
            folders.entry(folder.to_owned()).or_insert(RecursiveMode::NonRecursive);
        }
    }
    folders
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_of_inputs_and_leave_out_hidden_files_links_to_folders_and_outputs() {
        let folder = tempfile::tempdir().unwrap();
        let root = comparable(folder.path());
        for name in ["in/a.obj", "in/deep/b.stl", "in/.hidden.obj", "in/a.png", "beside.obj"] {
            fs::create_dir_all(root.join(name).parent().unwrap()).unwrap();
            fs::write(root.join(name), "v 0 0 0\n").unwrap();
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink(&root, root.join("in/round")).unwrap();
        let inputs = [root.join("in"), root.join("gone.obj")].map(|path| path.to_string_lossy().into_owned());
        let outputs = BTreeSet::from([root.join("in/a.png")]);
        let before = stamps(&inputs, &outputs);
        assert_eq!(before.keys().cloned().collect::<Vec<_>>(), [root.join("in/a.obj"), root.join("in/deep/b.stl")]);
        assert_eq!(stamps(&inputs, &outputs), before);
        fs::write(root.join("in/a.png"), "longer than before").unwrap();
        assert_eq!(stamps(&inputs, &outputs), before);
        fs::write(root.join("gone.obj"), "v 0 0 0\n").unwrap();
        fs::write(root.join("in/deep/b.stl"), "longer than before").unwrap();
        let after = stamps(&inputs, &outputs);
        assert_eq!(after.len(), 3);
        assert_ne!(after[&root.join("in/deep/b.stl")], before[&root.join("in/deep/b.stl")]);
        let watched = folders(&inputs);
        let modes = [(root.clone(), RecursiveMode::NonRecursive), (root.join("in"), RecursiveMode::Recursive)];
        assert_eq!(watched, BTreeMap::from(modes));
    }
}
