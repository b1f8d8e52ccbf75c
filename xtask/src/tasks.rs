//! The commands of `cargo xtask`. Each prints the command lines that it runs, runs them in the repository's root, and
//! stops at the first failure.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A failure's text, for standard error.
type Result = std::result::Result<(), String>;

/// Something that tests compare with, and that they can store anew.
struct Stored {
    /// Its name on the command line.
    name: &'static str,
    /// The tests that store it.
    filter: &'static str,
    /// The environment variable and value that make these tests write.
    write: (&'static str, &'static str),
    /// Its folder or file.
    path: &'static str,
}

/// Everything that `bless` knows.
const STORED: [Stored; 5] = [
    Stored { name: "pictures", filter: "render::golden::", write: ("MESHSNAP_GOLDEN", "write"), path: "tests/golden" },
    Stored { name: "schema", filter: "the_stored_schema", write: ("MESHSNAP_GOLDEN", "write"), path: "api" },
    Stored {
        name: "library",
        filter: "house::library",
        write: ("MESHSNAP_GOLDEN", "write"),
        path: "src/library/interface.txt",
    },
    Stored {
        name: "tables",
        filter: "the_shipped_table_is_what_was_measured",
        write: ("MESHSNAP_GOLDEN", "write"),
        path: "src/render/plan/quality/error_table.json",
    },
    Stored {
        name: "examples",
        filter: "is_what_its_generator_makes",
        write: ("MESHSNAP_WRITE_EXAMPLES", "1"),
        path: "api/examples",
    },
];

/// The largest archive of the crate, bytes.
const ARCHIVE_BYTES_MAX: u64 = 2_000_000;

/// All tests, a tier of `tests/run`, or those of the suite whose names contain a filter.
pub fn test(filters: &[&str]) -> Result {
    match filters {
        [] => script("tests/run", &[]),
        [tier @ ("quick" | "all" | "long")] => script("tests/run", &[tier]),
        filters => run(suite(filters)),
    }
}

/// Stores what tests compare with, and tests against it.
pub fn bless(name: &str) -> Result {
    let Some(stored) = STORED.iter().find(|stored| stored.name == name) else {
        let known: Vec<&str> = STORED.iter().map(|stored| stored.name).collect();
        return Err(format!("`{name}` cannot be blessed; known are {}", known.join(", ")));
    };
    let mut write = suite(&[stored.filter]);
    // The output would alarm without need: a test that has written its own truth always fails.
    write.env(stored.write.0, stored.write.1).stdout(Stdio::null()).stderr(Stdio::null());
    if run(write).is_ok() {
        return Err(format!("the tests `{}` passed while writing, so they did not write", stored.filter));
    }
    run(suite(&[stored.filter]))?;
    println!("\nChanged files under {} (look at each before you commit it):", stored.path);
    let mut changes = Command::new("git");
    changes.args(["status", "--short", "--", stored.path]);
    run(changes)
}

/// A benchmark by name; accuracy where none is named.
pub fn bench(arguments: &[&str]) -> Result {
    let (name, options) = match arguments {
        [name @ ("accuracy" | "load" | "cached" | "browse" | "gpu" | "crashes" | "stages"), options @ ..] => {
            (*name, options)
        }
        options => ("accuracy", options),
    };
    // Only builds with debug assertions have decoders that crash when they are asked to.
    let profile = if name == "crashes" { "dev" } else { "bench" };
    let mut command = cargo(&["bench", "--locked", "--profile", profile, "--bench", name, "--"]);
    command.args(options);
    run(command)
}

/// Formatting, lints, documentation, and dependencies' licences and sources.
pub fn lint() -> Result {
    run(cargo(&["fmt", "--all", "--check"]))?;
    run(cargo(&["clippy", "--locked", "--workspace", "--all-targets", "--", "-D", "warnings"]))?;
    // Private modules are documented too, so a link to one resolves.
    let mut doc = cargo(&["doc", "--locked", "--workspace", "--no-deps", "--document-private-items"]);
    doc.env("RUSTDOCFLAGS", "-D warnings -A rustdoc::private_intra_doc_links");
    run(doc)?;
    let is_installed = cargo(&["deny", "--version"]).stdout(Stdio::null()).stderr(Stdio::null()).status();
    if is_installed.is_ok_and(|status| status.success()) {
        // Advisories need a network; the hosted workflow looks at them.
        run(cargo(&["deny", "--locked", "check", "licenses", "bans", "sources"]))
    } else {
        println!("cargo-deny is not installed, so dependencies were not checked (cargo install cargo-deny)");
        Ok(())
    }
}

/// Checks the library and its programs without features, with each alone, and with all. Runs the tests of what is off by
/// default.
pub fn features() -> Result {
    // The crates in the middle are checked with these two: each of their features is one of theirs.
    for package in ["meshsnap", "meshsnap-cli"] {
        let check = ["check", "--locked", "--package", package];
        run(cargo(&[&check[..], &["--no-default-features"]].concat()))?;
        for feature in &feature_names(package)? {
            run(cargo(&[&check[..], &["--no-default-features", "--features", feature]].concat()))?;
        }
        run(cargo(&[&check[..], &["--all-features"]].concat()))?;
    }
    let mut traces = cargo(&["test", "--locked", "--features", "otel", "--test", "suite", "--", "jobs::traces"]);
    // These are few tests: nearly all of the time goes to the compiler.
    traces.env("CARGO_PROFILE_DEV_OPT_LEVEL", "0");
    run(traces)
}

/// Other systems that the program is checked for.
const OTHER_SYSTEMS: [(&str, &str); 3] = [
    ("Windows", "x86_64-pc-windows-gnu"),
    ("macOS on ARM", "aarch64-apple-darwin"),
    ("macOS on x86", "x86_64-apple-darwin"),
];

/// Checks the program for other systems, and says which of their targets are not installed.
pub fn cross() -> Result {
    // The compiler of the repository's own toolchain, as `cargo` runs it.
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    for (system, target) in OTHER_SYSTEMS {
        let library = Command::new(&rustc).args(["--print", "target-libdir", "--target", target]).output();
        let library = library.map_err(|error| format!("rustc cannot be run: {error}"))?;
        let library = String::from_utf8_lossy(&library.stdout);
        if !Path::new(library.trim()).is_dir() {
            println!("{system} was not checked: the target is not installed (rustup target add {target})");
            continue;
        }
        let mut check = cargo(&["check", "--locked", "--package", "meshsnap-cli", "--target", target]);
        // `cargo check` links nothing, so C is not compiled either: that would take the other system's compiler and headers.
        for tool in ["CC", "CXX", "AR", "RANLIB"] {
            check.env(format!("{tool}_{}", target.replace('-', "_")), "true");
        }
        run(check)?;
    }
    Ok(())
}

/// The names in the `[features]` table of a package's manifest, but for `default`.
fn feature_names(package: &str) -> std::result::Result<Vec<String>, String> {
    let path = root().join(if package == "meshsnap" { "src/library/Cargo.toml" } else { "Cargo.toml" });
    let manifest = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let table = manifest.lines().skip_while(|line| line.trim() != "[features]").skip(1);
    let names = table.take_while(|line| !line.starts_with('[')).filter_map(|line| line.split_once(" = ["));
    let names = names.map(|(name, _)| name.trim().to_owned());
    Ok(names.filter(|name| !name.starts_with('#') && name != "default").collect())
}

/// The crates that a registry would get, each after those that it needs.
const PUBLISHED: [&str; 5] = ["meshsnap-render", "meshsnap", "meshsnap-inspect", "meshsnap-server", "meshsnap-cli"];

/// Makes the archives that a registry would get, builds them, and looks at what is in them.
pub fn package(options: &[&str]) -> Result {
    let of_crates: Vec<&str> = PUBLISHED.iter().flat_map(|name| ["--package", name]).chain(["--locked"]).collect();
    let mut package = cargo(&[&["package"], &of_crates[..], options].concat());
    // They are built, and nothing of them runs.
    package.env("CARGO_PROFILE_DEV_OPT_LEVEL", "0");
    forget_unpacked_archives();
    run(package)?;
    PUBLISHED.iter().try_for_each(|name| look_into_archive(name, options))
}

/// Removes what cargo has unpacked of earlier archives, and the marks by which it knows what it has built of them. It takes
/// both for those of now, because their version is the same.
fn forget_unpacked_archives() {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| std::env::home_dir().map(|home| home.join(".cargo"))).unwrap_or_default();
    let sources = home.join("registry/src");
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    // Registries on disk have no host before the hyphen.
    let unpacked = paths_in(&sources).filter(|path| name_of(path).starts_with('-')).flat_map(|path| paths_in(&path));
    // What was built of a source lists its files in `deps/CRATE-HASH.d`; its mark is `.fingerprint/PACKAGE-HASH`.
    let of_disk = format!("{}/-", sources.display());
    let is_of_archive = |list: &PathBuf| {
        let is_list = name_of(list).starts_with("meshsnap") && list.extension().is_some_and(|end| end == "d");
        is_list && std::fs::read_to_string(list).is_ok_and(|text| text.contains(&of_disk))
    };
    let built = paths_in(&target.join("debug/deps")).filter(is_of_archive);
    let marks = built.filter_map(|list| {
        let (name, hash) =
            name_of(&list).trim_end_matches(".d").rsplit_once('-').map(|(a, b)| (a.replace('_', "-"), b.to_owned()))?;
        Some(target.join("debug/.fingerprint").join(format!("{name}-{hash}")))
    });
    let unpacked = unpacked.filter(|path| name_of(path).starts_with("meshsnap"));
    for folder in unpacked.chain(marks.filter(|mark| mark.is_dir())) {
        if let Err(error) = std::fs::remove_dir_all(&folder) {
            eprintln!("xtask: {} is out of date and cannot be removed: {error}", folder.display());
        }
    }
}

/// What is in a folder; nothing if it cannot be read.
fn paths_in(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path())
}

fn name_of(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Refuses an archive that is too large, or holds what only the repository needs.
fn look_into_archive(name: &str, options: &[&str]) -> Result {
    let mut list = cargo(&[&["package", "--list", "--locked", "--package", name], options].concat());
    let listed = list.current_dir(root()).stderr(Stdio::inherit()).output();
    let listed = listed.map_err(|error| format!("cargo package cannot be run: {error}"))?;
    let files = String::from_utf8_lossy(&listed.stdout);
    let is_stray = |file: &&str| {
        let is_under = |folder| file.starts_with(folder);
        ["tests/", "fuzz/", "xtask/"].into_iter().any(is_under) || file.ends_with(".png") || file.ends_with(".webp")
    };
    if let Some(stray) = files.lines().find(is_stray) {
        return Err(format!("the archive of {name} would hold {stray}: see its Cargo.toml"));
    }
    let folder = root().join("target/package");
    let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap_or_default();
    let version = manifest.lines().find_map(|line| line.strip_prefix("version = \"")?.strip_suffix('"'));
    let archive = folder.join(format!("{name}-{}.crate", version.unwrap_or_default()));
    let bytes = std::fs::metadata(&archive).map_or(0, |data| data.len());
    println!("{name}: {} files, {bytes} bytes", files.lines().count());
    if bytes == 0 || bytes > ARCHIVE_BYTES_MAX {
        return Err(format!("the archive of {name} has {bytes} bytes, and may have 1 to {ARCHIVE_BYTES_MAX}"));
    }
    Ok(())
}

/// A script of the repository.
pub fn script(path: &str, arguments: &[&str]) -> Result {
    let mut command = Command::new(root().join(path));
    command.args(arguments);
    run(command)
}

/// The suite's tests whose names contain one of the filters.
fn suite(filters: &[&str]) -> Command {
    let mut command = cargo(&["test", "--locked", "--workspace", "--test", "suite", "--"]);
    command.args(filters);
    command
}

fn cargo(arguments: &[&str]) -> Command {
    // The cargo that runs this, so that the toolchain is the same.
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(arguments);
    command
}

fn run(mut command: Command) -> Result {
    let line = shown(&command);
    println!("$ {line}");
    match command.current_dir(root()).status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{line}` failed ({status})")),
        Err(error) => Err(format!("`{line}` cannot be run: {error}")),
    }
}

/// A command as one would type it.
fn shown(command: &Command) -> String {
    let variables = command
        .get_envs()
        .filter_map(|(name, value)| Some(format!("{}={:?}", name.to_string_lossy(), value?.to_string_lossy())));
    let program = Path::new(command.get_program());
    let program = program.strip_prefix(root()).unwrap_or(program);
    let program = if program.is_absolute() { program.file_name().map(Path::new).unwrap_or(program) } else { program };
    let words = std::iter::once(program.as_os_str()).chain(command.get_args());
    let words = words.map(|word| word.to_string_lossy().into_owned());
    variables.chain(words).collect::<Vec<_>>().join(" ")
}

/// The repository: the folder that this package's folder lies in.
fn root() -> &'static Path {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package)
}
