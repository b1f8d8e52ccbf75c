//! The report of `meshsnap check` as SARIF 2.1.0, the format by which code hosts annotate files: a
//! result for each rule that a file breaks.

use std::path::{Component, Path};

use percent_encoding::utf8_percent_encode;
use serde_json::{Value, json};

use super::text::at;
use super::{Findings, faults};
use crate::check::SEGMENT;
use crate::error::CliError;
use meshsnap_inspect::check::{Check, Level, NAMES, PLACES_MAX, meaning};
use meshsnap_server::digest::Digest;

/// The report: a result for each broken rule of each file.
pub fn sarif(findings: &Findings<'_>) -> Result<String, CliError> {
    let rule = |name: &&str| json!({ "id": name, "shortDescription": { "text": meaning(name) } });
    let has_known = findings.known() > 0;
    let results: Vec<Value> = findings
        .verdicts
        .iter()
        .flat_map(|verdict| faults(verdict).map(|check| result(&verdict.path, check, has_known)))
        .collect();
    let driver = json!({
        "name": "meshsnap",
        "version": env!("CARGO_PKG_VERSION"),
        "rules": NAMES.iter().map(rule).collect::<Vec<_>>(),
    });
    let document = json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": driver },
            "invocations": [{ "executionSuccessful": findings.lost == 0 }],
            "results": results,
        }],
    });
    let text = serde_json::to_string_pretty(&document).map_err(|error| CliError::ours(error.to_string()))?;
    Ok(text + "\n")
}

/// The result for a fault. If some faults of a run are known, each says whether it is.
fn result(path: &str, check: &Check, has_known: bool) -> Value {
    let uri = uri(path);
    // The same fault in the same file is the same alert, however often the file changes.
    let fingerprint = Digest::of(format!("{}\n{uri}", check.rule).as_bytes()).to_string();
    let mut result = json!({
        "ruleId": check.rule,
        "ruleIndex": NAMES.iter().position(|name| *name == check.rule),
        "level": level(check),
        "message": { "text": format!("{}{}", check.detail, at(check)) },
        "locations": [{
            "physicalLocation": {
                "artifactLocation": { "uri": uri },
                // Code hosts show nothing that has no line. Faults of a mesh are in none.
                "region": { "startLine": 1 },
            },
        }],
        "partialFingerprints": { "primaryLocationLineHash": format!("{}:1", &fingerprint[..16]) },
        "properties": { "found": check.found, "allowed": check.allowed, "where": &check.places[..check.places.len().min(PLACES_MAX)] },
    });
    if has_known {
        let known = json!([{ "kind": "external", "justification": "it is in the baseline" }]);
        result["suppressions"] = if check.known { known } else { json!([]) };
    }
    result
}

fn level(check: &Check) -> &'static str {
    match check.level {
        Level::Error => "error",
        Level::Warn => "warning",
    }
}

/// A path as a URI: relative to the folder in which the command runs, or `file:` for an absolute path.
fn uri(path: &str) -> String {
    let path = Path::new(path);
    let mut segments = Vec::new();
    for component in path.components() {
        match component {
            Component::Prefix(_) | Component::Normal(_) => {
                // A colon would end a scheme.
                segments.push(utf8_percent_encode(&component.as_os_str().to_string_lossy(), SEGMENT).to_string());
            }
            Component::ParentDir => segments.push("..".to_owned()),
            Component::RootDir | Component::CurDir => {}
        }
    }
    let relative = segments.join("/");
    if path.is_absolute() { format!("file:///{relative}") } else { relative }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_become_uris() {
        let cases = [
            ("parts/a.obj", "parts/a.obj"),
            ("./parts//a.obj", "parts/a.obj"),
            ("../a b#1?.obj", "../a%20b%231%3F.obj"),
            ("é%41.obj", "%C3%A9%2541.obj"),
            ("http:/x.obj", "http%3A/x.obj"),
        ];
        for (path, expected) in cases {
            assert_eq!(uri(path), expected);
        }
        #[cfg(unix)]
        assert_eq!(uri("/parts/a\\b.obj"), "file:///parts/a%5Cb.obj");
    }
}
