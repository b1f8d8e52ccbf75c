//! The fuzz targets, without a fuzzer: each importer has one, and every seed and every former find
//! passes.

use meshsnap_render::import::Format;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

#[path = "../../../fuzz/src/lib.rs"]
pub mod targets;

pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Name and content, sorted.
pub fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let paths = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file());
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    let mut files: Vec<_> = paths.map(|path| (name(&path), std::fs::read(&path).unwrap())).collect();
    files.sort();
    files
}

#[test]
fn every_importer_has_a_target_with_seeds_and_words() {
    let targets: BTreeSet<&str> = targets::targets().into_iter().collect();
    let expected: BTreeSet<&str> =
        Format::names().into_iter().chain(["meshopt", "zip", "request", "pipeline"]).collect();
    assert_eq!(targets, expected, "fuzz/src/lib.rs");
    let manifest = std::fs::read_to_string(root().join("fuzz/Cargo.toml")).unwrap();
    let bins: BTreeSet<&str> = manifest.split("[[bin]]").skip(1).filter_map(|bin| bin.split('"').nth(1)).collect();
    assert_eq!(targets, bins, "fuzz/Cargo.toml");
    // All of them build the one file, which runs the target of its binary's name.
    assert_eq!(manifest.matches("path = \"targets/target.rs\"").count(), targets.len());
    let code = std::fs::read_to_string(root().join("fuzz/targets/target.rs")).unwrap();
    assert!(code.contains("run(env!(\"CARGO_BIN_NAME\"), bytes)"), "{code}");
    for target in targets {
        let dictionary = std::fs::read_to_string(root().join(format!("fuzz/dictionaries/{target}.dict"))).unwrap();
        let words: Vec<&str> = dictionary.lines().filter(|line| !line.starts_with('#')).collect();
        assert!(words.len() > 10 && words.iter().all(|word| word.starts_with('"') && word.ends_with('"')), "{target}");
        assert!(files(&root().join("fuzz/seeds").join(target)).len() >= 3, "{target}");
    }
}

/// Seeds that are no mesh, and a part of what is said of them: all others are read to the end.
const REFUSED: [(&str, &str); 2] = [
    ("off/prefixes.off", "homogeneous coordinates"), // every prefix there is
    ("zip/two.zip", "several files are meshes"),
];

#[test]
fn every_seed_is_read_to_the_end() {
    let (mut read, mut refused) = (0, 0);
    for target in targets::targets() {
        for (name, bytes) in files(&root().join("fuzz/seeds").join(target)) {
            let seed = format!("{target}/{name}");
            let Some(result) = targets::imported(target, &bytes) else { continue };
            match (result, REFUSED.iter().find(|(known, _)| *known == seed)) {
                (Ok(mesh), None) => {
                    assert!(!mesh.triangles.is_empty() || !mesh.lines_and_points.is_empty(), "{seed}");
                    read += 1;
                }
                (Err(error), Some((_, why))) => {
                    assert!(error.detail.contains(why), "{seed}: {error}");
                    refused += 1;
                }
                (Ok(_), Some(_)) => panic!("{seed} is read, and listed as refused"),
                (Err(error), None) => panic!("{seed}: {error}"),
            }
        }
    }
    assert_eq!(refused, REFUSED.len());
    assert!(read >= 45, "{read}");
}

#[test]
fn former_finds_stay_mended() {
    let finds = files(&root().join("tests/regressions"));
    let finds: Vec<_> = finds.into_iter().filter(|(name, _)| name != "README.md").collect();
    assert!(finds.len() >= 12, "{} finds", finds.len());
    for (name, bytes) in &finds {
        let target = name.split('-').next().unwrap_or_default();
        assert!(targets::targets().contains(&target), "tests/regressions/{name} begins with no target's name");
        let start = Instant::now();
        targets::run(target, bytes);
        assert!(start.elapsed() < Duration::from_secs(10), "{name}: {:?}", start.elapsed());
    }
}
