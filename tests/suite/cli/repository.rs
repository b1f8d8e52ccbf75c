//! A repository with 30 meshes and commits that break and mend some: `check --since` and `diff`
//! name what changed, and nothing else. Also runs over hundreds of meshes: their output does not
//! depend on the number of threads, and their memory does not grow with the number of meshes.

use std::fs;
use std::path::Path;
use std::process::Stdio;

use super::baseline::{git, git_command};
use super::check::check;
use crate::support::data::{files, large_folder};
use crate::support::server::meshsnap;
use crate::support::shapes::torus;

/// Meshes of the repository.
const MESHES: usize = 30;

/// The lines of an OBJ text.
fn lines(text: &str) -> Vec<String> {
    text.lines().map(str::to_owned).collect()
}

/// The numbers of the lines with faces.
fn faces(lines: &[String]) -> Vec<usize> {
    (0..lines.len()).filter(|&line| lines[line].starts_with("f ")).collect()
}

/// Without one face.
fn with_a_hole(text: &str) -> String {
    let mut lines = lines(text);
    lines.remove(faces(&lines)[100]);
    lines.join("\n") + "\n"
}

/// With a face that looks to the other side.
fn with_a_turned_face(text: &str) -> String {
    let mut lines = lines(text);
    let line = faces(&lines)[500];
    let mut corners: Vec<&str> = lines[line].split_whitespace().skip(1).collect();
    corners.reverse();
    lines[line] = format!("f {}", corners.join(" "));
    lines.join("\n") + "\n"
}

/// With the vertices of these numbers moved along z.
fn moved(text: &str, vertices: &[usize], by: f64) -> String {
    let mut number = 0;
    let mut shift = |line: &str| {
        let Some(rest) = line.strip_prefix("v ") else { return line.to_owned() };
        number += 1;
        if !vertices.contains(&(number - 1)) {
            return line.to_owned();
        }
        let at: Vec<f64> = rest.split_whitespace().take(3).map(|value| value.parse().unwrap()).collect();
        format!("v {} {} {}", at[0], at[1], at[2] + by)
    };
    text.lines().map(|line| shift(line) + "\n").collect()
}

/// With vertices and faces in the opposite order.
fn in_another_order(text: &str) -> String {
    let lines = lines(text);
    let of = |kind: &str| lines.iter().filter(|line| line.starts_with(kind)).collect::<Vec<_>>();
    let (positions, uvs) = (of("v "), of("vt "));
    let corner = |corner: &str| {
        let mut parts = corner.split('/').map(|part| part.parse::<usize>().unwrap());
        let vertex = positions.len() + 1 - parts.next().unwrap();
        match parts.next() {
            Some(uv) => format!("{vertex}/{}", uvs.len() + 1 - uv),
            None => vertex.to_string(),
        }
    };
    let face = |line: &&String| {
        let corners: Vec<String> = line.split_whitespace().skip(1).map(corner).collect();
        format!("f {}\n", corners.join(" "))
    };
    let vertices = positions.iter().rev().chain(uvs.iter().rev()).map(|line| format!("{line}\n"));
    vertices.chain(of("f ").iter().rev().map(face)).collect()
}

/// The vertices of the first of the smallest parts.
fn smallest_part(text: &str) -> Vec<usize> {
    let lines = lines(text);
    let count = lines.iter().filter(|line| line.starts_with("v ")).count();
    let mut of_vertex: Vec<usize> = (0..count).collect();
    loop {
        let mut is_same = true;
        for line in faces(&lines).into_iter().map(|line| &lines[line]) {
            let corners: Vec<usize> = line
                .split_whitespace()
                .skip(1)
                .map(|corner| corner.split('/').next().unwrap().parse::<usize>().unwrap() - 1)
                .collect();
            let lowest = corners.iter().map(|corner| of_vertex[*corner]).min().unwrap();
            for corner in corners {
                is_same &= of_vertex[corner] == lowest;
                of_vertex[corner] = lowest;
            }
        }
        if is_same {
            break;
        }
    }
    let size = |part: usize| of_vertex.iter().filter(|other| **other == part).count();
    let smallest = (0..count).filter(|vertex| of_vertex[*vertex] == *vertex).min_by_key(|part| size(*part)).unwrap();
    (0..count).filter(|vertex| of_vertex[*vertex] == smallest).collect()
}

/// The summary of `diff` on a file before and after the last commit.
fn said_of(repository: &Path, path: &str) -> Vec<String> {
    let before = repository.join("../before");
    fs::remove_dir_all(&before).ok();
    fs::create_dir(&before).unwrap();
    for name in files(&repository.join("models")) {
        let name = name.file_name().unwrap().to_str().unwrap().to_owned();
        let old = git_command(repository, &["show", &format!("HEAD~1:models/{name}")]).output().unwrap();
        fs::write(before.join(&name), old.stdout).unwrap();
    }
    let mut command = meshsnap();
    command.current_dir(repository).args(["diff", "--siblings", "--json"]);
    command.arg(format!("../before/{}", path.strip_prefix("models/").unwrap())).arg(path).stdin(Stdio::null());
    let output = command.output().unwrap();
    let json: serde_json::Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)));
    json["summary"].as_array().unwrap().iter().map(|one| one.as_str().unwrap().to_owned()).collect()
}

#[test]
#[expect(clippy::too_many_lines, reason = "one story, told step by step")]
fn each_commit_is_named_in_words_and_nothing_else() {
    let Some(models) = large_folder("models") else { return };
    let folder = tempfile::tempdir().unwrap();
    let repository = folder.path().join("repository");
    fs::create_dir_all(repository.join("models")).unwrap();
    // Those that change, and then the small ones; and what they refer to.
    let mut found: Vec<_> = files(&models).into_iter().filter(|path| path.parent() == Some(&models)).collect();
    let changes = ["suzanne.obj", "cow.obj", "spot.obj", "fuze.obj"];
    let is_changed = |path: &Path| changes.iter().any(|name| path.ends_with(name));
    found.sort_by_key(|path| (!is_changed(path), fs::metadata(path).unwrap().len()));
    let is_mesh = |path: &Path| {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        ["obj", "stl", "ply", "off", "glb", "gltf"].iter().any(|known| extension == *known)
    };
    let (meshes, others): (Vec<_>, Vec<_>) = found.into_iter().partition(|path| is_mesh(path));
    for path in meshes.iter().take(MESHES).chain(&others) {
        fs::write(repository.join("models").join(path.file_name().unwrap()), fs::read(path).unwrap()).unwrap();
    }
    let commit = |message: &str| {
        git(&repository, &["add", "."]);
        git(&repository, &["commit", "-qm", message]);
    };
    git(&repository, &["init", "-q"]);
    commit("all meshes");

    let path = |name: &str| repository.join("models").join(name);
    let text = |name: &str| String::from_utf8(fs::read(path(name)).unwrap()).unwrap();
    let suzanne = text("suzanne.obj");
    let eye = smallest_part(&suzanne);
    let picture = image::RgbImage::from_pixel(8, 8, image::Rgb([200, 30, 30]));
    let mut swapped = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut swapped, image::ImageFormat::Jpeg).unwrap();
    let steps: [(&str, &str, Vec<u8>, &[&str]); 6] = [
        ("a hole", "suzanne.obj", with_a_hole(&suzanne).into(), &["a hole with 4 edges near ("]),
        ("mended", "suzanne.obj", suzanne.clone().into(), &["the hole with 4 edges near ("]),
        (
            "a turned face",
            "cow.obj",
            with_a_turned_face(&text("cow.obj")).into(),
            &["one face looks to the other side near (", "it is no longer watertight"],
        ),
        (
            "a moved part",
            "suzanne.obj",
            moved(&suzanne, &eye, 0.5).into(),
            // It touched another part in one vertex.
            &[
                "one part moved by (0, 0, 0.5)",
                "vertices where surfaces touch: 1, before 2",
                "connected parts: 2, before 1",
            ],
        ),
        (
            "exported again",
            "spot.obj",
            in_another_order(&text("spot.obj")).into(),
            &["the geometry is unchanged, with vertices or faces in another order"],
        ),
        (
            "another texture",
            "fuze uv.jpg",
            swapped.into_inner(),
            &["the geometry is unchanged", "texture (another image)"],
        ),
    ];
    let mut named = 0;
    for (message, name, bytes, expected) in steps {
        fs::write(path(name), bytes).unwrap();
        commit(message);
        let mesh = if name.ends_with(".jpg") { "models/fuze.obj".to_owned() } else { format!("models/{name}") };
        let (code, out, said) = check(&repository, &["models", "--since", "HEAD~1", "--rules", "opens"]);
        let judged: Vec<&str> = out.lines().filter(|line| !line.starts_with(' ')).collect();
        assert_eq!((code, judged), (Some(0), vec![format!("{mesh}: ok").as_str()]), "{message}: {out}{said}");
        let changed: Vec<&str> = out.lines().filter_map(|line| line.strip_prefix("  changed: ")).collect();
        let said = said_of(&repository, &mesh);
        assert_eq!(changed, said, "{message}");
        assert_eq!(said.len(), expected.len(), "{message}: {said:?}");
        for (sentence, part) in said.iter().zip(expected) {
            assert!(sentence.contains(part), "{message}: {said:?}");
        }
        named += 1;
    }
    assert_eq!(named, 6);
    let (code, out, said) = check(&repository, &["models", "--since", "HEAD", "--rules", "opens"]);
    assert_eq!((code, out.as_str()), (Some(0), ""), "{said}");
    // All of them, in the order of their paths.
    let (_, out, _) = check(&repository, &["models", "--rules", "opens"]);
    assert_eq!(out.lines().filter(|line| !line.starts_with(' ')).count(), MESHES);
}

/// Many meshes in one run: the same output at any number of threads.
#[test]
fn hundreds_of_meshes_are_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let cube = String::from_utf8(crate::support::server::CUBE_OBJ.to_vec()).unwrap();
    for number in 0..300 {
        let text = if number % 7 == 0 { cube.replace("f 4 1 5 8\n", "") } else { cube.clone() };
        fs::write(folder.path().join(format!("part-{number:03}.obj")), text).unwrap();
    }
    let run = |jobs: &str| check(folder.path(), &[".", "--rules", "watertight", "--jobs", jobs]);
    let first = run("1");
    assert_eq!(first.2, "257 ok, 43 failed\n");
    assert_eq!(first.1.lines().filter(|line| !line.starts_with(' ')).count(), 300);
    for jobs in ["2", "16"] {
        assert_eq!(run(jobs), first, "{jobs}");
    }
}

/// The most memory that a run has at a time, in KiB, as the kernel counts it. It is looked at again and again while
/// the run goes on; what it comes to between the last look and the end is missed.
#[cfg(target_os = "linux")]
fn peak_kib(folder: &Path, arguments: &[&str]) -> u64 {
    let mut command = meshsnap();
    command.current_dir(folder).arg("check").args(arguments).stdin(Stdio::null());
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    while child.try_wait().unwrap().is_none() {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        peak = peak.max(line.map_or(0, |line| line.trim().trim_end_matches(" kB").parse().unwrap()));
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    peak
}

#[cfg(target_os = "linux")]
#[test]
fn the_memory_of_a_run_does_not_grow_with_its_meshes() {
    let folder = tempfile::tempdir().unwrap();
    let text = torus(40);
    for number in 0..600 {
        fs::write(folder.path().join(format!("{number:03}.obj")), &text).unwrap();
    }
    let peak = peak_kib(folder.path(), &[".", "--rules", "watertight,manifold", "--jobs", "2"]);
    let texts = 600 * text.len() as u64 / 1024;
    println!("600 meshes: {peak} KiB at the most, their texts alone are {texts} KiB");
    assert!(peak > 4096 && peak < texts, "{peak} KiB, texts of {texts}");
}

#[test]
fn one_run_of_many_meshes_takes_less_time_than_a_run_for_each() {
    let folder = tempfile::tempdir().unwrap();
    let names: Vec<String> = (0..100).map(|number| format!("{number:03}.obj")).collect();
    names.iter().for_each(|name| fs::write(folder.path().join(name), crate::support::server::CUBE_OBJ).unwrap());
    let run = |path: &str| assert_eq!(check(folder.path(), &[path, "--rules", "watertight"]).0, Some(0));
    let start = std::time::Instant::now();
    run(".");
    let at_once = start.elapsed();
    names.iter().for_each(|name| run(name));
    let by_itself = start.elapsed() - at_once;
    println!("100 meshes: {at_once:?} in one run, {by_itself:?} in a run for each");
    assert!(at_once < by_itself, "{at_once:?} in one run, {by_itself:?} in a run for each");
}
