//! SARIF and JUnit reports, against the schemas by which other programs read them.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::super::check::{check, folder};
use crate::support::skip::{Need, skip};

const SCHEMAS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/schemas");

/// Runs whose reports have all that reports can have: broken rules of each kind, known faults, names and sentences
/// that are no plain text, no fault at all.
fn runs() -> (tempfile::TempDir, Vec<Vec<&'static str>>) {
    let folder = folder();
    let parts = folder.path().join("parts");
    let hole = fs::read(parts.join("hole.obj")).unwrap();
    for name in ["a&b <c>\"'.obj", "é \u{202e}\u{1f600}.obj", "%41 #?.obj", "]]>.obj", "-->.obj"] {
        fs::write(parts.join(name), &hole).unwrap();
    }
    #[cfg(unix)]
    fs::write(parts.join("tab\tbell\u{7}.obj"), &hole).unwrap();
    // A material whose name is in a sentence of a warning.
    let strange = [b"mtllib \x01\x02<&>.mtl\n".as_slice(), &hole].concat();
    fs::write(parts.join("strange.obj"), strange).unwrap();
    let all_rules = "opens,watertight,manifold,consistent-winding,no-degenerate,no-duplicate-faces,no-self-intersection,\
                     no-inverted-volume,no-loose-vertices,no-ngons,single-component,has-normals,has-uv,uv-in-range,\
                     uv-no-overlap,max-triangles:5,max-vertices:5,max-materials:0,max-texture-px:1,max-file-bytes:9,\
                     bounds:1,1,1";
    let runs = vec![
        vec!["parts", "broken.stl", "absent.obj", "--rules", all_rules, "--warn", "no-warnings", "--all-places"],
        vec!["parts", "--rules", "watertight", "--baseline", "known", "--update"],
        vec!["parts", "broken.stl", "--rules", "watertight,has-uv", "--baseline", "known"],
        vec!["parts/good.obj", "--rules", "watertight"],
    ];
    (folder, runs)
}

#[test]
fn sarif_is_valid_by_its_schema() {
    let schema = fs::read_to_string(Path::new(SCHEMAS).join("sarif-2.1.0-rtm.5.json")).unwrap();
    // A bracket of its pattern for languages, which reports do not have, is never opened.
    let schema = schema.replace("[a-zA-Z]{2}]?$", "[a-zA-Z]{2}$");
    let schema = jsonschema::validator_for(&serde_json::from_str(&schema).unwrap()).unwrap();
    let faults = |document: &Value| schema.iter_errors(document).map(|error| error.to_string()).collect::<Vec<_>>();
    let (folder, runs) = runs();
    let (mut results, mut suppressed, mut count) = (0, 0, 0);
    for words in runs {
        let (_, _, said) = check(folder.path(), &[&words[..], &["--sarif", "out.sarif"]].concat());
        let text = fs::read(folder.path().join("out.sarif")).unwrap_or_else(|error| panic!("{error}: {said}"));
        let document: Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(faults(&document), [""; 0], "{words:?}");
        let all = document["runs"][0]["results"].as_array().unwrap();
        results += all.len();
        suppressed += all.iter().filter(|one| one["suppressions"].as_array().is_some_and(|s| !s.is_empty())).count();
        count += 1;
        // The schema refuses what is wrong.
        let mut wrong = document.clone();
        wrong["runs"][0]["tool"]["driver"]["rules"][0]["shortDescription"]["text"] = Value::Null;
        assert!(!faults(&wrong).is_empty());
    }
    assert!(count == 4 && results > 80 && suppressed > 10, "{results} results, {suppressed} of them known");
}

#[test]
fn junit_is_valid_by_the_schema_of_jenkins() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = root.join("target/python/bin/python");
    let has_lxml = |python: &Path| Command::new(python).args(["-c", "import lxml.etree"]).status().unwrap().success();
    if !python.is_file() || !has_lxml(&python) {
        return skip(Need::Python, "lxml in target/python");
    }
    let (folder, runs) = runs();
    let faults = |name: &str| {
        let mut command = Command::new(&python);
        command.arg(root.join("tests/python/junit.py")).arg(Path::new(SCHEMAS).join("junit-10.xsd"));
        let output = command.arg(folder.path().join(name)).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let (mut failures, mut outputs, mut count) = (0, 0, 0);
    for words in runs {
        let (_, _, said) = check(folder.path(), &[&words[..], &["--junit", "out.xml"]].concat());
        let text = fs::read_to_string(folder.path().join("out.xml")).unwrap_or_else(|error| panic!("{error}: {said}"));
        assert_eq!(faults("out.xml"), "", "{words:?}");
        failures += text.matches("<failure ").count();
        outputs += text.matches("<system-out>").count();
        count += 1;
        // The schema refuses what is wrong.
        fs::write(folder.path().join("wrong.xml"), text.replacen(" name=", " label=", 2)).unwrap();
        assert!(faults("wrong.xml").contains("label"), "{}", faults("wrong.xml"));
    }
    assert!(count == 4 && failures > 60 && outputs > 10, "{failures} failures, {outputs} outputs");
}
