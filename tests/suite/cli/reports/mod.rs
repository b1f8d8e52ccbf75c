//! The reports that `meshsnap check` writes: SARIF, JUnit, JSON lines, Markdown, and pages with
//! pictures.

mod pages;
mod schemas;

use std::fs;

use serde_json::{Value, json};

use super::check::{check, folder};

const RULES: &[&str] = &["--rules", "opens,watertight", "--warn", "max-triangles:5"];

#[test]
fn several_reports_of_one_run_have_the_same_bytes_each_time() {
    let folder = folder();
    let files =
        ["--junit", "a.xml", "--sarif", "a.sarif", "--markdown", "a.md", "--jsonl", "a.jsonl", "--html", "a.html"];
    let run = |jobs: &str| {
        let words = [&["parts", "broken.stl", "--format", "jsonl", "--jobs", jobs], RULES, &files].concat();
        let (code, out, said) = check(folder.path(), &words);
        assert_eq!(code, Some(1), "{said}");
        let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
        (out, ["a.xml", "a.sarif", "a.md", "a.jsonl", "a.html"].map(read))
    };
    let (out, reports) = run("1");
    assert!(reports.iter().all(|report| report.contains("parts/hole.obj")), "{reports:?}");
    assert_eq!(reports[3], out);
    for jobs in ["1", "3"] {
        assert!(run(jobs) == (out.clone(), reports.clone()), "{jobs}");
    }
}

#[test]
fn sarif_has_a_result_for_each_broken_rule() {
    let folder = folder();
    fs::copy(folder.path().join("parts/hole.obj"), folder.path().join("parts/a b.obj")).unwrap();
    let words = [&["parts", "broken.stl", "--sarif", "a.sarif"], RULES].concat();
    assert_eq!(check(folder.path(), &words).0, Some(1));
    let text = fs::read_to_string(folder.path().join("a.sarif")).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(document["version"], "2.1.0");
    let run = &document["runs"][0];
    assert_eq!(run["invocations"][0]["executionSuccessful"], true);
    let rules = run["tool"]["driver"]["rules"].as_array().unwrap();
    assert!(rules.iter().all(|rule| rule["shortDescription"]["text"].as_str().unwrap().ends_with('.')), "{rules:?}");
    let results = run["results"].as_array().unwrap();
    let brief = |result: &Value| {
        let index = result["ruleIndex"].as_u64().unwrap() as usize;
        assert_eq!(rules[index]["id"], result["ruleId"]);
        let place = &result["locations"][0]["physicalLocation"];
        assert_eq!(place["region"]["startLine"], 1);
        json!([place["artifactLocation"]["uri"], result["ruleId"], result["level"]])
    };
    let found: Vec<Value> = results.iter().map(brief).collect();
    assert_eq!(
        json!(found),
        json!([
            ["broken.stl", "opens", "error"],
            ["parts/a%20b.obj", "watertight", "error"],
            ["parts/a%20b.obj", "max-triangles", "warning"],
            ["parts/good.obj", "max-triangles", "warning"],
            ["parts/hole.obj", "watertight", "error"],
            ["parts/hole.obj", "max-triangles", "warning"],
        ])
    );
    // Alerts of code hosts are told apart by these.
    let of = |result: &Value| result["partialFingerprints"]["primaryLocationLineHash"].to_string();
    let mut prints: Vec<String> = results.iter().map(of).collect();
    prints.sort();
    prints.dedup();
    assert_eq!(prints.len(), results.len());
    let watertight = &results[1];
    assert!(watertight["message"]["text"].as_str().unwrap().starts_with("4 open edges in 1 loop; at ("));
    assert_eq!(watertight["properties"]["where"].as_array().unwrap().len(), 4);
}

#[test]
fn markdown_is_a_table_of_the_faults() {
    let folder = folder();
    let run = |words: &[&str]| {
        check(folder.path(), &[words, &["--markdown", "a.md"]].concat());
        fs::read_to_string(folder.path().join("a.md")).unwrap()
    };
    let text = run(&[&["parts", "broken.stl"], RULES].concat());
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "### meshsnap check: 2 of 3 files failed");
    assert_eq!(lines[2..4], ["| file | level | rule | fault |", "|---|---|---|---|"]);
    assert!(lines[4].starts_with("| `broken.stl` | error | `opens` | "), "{text}");
    assert!(lines[5].starts_with("| `parts/hole.obj` | error | `watertight` | 4 open edges in 1 loop; at "), "{text}");
    // What only warns comes last.
    assert_eq!(lines[7], "| `parts/good.obj` | warning | `max-triangles` | 12 triangles, and 5 allowed |");
    assert_eq!(run(&["parts", "--rules", "opens"]), "### meshsnap check: 2 files ok\n");
}

#[test]
fn a_report_replaces_no_input_and_no_other_report() {
    let folder = folder();
    fs::write(folder.path().join("meshsnap.toml"), "[check]\nrules = [\"opens\"]\n").unwrap();
    for flag in ["--junit", "--sarif", "--markdown", "--html", "--jsonl"] {
        for (name, part) in [
            ("parts/good.obj", "inputs are never written over"),
            ("parts/../meshsnap.toml", "inputs are never written over"),
            ("-", "name a file"),
            ("absent/a", "there is no folder"),
        ] {
            let (code, out, said) = check(folder.path(), &["parts", flag, name]);
            assert!(code == Some(2) && out.is_empty() && said.contains(part), "{flag} {name}: {said}");
        }
    }
    let (code, _, said) = check(folder.path(), &["parts", "--junit", "a", "--sarif", "./parts/../a"]);
    assert!(code == Some(2) && said.contains("another report goes to this file"), "{said}");
    assert!(!folder.path().join("a").exists());
}

#[test]
fn the_page_has_a_row_for_each_file_and_loads_nothing() {
    let folder = folder();
    let evil = "<img src=x onerror=alert(1)>\u{202e}.obj";
    fs::write(folder.path().join("parts").join(evil), b"v 0 0 0").unwrap();
    let words = [&["parts", "--html", "a.html"], RULES].concat();
    assert_eq!(check(folder.path(), &words).0, Some(1));
    let page = fs::read_to_string(folder.path().join("a.html")).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>\n<html lang=\"en\">") && page.ends_with("</html>\n"));
    let states: Vec<&str> =
        page.split("<tr data-state=\"").skip(1).map(|rest| rest.split('"').next().unwrap_or_default()).collect();
    // Those that fail come first.
    assert_eq!(states, ["error", "error", "warning"]);
    assert!(
        page.contains("<h1>meshsnap check: 2 of 3 files failed</h1>\n<p>2 faults, 2 warnings, 0 known faults</p>"),
        "{page}"
    );
    assert!(page.contains("4 open edges in 1 loop<details><summary>4 places</summary><ol><li>(-1, "), "{page}");
    // A name is a text, whatever it says.
    assert!(!page.contains("<img") && !page.contains('\u{202e}'), "{page}");
    assert!(page.contains("parts/&lt;img src=x onerror=alert(1)&gt;\u{fffd}.obj"), "{page}");
    for loads in ["src=\"", "href=", "url(", "@import", "http:", "https:", "fetch("] {
        assert!(!page.contains(loads), "{loads}");
    }
    assert!(page.contains("default-src 'none'"));
}

/// The address of each picture of a page, with its text.
fn pictures_of(page: &str) -> Vec<(image::RgbaImage, String)> {
    use base64::Engine as _;
    let images = page.split("<img src=\"data:image/png;base64,").skip(1);
    images
        .map(|rest| {
            let (data, rest) = rest.split_once('"').unwrap();
            let bytes = base64::engine::general_purpose::STANDARD.decode(data).unwrap();
            let alt = rest.split("alt=\"").nth(1).unwrap().split('"').next().unwrap();
            (image::load_from_memory(&bytes).unwrap().to_rgba8(), alt.to_owned())
        })
        .collect()
}

fn is_red(pixel: &image::Rgba<u8>) -> bool {
    pixel[0] > 180 && pixel[1] < 90 && pixel[2] < 90
}

#[test]
fn pages_show_the_views_and_mark_where_a_rule_fails() {
    let folder = folder();
    fs::write(folder.path().join("meshsnap.toml"), "[check]\nrules = [\"watertight\"]\nviews = [\"iso\", \"left\"]\n")
        .unwrap();
    assert_eq!(check(folder.path(), &["parts", "--html", "a.html"]).0, Some(1));
    let page = fs::read_to_string(folder.path().join("a.html")).unwrap();
    let found = pictures_of(&page);
    let names: Vec<&str> = found.iter().map(|(_, alt)| alt.as_str()).collect();
    let expected = ["iso", "left", "topology"];
    let of = |file: &str| expected.map(|view| format!("{view}: parts/{file}"));
    // What fails comes first.
    assert_eq!(names, [of("hole.obj"), of("good.obj")].concat());
    for (picture, alt) in &found {
        assert_eq!(picture.dimensions(), (320, 320), "{alt}");
        let red = picture.pixels().filter(|pixel| is_red(pixel)).count();
        // The hole is at -x, so that its edges are around the picture from the left.
        let is_marked = alt.ends_with("hole.obj");
        assert!(if is_marked { red > 300 } else { red == 0 || alt.starts_with("topology") }, "{alt}: {red}");
    }
    // The same bytes at any number of threads.
    assert_eq!(check(folder.path(), &["parts", "--html", "b.html", "--jobs", "1"]).0, Some(1));
    assert!(page == fs::read_to_string(folder.path().join("b.html")).unwrap());
    // Nothing is drawn that nobody sees.
    let (_, out, _) = check(folder.path(), &["parts", "--format", "jsonl"]);
    assert!(!out.contains("pictures"), "{out}");
}

#[test]
fn pictures_are_files_that_markdown_and_json_name() {
    let folder = folder();
    let words = ["parts", "--views", "iso", "--pictures", "seen here", "--markdown", "a.md", "--format", "jsonl"];
    let (code, out, said) = check(folder.path(), &[&words, RULES].concat());
    assert_eq!(code, Some(1), "{said}");
    let verdicts: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let mut pictures = 0;
    for (verdict, name) in verdicts.iter().zip(["good", "hole"]) {
        for view in ["iso", "topology"] {
            let path = verdict["pictures"][view].as_str().unwrap();
            assert!(path.starts_with("seen here/") && path.ends_with(&format!("{name}.{view}.png")), "{path}");
            assert_eq!(image::open(folder.path().join(path)).unwrap().to_rgba8().dimensions(), (320, 320));
            pictures += 1;
        }
    }
    assert_eq!(pictures, 4);
    let markdown = fs::read_to_string(folder.path().join("a.md")).unwrap();
    assert!(
        markdown.contains("\n| file | iso | topology |\n|---|---|---|\n| `parts/hole.obj` | <img src=\"seen%20here/"),
        "{markdown}"
    );
    assert!(
        markdown.contains("width=\"160\" alt=\"iso of parts/hole.obj\">") && !markdown.contains("good.iso"),
        "{markdown}"
    );
}

#[test]
fn baselines_keep_pictures_and_a_page_shows_what_changed() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let words = ["parts", "--baseline", "known", "--views", "iso,top", "--rules", "watertight"];
    assert_eq!(check(folder.path(), &[&words[..], &["--update"]].concat()).0, Some(0));
    for name in ["good.obj.iso.png", "good.obj.top.png", "good.obj.topology.png", "hole.obj.iso.png", "hole.obj.json"] {
        assert!(path("known/parts").join(name).is_file(), "{name}");
    }
    let with_page = [&words[..], &["--html", "a.html"]].concat();
    assert_eq!(check(folder.path(), &with_page).0, Some(0));
    let page = fs::read_to_string(path("a.html")).unwrap();
    assert!(!page.contains("class=\"change\"") && pictures_of(&page).len() == 6, "nothing has changed");
    // The cube becomes longer along z: it looks the same from above but for its distance.
    let longer = String::from_utf8(fs::read(path("parts/good.obj")).unwrap()).unwrap().replace(" 1\n", " 3\n");
    fs::write(path("parts/good.obj"), longer).unwrap();
    assert_eq!(check(folder.path(), &with_page).0, Some(0));
    let page = fs::read_to_string(path("a.html")).unwrap();
    let alts: Vec<String> = pictures_of(&page).into_iter().map(|(_, alt)| alt).collect();
    for kind in ["before", "after", "difference"] {
        assert!(alts.contains(&format!("iso, {kind}: parts/good.obj")), "{alts:?}");
        assert!(!alts.contains(&format!("iso, {kind}: parts/hole.obj")), "{alts:?}");
    }
    let flip: f64 = page.split("iso changed by ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((0.01..1.0).contains(&flip), "{flip}");
    assert!(page.contains("aria-label=\"Blink iso of parts/good.obj\">Blink</button>"), "{page}");
    // An accepted picture that is none has no difference, and stops nothing.
    fs::write(path("known/parts/good.obj.iso.png"), b"no picture").unwrap();
    assert_eq!(check(folder.path(), &with_page).0, Some(0));
}

#[test]
fn views_that_are_none_and_pictures_without_views_are_refused() {
    let folder = folder();
    for (words, part) in [
        (&["parts", "--views", "sideways"][..], "--views: there is no view `sideways`; the views are auto, iso"),
        (&["parts", "--pictures", "seen"], "--pictures needs views"),
    ] {
        let (code, _, said) = check(folder.path(), words);
        assert!(code == Some(2) && said.contains(part), "{said}");
    }
    fs::write(folder.path().join("meshsnap.toml"), "[check]\nviews = [\"iso\",\n  \"up\"]\n").unwrap();
    let (code, _, said) = check(folder.path(), &["parts"]);
    assert!(code == Some(2) && said.contains("line 3, column 3: there is no view `up`"), "{said}");
}
