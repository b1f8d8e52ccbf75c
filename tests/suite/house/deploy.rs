//! The files of `deploy/` are valid for the tools that read them, and each setting in them is one
//! that `serve` knows.

use std::path::Path;
use std::process::Command;

use crate::support::server::{Server, meshsnap};
use crate::support::skip::{Need, skip};

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/deploy"))
}

/// True for a variable that sets something: its flag is in the help, before its value or, of a switch, a bracket.
fn is_known(variable: &str, help: &str) -> bool {
    let flag = variable.strip_prefix("MESHSNAP_").map(|name| name.to_ascii_lowercase().replace('_', "-"));
    flag.is_some_and(|flag| [" ", "["].iter().any(|end| help.contains(&format!("  --{flag}{end}"))))
}

fn help() -> String {
    let output = meshsnap().args(["serve", "--help"]).output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn manifests_are_valid_and_set_what_serve_knows() {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/python/bin/python");
    if !python.is_file() {
        return skip(Need::Python, &python.display().to_string());
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/manifests.py");
    let output = Command::new(python).env("PYTHONDONTWRITEBYTECODE", "1").arg(script).arg(folder()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // Kubernetes: three kinds for one server and four for several; Compose: two files.
    assert_eq!(found["schemas"], 9);
    assert_eq!((&found["scalers"], &found["images"]), (&1.into(), &3.into()));
    let help = help();
    let mut settings = 0;
    for (variable, _) in found["settings"].as_object().unwrap() {
        assert!(is_known(variable, &help), "{variable} is no setting");
        settings += 1;
    }
    assert_eq!(settings, 7);
    let server = Server::start(&[]);
    let mut probes = 0;
    for path in found["probes"].as_array().unwrap() {
        assert_eq!(server.get(path.as_str().unwrap()).status, 200, "{path}");
        probes += 1;
    }
    assert_eq!(probes, 6);
}

#[test]
fn the_unit_is_valid_and_sets_what_serve_knows() {
    let unit = std::fs::read_to_string(folder().join("systemd/meshsnap.service")).unwrap();
    let help = help();
    let mut settings = 0;
    for line in unit.lines().filter_map(|line| line.strip_prefix("Environment=")) {
        let (variable, _) = line.split_once('=').unwrap();
        assert!(is_known(variable, &help), "{variable} is no setting");
        settings += 1;
    }
    assert_eq!(settings, 4);
    let binary = "/usr/local/bin/meshsnap";
    assert!(unit.contains(&format!("ExecStart={binary} serve\n")));
    if !Command::new("systemd-analyze").arg("--version").output().is_ok_and(|output| output.status.success()) {
        return skip(Need::Systemd, "systemd-analyze");
    }
    // The program is not installed here.
    let folder = tempfile::tempdir().unwrap();
    let verify = |unit: &str| {
        let path = folder.path().join("meshsnap.service");
        std::fs::write(&path, unit).unwrap();
        let output = Command::new("systemd-analyze").arg("verify").arg("--man=no").arg(&path).output().unwrap();
        (output.status.success(), String::from_utf8(output.stderr).unwrap())
    };
    let unit = unit.replace(binary, env!("CARGO_BIN_EXE_meshsnap"));
    let (is_valid, said) = verify(&unit);
    assert!(is_valid && said.is_empty(), "{said}");
    let (_, said) = verify(&unit.replace("UMask=", "Umask_="));
    assert!(said.contains("Umask_"), "it sees faults: {said}");
}
