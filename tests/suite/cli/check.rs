//! `meshsnap check`: verdicts, their order, exit codes and mistakes.

use std::fs;
use std::path::Path;
use std::process::{Output, Stdio};

use serde_json::Value;

use crate::support::server::{CUBE_OBJ, meshsnap};

/// A cube without its last side.
fn open_cube() -> Vec<u8> {
    let text = String::from_utf8(CUBE_OBJ.to_vec()).unwrap();
    text.replace("f 4 1 5 8\n", "").into_bytes()
}

/// A folder with a good mesh, one with a hole, one that is none, and one with a material library.
pub fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    fs::create_dir(folder.path().join("parts")).unwrap();
    write("parts/good.obj", CUBE_OBJ);
    write("parts/hole.obj", &open_cube());
    write("broken.stl", b"solid");
    write("colored.obj", &[b"mtllib colored.mtl\n", CUBE_OBJ].concat());
    write("colored.mtl", b"newmtl a\nKd 1 0 0\n");
    folder
}

#[track_caller]
pub fn check(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = meshsnap();
    command.current_dir(folder).arg("check").args(arguments).stdin(Stdio::null());
    let Output { status, stdout, stderr } = command.output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

/// Arguments, the exit code, a part of standard output and one of standard error.
const CASES: &[(&str, i32, &str, &str)] = &[
    ("parts/good.obj --rules watertight,manifold", 0, "parts/good.obj: ok\n", "1 ok, 0 failed"),
    ("parts", 0, "parts/good.obj: ok\nparts/hole.obj: ok\n", "2 ok, 0 failed"),
    ("parts --rules watertight", 1, "  error: watertight: 4 open edges in 1 loop; at (-1, ", "1 ok, 1 failed"),
    ("parts --warn watertight", 0, "parts/hole.obj: ok\n  warning: watertight: 4 open", "2 ok, 0 failed"),
    ("parts/*.obj --rules max-triangles:11", 1, "12 triangles, and 11 allowed", "1 ok, 1 failed"),
    ("parts/good.obj --rules bounds:2,1,2", 1, "2 along y, and 1 allowed", "0 ok, 1 failed"),
    ("broken.stl parts/good.obj --rules manifold", 1, "broken.stl: FAILED\n  error: opens: ", "1 ok, 1 failed"),
    ("absent.obj", 1, "absent.obj: FAILED\n  error: opens: there is no such file\n", "0 ok, 1 failed"),
    ("parts/gud.obj", 1, "did you mean parts/good.obj?", "0 ok, 1 failed"),
    ("colored.obj", 0, "warning: no-warnings: ", "name it too, or add --siblings"),
    ("colored.obj colored.mtl", 0, "colored.obj: ok\n", "1 ok, 0 failed"),
    ("colored.obj --siblings", 0, "colored.obj: ok\n", "1 ok, 0 failed"),
    ("parts/good.obj colored.mtl", 0, "parts/good.obj: ok\n", "colored.mtl: is not used"),
    ("parts --rules watertigth", 2, "", "did you mean `watertight`?"),
    ("parts/good.obj --rules no-self-intersection", 0, "parts/good.obj: ok\n", "1 ok, 0 failed"),
    ("parts --rules max-triangles", 2, "", "takes a whole number: max-triangles:1000"),
    ("parts --rules manifold --warn manifold", 2, "", "`manifold` is given twice"),
    ("-", 2, "", "standard input"),
    ("parts --format xml", 2, "", "jsonl"),
    ("", 2, "", "PATH"),
];

#[test]
fn exit_codes_and_words() {
    let folder = folder();
    for (arguments, code, stdout, stderr) in CASES {
        let words: Vec<&str> = arguments.split_whitespace().collect();
        let (found, out, said) = check(folder.path(), &words);
        assert_eq!(found, Some(*code), "{arguments}: {out}{said}");
        assert!(out.contains(stdout) && said.contains(stderr), "{arguments}: {out}{said}");
        assert!(*code != 2 || out.is_empty(), "{arguments}: {out}");
    }
}

#[test]
fn a_verdict_is_a_line_of_json() {
    let folder = folder();
    let (code, out, _) =
        check(folder.path(), &["parts", "absent.obj", "--rules", "opens,watertight", "--format", "jsonl"]);
    assert_eq!(code, Some(1));
    let verdicts: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let [absent, good, hole] = verdicts.as_slice() else { panic!("{out}") };
    assert_eq!((&absent["path"], &absent["sha256"]), (&"absent.obj".into(), &Value::Null));
    assert_eq!((&good["ok"], &good["checks"][1]["where"]), (&true.into(), &Value::Array(Vec::new())));
    let digest = good["sha256"].as_str().unwrap();
    assert!(digest.len() == 64 && hole["sha256"] != good["sha256"], "{digest}");
    let watertight = &hole["checks"][1];
    assert_eq!((&watertight["found"], &watertight["allowed"]), (&4.into(), &0.into()));
    assert_eq!(watertight["where"].as_array().unwrap().len(), 4);
}

#[test]
fn the_order_is_that_of_the_paths_at_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    for i in 0..60 {
        // Of very different sizes, so that threads overtake each other.
        let bytes = if i % 7 == 0 { open_cube() } else { CUBE_OBJ.to_vec() };
        let padding = "# padding\n".repeat(if i % 5 == 0 { 20_000 } else { 0 });
        fs::write(folder.path().join(format!("{i:02}.obj")), [padding.as_bytes(), &bytes].concat()).unwrap();
    }
    let with = |jobs: &str| check(folder.path(), &[".", "--rules", "watertight", "--format", "jsonl", "--jobs", jobs]);
    let one = with("1");
    assert_eq!((one.0, one.1.lines().count()), (Some(1), 60));
    assert!(one.2.contains("51 ok, 9 failed"), "{}", one.2);
    for jobs in ["2", "7", "64"] {
        assert!(with(jobs) == one, "{jobs}");
    }
}

#[test]
fn rules_of_a_repository_and_of_files_in_it() {
    let folder = folder();
    let config = |text: &str| fs::write(folder.path().join("meshsnap.toml"), text).unwrap();
    let parts = folder.path().join("parts");
    let failed = |at: &Path, words: &[&str]| check(at, words).2.lines().last().unwrap_or_default().to_owned();
    config("[check]\nrules = [\"opens\", \"watertight\"]\nwarn = [\"no-warnings\"]\n");
    assert_eq!(failed(folder.path(), &["parts"]), "1 ok, 1 failed");
    // It is found from below, and the command line overrides it.
    assert_eq!(failed(&parts, &["."]), "1 ok, 1 failed");
    assert_eq!(failed(folder.path(), &["parts", "--rules", "opens"]), "2 ok, 0 failed");
    let files = |glob: &str| {
        config(&format!(
            "[check]\nrules = [\"watertight\"]\n[[check.files]]\nglob = \"{glob}\"\nrules = [\"opens\"]\n"
        ));
        failed(&parts, &["."])
    };
    for glob in ["parts/**", "**/hole.obj", "parts/*.obj", "**/*.obj"] {
        assert_eq!(files(glob), "2 ok, 0 failed", "{glob}");
    }
    for glob in ["*.obj", "hole.obj", "other/**", "parts/good.obj"] {
        assert_eq!(files(glob), "1 ok, 1 failed", "{glob}");
    }
    fs::write(folder.path().join("other.toml"), "[check]\nrules = [\"max-triangles:1\"]\n").unwrap();
    assert_eq!(failed(folder.path(), &["parts", "--config", "other.toml"]), "0 ok, 2 failed");
}

#[test]
fn mistakes_of_a_config_have_a_line_and_a_column() {
    let folder = folder();
    let cases = [
        ("[check]\nrule = []\n", "line 2, column 1: there is no key `rule`; did you mean `rules`?"),
        ("[chekc]\n", "line 1, column 2: there is no key `chekc`; did you mean `check`?"),
        (
            "[check]\nrules = [\"opens\", \"watertigth\"]\n",
            "line 2, column 19: there is no rule `watertigth`; did you mean",
        ),
        ("[check]\nrules = \"opens\"\n", "line 2, column 9: a list is needed"),
        ("[check]\nrules = [5]\n", "line 2, column 10: a text in quotes is needed"),
        ("[check]\nrules = [\"opens\"\n", "line "),
        ("check = 5\n", "line 1, column 9: `check` is a table"),
        ("[check]\n[[check.files]]\nrules = []\n", "[[check.files]] needs a `glob`"),
        ("[check]\n[[check.files]]\nglob = \"a[\"\n", "line 3, column 8: is no pattern"),
        (
            "[check]\nrules = [\"manifold\"]\nwarn = [\"manifold\"]\n",
            "line 3, column 9: the rule `manifold` is given twice",
        ),
    ];
    for (text, part) in cases {
        fs::write(folder.path().join("meshsnap.toml"), text).unwrap();
        let (code, out, said) = check(folder.path(), &["parts"]);
        assert!(code == Some(2) && out.is_empty() && said.contains(part), "{text}: {said}");
        assert!(said.contains("meshsnap.toml, line "), "{said}");
    }
    fs::write(folder.path().join("meshsnap.toml"), [0xff, 0xfe]).unwrap();
    assert_eq!(check(folder.path(), &["parts"]).0, Some(2));
    let (code, _, said) = check(folder.path(), &["parts", "--config", "absent.toml"]);
    assert!(code == Some(2) && said.contains("absent.toml: there is no such file"), "{said}");
}

#[test]
fn junit_counts_what_fails() {
    let folder = folder();
    let run = || check(folder.path(), &["parts", "broken.stl", "--rules", "opens,watertight", "--junit", "out.xml"]).0;
    assert_eq!(run(), Some(1));
    let text = fs::read_to_string(folder.path().join("out.xml")).unwrap();
    assert_eq!(run(), Some(1));
    assert_eq!(fs::read_to_string(folder.path().join("out.xml")).unwrap(), text);
    let document: Vec<_> = text.lines().map(str::trim).collect();
    assert!(document[1].contains("tests=\"5\" failures=\"2\""), "{text}");
    for (start, count) in [("<testsuite name=", 3), ("<testcase name=", 5), ("<failure message=", 2)] {
        assert_eq!(document.iter().filter(|line| line.starts_with(start)).count(), count, "{start}: {text}");
    }
    assert!(text.contains("<failure message=\"4 open edges in 1 loop\" type=\"watertight\">"), "{text}");
    // A report never replaces a mesh.
    let good = fs::read(folder.path().join("parts/good.obj")).unwrap();
    assert_eq!(check(folder.path(), &["parts", "--junit", "parts/good.obj"]).0, Some(2));
    assert_eq!(fs::read(folder.path().join("parts/good.obj")).unwrap(), good);
    // Nor the rules, nor does it mix with what is printed.
    fs::write(folder.path().join("meshsnap.toml"), "[check]\nrules = [\"opens\"]\n").unwrap();
    let (code, _, said) = check(folder.path(), &["parts", "--junit", "meshsnap.toml"]);
    assert!(code == Some(2) && said.contains("meshsnap.toml: is the same file as the input"), "{said}");
    let (code, printed, said) = check(folder.path(), &["parts", "--junit", "-"]);
    assert!(code == Some(2) && printed.is_empty() && said.contains("name a file"), "{said}");
}

#[test]
fn all_places_are_listed_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let row: String = (0..30).map(|i| format!("v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nf -1 -2 -3\n")).collect();
    fs::write(folder.path().join("row.obj"), row).unwrap();
    let places = |more: &[&str]| {
        let arguments =
            [&["row.obj", "--rules", "watertight", "--format", "jsonl", "--html", "page.html"], more].concat();
        let (code, stdout, stderr) = check(folder.path(), &arguments);
        assert_eq!(code, Some(1), "{stderr}");
        let page = fs::read_to_string(folder.path().join("page.html")).unwrap();
        assert!(page.contains("the first 20 of 90 places"), "{page}");
        let verdict: Value = serde_json::from_str(&stdout).unwrap();
        assert_eq!(verdict["checks"][0]["found"], 90);
        verdict["checks"][0]["where"].as_array().unwrap().len()
    };
    assert_eq!((places(&[]), places(&["--all-places"])), (20, 90));
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_passed_over_in_folders_and_told_where_it_is_named() {
    let folder = folder();
    let path = |name: &str| folder.path().join("parts").join(name);
    let made = std::process::Command::new("mkfifo").arg(path("pipe.obj")).status().unwrap();
    assert!(made.success());
    std::os::unix::fs::symlink("/dev/zero", path("endless.stl")).unwrap();
    std::os::unix::fs::symlink(path("good.obj"), path("link.obj")).unwrap();
    std::os::unix::fs::symlink(path("."), path("folder.obj")).unwrap();
    std::os::unix::fs::symlink("nothing.obj", path("nothing_here.obj")).unwrap();
    std::os::unix::fs::symlink("round.obj", path("round.obj")).unwrap();
    let (code, out, said) = check(folder.path(), &["parts", "--rules", "opens"]);
    let expected = "parts/good.obj: ok\nparts/hole.obj: ok\nparts/link.obj: ok\nparts/nothing_here.obj: FAILED\n  error: \
                    opens: there is no such file\nparts/round.obj: FAILED\n  error: opens: cannot be read: ";
    assert!(code == Some(1) && out.starts_with(expected), "{out}{said}");
    assert!(said.contains("3 ok, 2 failed"), "{said}");
    // A folder that is named as a mesh is a folder, here one that links to itself.
    let (code, out, said) = check(folder.path(), &["parts/folder.obj", "--rules", "opens"]);
    assert!(code == Some(1) && out.contains("parts/folder.obj/good.obj: ok"), "{out}{said}");
}
