//! `meshsnap check` with `--baseline`, accepted faults, and with `--since`, meshes that changed
//! since a commit.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use super::check::{check, folder};
use crate::support::server::CUBE_OBJ;

const RULES: [&str; 4] = ["--rules", "opens,watertight,max-triangles:11", "--baseline", "accepted"];

fn without(sides: &[&str]) -> Vec<u8> {
    let text = String::from_utf8(CUBE_OBJ.to_vec()).unwrap();
    sides.iter().fold(text, |text, side| text.replace(&format!("f {side}\n"), "")).into_bytes()
}

#[test]
fn known_faults_fail_nothing_and_new_ones_do() {
    let folder = folder();
    let run = |more: &[&str]| check(folder.path(), &[&["parts"], RULES.as_slice(), more].concat());
    // An empty baseline knows nothing.
    let (code, _, said) = run(&[]);
    assert_eq!((code, said.as_str()), (Some(1), "0 ok, 2 failed\n"));
    let (code, out, said) = run(&["--update"]);
    assert_eq!((code, said.as_str()), (Some(0), "2 ok, 0 failed, 2 known faults\n"));
    assert!(out.contains("parts/hole.obj: ok\n  known: watertight: 4 open edges"), "{out}");
    let path = folder.path().join("accepted/parts/hole.obj.json");
    let file = fs::read_to_string(&path).unwrap();
    let json: Value = serde_json::from_str(&file).unwrap();
    assert_eq!((&json["faults"][0]["rule"], &json["faults"][0]["found"]), (&"watertight".into(), &4.into()));
    assert_eq!(run(&[]).0, Some(0));
    // Another side goes: more open edges. Another side instead: as many elsewhere.
    let hole = folder.path().join("parts/hole.obj");
    for (sides, is_known) in [(&["4 1 5 8", "1 2 6 5"][..], false), (&["1 2 6 5"], false), (&["4 1 5 8"], true)] {
        fs::write(&hole, without(sides)).unwrap();
        let (code, out, said) = run(&[]);
        assert_eq!(code, Some(i32::from(!is_known)), "{sides:?}: {out}{said}");
    }
    // What is mended is no longer in the baseline after an update.
    fs::write(&hole, CUBE_OBJ).unwrap();
    assert_eq!(run(&["--update"]).0, Some(0));
    assert!(!fs::read_to_string(&path).unwrap().contains("watertight"));
    assert_eq!(check(folder.path(), &["parts", "--rules", "opens", "--baseline", "accepted", "--update"]).0, Some(0));
    assert!(!path.exists());
}

#[test]
fn reports_tell_known_faults_from_others() {
    let folder = folder();
    let run = |more: &[&str]| check(folder.path(), &[&["parts"], RULES.as_slice(), more].concat());
    run(&["--update"]);
    fs::write(folder.path().join("parts/new.obj"), without(&["1 2 6 5"])).unwrap();
    let (code, out, _) = run(&["--junit", "a.xml", "--sarif", "a.sarif", "--markdown", "a.md", "--format", "jsonl"]);
    assert_eq!(code, Some(1));
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    let known: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((&known[1]["ok"], &known[1]["checks"][1]["known"]), (&true.into(), &true.into()));
    assert_eq!((&known[2]["ok"], &known[2]["checks"][1]["known"]), (&false.into(), &false.into()));
    let junit = read("a.xml");
    assert_eq!((junit.matches("<failure ").count(), junit.matches("<system-out>known: ").count()), (1, 2), "{junit}");
    let sarif: Value = serde_json::from_str(&read("a.sarif")).unwrap();
    let results = sarif["runs"][0]["results"].as_array().unwrap();
    let suppressed: Vec<usize> =
        results.iter().map(|result| result["suppressions"].as_array().unwrap().len()).collect();
    assert_eq!(suppressed, [1, 1, 0]);
    let text = read("a.md");
    assert!(text.contains("| `parts/new.obj` | error | `watertight` |"), "{text}");
    assert!(text.contains("| `parts/hole.obj` | known | `watertight` |"), "{text}");
}

#[test]
fn a_baseline_of_the_config_and_mistakes() {
    let folder = folder();
    let config = |text: &str| fs::write(folder.path().join("meshsnap.toml"), text).unwrap();
    config("[check]\nrules = [\"watertight\"]\n[check.baseline]\ndir = \"accepted\"\n");
    let parts = folder.path().join("parts");
    // It belongs to the folder of the config, wherever the command runs.
    assert_eq!(check(&parts, &[".", "--update"]).0, Some(0));
    assert!(folder.path().join("accepted/parts/hole.obj.json").exists());
    assert_eq!(check(folder.path(), &["parts"]).0, Some(0));
    fs::write(folder.path().join("accepted/parts/hole.obj.json"), "{\"faults\": 3}").unwrap();
    let (code, _, said) = check(folder.path(), &["parts"]);
    assert!(code == Some(2) && said.contains("hole.obj.json: is no baseline"), "{said}");
    let elsewhere = tempfile::tempdir().unwrap();
    fs::write(elsewhere.path().join("a.obj"), CUBE_OBJ).unwrap();
    let outside = elsewhere.path().join("a.obj");
    let (code, _, said) = check(folder.path(), &[outside.to_str().unwrap()]);
    assert!(code == Some(2) && said.contains("lies outside of"), "{said}");
    config("[check]\nrules = [\"watertight\"]\n");
    let (code, _, said) = check(folder.path(), &["parts", "--update"]);
    assert!(code == Some(2) && said.contains("--update needs a baseline"), "{said}");
    for (text, part) in [
        ("[check]\nbaseline = \"x\"\n", "line 2, column 12: `baseline` is a table"),
        ("[check.baseline]\n", "[check.baseline] needs a `dir`"),
        ("[check.baseline]\ndri = \"x\"\n", "line 2, column 1: there is no key `dri`; did you mean `dir`?"),
    ] {
        config(text);
        let (code, _, said) = check(folder.path(), &["parts"]);
        assert!(code == Some(2) && said.contains(part), "{text}: {said}");
    }
}

/// Runs git in a folder, as a user whose own settings are not read.
pub fn git_command(folder: &Path, words: &[&str]) -> Command {
    let mut command = Command::new("git");
    command.current_dir(folder).env("GIT_CONFIG_GLOBAL", "/dev/null").env("GIT_CONFIG_SYSTEM", "/dev/null");
    command.args(["-c", "user.name=a", "-c", "user.email=a@b", "-c", "init.defaultBranch=main"]).args(words);
    command.stdin(Stdio::null());
    command
}

/// Runs git, and expects it to succeed.
#[track_caller]
pub fn git(folder: &Path, words: &[&str]) {
    let output = git_command(folder, words).output().expect("this test needs the program `git`");
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn an_accepted_picture_that_cannot_be_read_has_no_difference() {
    let folder = folder();
    let run = |more: &[&str]| {
        let all = ["parts/good.obj", "--rules", "opens", "--baseline", "accepted", "--views", "iso"];
        check(folder.path(), &[&all, more].concat())
    };
    assert_eq!(run(&["--update"]).0, Some(0));
    fs::write(folder.path().join("accepted/parts/good.obj.iso.png"), "none").unwrap();
    assert_eq!(run(&["--pictures", "out"]).0, Some(0));
    let names = fs::read_dir(folder.path().join("out")).unwrap();
    let mut names: Vec<_> = names.map(|file| file.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["good.iso.before.png", "good.iso.png", "good.topology.png"]);
}

#[test]
fn only_meshes_that_changed_since_a_commit_are_checked() {
    let folder = folder();
    git(folder.path(), &["init", "-q"]);
    git(folder.path(), &["add", "."]);
    git(folder.path(), &["commit", "-qm", "first"]);
    let since = |at: &Path, reference: &str, paths: &[&str]| {
        let option = format!("--since={reference}");
        check(at, &[paths, &[option.as_str()]].concat())
    };
    let names = |at: &Path, reference: &str, paths: &[&str]| -> Vec<String> {
        let (code, out, said) = since(at, reference, paths);
        assert_eq!(code, Some(0), "{out}{said}");
        out.lines().filter(|line| line.ends_with(": ok")).map(|line| line.replace(": ok", "")).collect()
    };
    let all = ["parts", "colored.obj", "colored.mtl"];
    assert_eq!(names(folder.path(), "HEAD", &all), [] as [&str; 0]);
    // One that changed, one that git does not know, one whose name only git would put into quotes.
    fs::write(folder.path().join("parts/good.obj"), without(&["4 1 5 8"])).unwrap();
    fs::write(folder.path().join("parts/né w\".obj"), CUBE_OBJ).unwrap();
    assert_eq!(names(folder.path(), "HEAD", &all), ["parts/good.obj", "parts/né w\".obj"]);
    git(folder.path(), &["add", "."]);
    git(folder.path(), &["commit", "-qm", "second"]);
    assert_eq!(names(folder.path(), "HEAD", &all), [] as [&str; 0]);
    let parts = folder.path().join("parts");
    assert_eq!(names(&parts, "HEAD~1", &["."]), ["./good.obj", "./né w\".obj"]);
    // A material library of the meshes in its folder.
    fs::write(folder.path().join("colored.mtl"), b"newmtl a\nKd 0 1 0\n").unwrap();
    assert_eq!(names(folder.path(), "HEAD", &all), ["colored.obj"]);
    fs::remove_file(folder.path().join("colored.mtl")).unwrap();
    assert_eq!(names(folder.path(), "HEAD", &all[..2]), ["colored.obj"]);
    fs::write(folder.path().join("colored.mtl"), b"newmtl a\nKd 0 1 0\n").unwrap();
    for (reference, part) in [("absent", "git knows no such commit"), ("--output=x", "git knows no such commit")] {
        let (code, out, said) = since(folder.path(), reference, &all);
        assert!(code == Some(2) && out.is_empty() && said.contains(part), "{reference}: {said}");
    }
    assert!(!folder.path().join("x").exists());
}

/// A mesh that is new, one whose older side is a pointer of Git LFS whose content is here, is not, or is no mesh, and one
/// that lost a face: the page shows both sides of those that can be read.
#[test]
fn older_sides_come_from_git() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    git(folder.path(), &["init", "-q"]);
    let pointer = |byte: char| {
        let oid: String = std::iter::repeat_n(byte, 64).collect();
        format!("version https://git-lfs.github.com/spec/v1\noid sha256:{oid}\nsize {}\n", CUBE_OBJ.len())
    };
    let object = at(".git/lfs/objects/aa/aa").join("a".repeat(64));
    fs::create_dir_all(object.parent().unwrap()).unwrap();
    fs::write(object, CUBE_OBJ).unwrap();
    fs::write(at("kept.obj"), pointer('a')).unwrap();
    fs::write(at("absent.obj"), pointer('b')).unwrap();
    fs::write(at("broken.obj"), "nonsense").unwrap();
    fs::write(at("open.obj"), CUBE_OBJ).unwrap();
    git(folder.path(), &["add", "."]);
    git(folder.path(), &["commit", "-qm", "first"]);
    for name in ["kept.obj", "absent.obj", "broken.obj", "new.obj"] {
        fs::write(at(name), CUBE_OBJ).unwrap();
    }
    fs::write(at("open.obj"), without(&["4 1 5 8"])).unwrap();
    let options = ["--since", "HEAD", "--views", "iso", "--html", "page.html", "--markdown", "changes.md"];
    let (code, out, said) = check(folder.path(), &[&["."], &options[..]].concat());
    assert_eq!(code, Some(0), "{out}{said}");
    let of = |name: &str| -> Vec<String> {
        let lines = out.lines().skip_while(|line| *line != format!("./{name}: ok")).skip(1);
        let own = lines.take_while(|line| line.starts_with(' ')).filter_map(|line| line.strip_prefix("  changed: "));
        own.map(str::to_owned).collect()
    };
    let mut checked = 0;
    for (name, part) in [
        ("new.obj", "the file is new"),
        ("kept.obj", "the geometry is unchanged"),
        ("absent.obj", "its content is not here: git lfs fetch"),
        ("broken.obj", "its older side cannot be read: "),
        ("open.obj", "a hole with 4 edges near "),
    ] {
        assert!(of(name).iter().any(|sentence| sentence.contains(part)), "{name}: {out}");
        checked += 1;
    }
    assert_eq!(checked, 5);
    let page = fs::read_to_string(at("page.html")).unwrap();
    assert!(page.contains(", before: ./open.obj") && !page.contains(", before: ./kept.obj"));
    assert!(page.matches("<li><span>changed</span>").count() >= 5);
    let table = fs::read_to_string(at("changes.md")).unwrap();
    assert!(table.contains("| `./open.obj` | ") && table.contains("a hole with 4 edges"), "{table}");
    let (code, json, _) = check(folder.path(), &["open.obj", "--since", "HEAD", "--format", "jsonl"]);
    let verdict: Value = serde_json::from_str(&json).unwrap();
    assert!(code == Some(0) && verdict["changes"][0].as_str().unwrap().contains("a hole"), "{json}");
}

#[test]
fn a_folder_without_git_is_told() {
    let folder = folder();
    let mut command = crate::support::server::meshsnap();
    // Folders above do not count.
    command.env("GIT_CEILING_DIRECTORIES", folder.path().parent().unwrap());
    let output = command.current_dir(folder.path()).args(["check", "parts", "--since", "HEAD"]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && said.contains("--since needs a git repository"), "{said}");
    let mut command = crate::support::server::meshsnap();
    let output =
        command.env("PATH", "").current_dir(folder.path()).args(["check", "parts", "--since", "HEAD"]).output();
    let said = String::from_utf8(output.unwrap().stderr).unwrap();
    assert!(said.contains("the program `git` is not installed"), "{said}");
}

#[test]
fn a_pointer_of_lfs_is_named_for_what_it_is() {
    let folder = folder();
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 12345\n";
    fs::write(folder.path().join("parts/good.obj"), pointer).unwrap();
    let (code, out, _) = check(folder.path(), &["parts/good.obj"]);
    assert!(code == Some(1) && out.contains("Git LFS"), "{out}");
}
