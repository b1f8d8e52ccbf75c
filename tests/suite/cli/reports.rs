//! The reports of `meshsnap check`.

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
    assert_eq!(states, ["error", "warning", "error"]);
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
