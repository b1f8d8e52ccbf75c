//! Code for one operating system stands behind a `cfg` for that system. This test reads the source,
//! so it runs on every machine; `cargo xtask cross` compiles the program for the other systems, and
//! needs their targets installed.

use super::structure::{code, sources};

/// What Windows does not have, and what of it macOS has not either.
const OF_UNIX: [&str; 4] = ["std::os::unix", "std::os::fd", "tokio::signal::unix", "signal_hook::"];
const OF_LINUX: [&str; 6] = ["std::os::linux", "rustix::", "libc::", "landlock::", "seccompiler::", "memmap2::"];

/// The module that is Linux's as a whole: `main.rs` says so.
const LINUX_ROOM: &str = "program/sandbox/";

#[test]
fn code_of_one_system_is_gated() {
    let (mut found, mut faults) = (0, Vec::new());
    for (file, text) in sources() {
        for (number, line) in code(&text) {
            let is_of = |words: &[&str]| words.iter().any(|word| line.contains(word));
            let gates: &[&str] = match (is_of(&OF_LINUX), is_of(&OF_UNIX)) {
                (true, _) => &["target_os = \"linux\""],
                (false, true) => &["unix", "target_os = \"linux\""],
                _ => continue,
            };
            found += 1;
            if !file.starts_with(LINUX_ROOM) && !is_gated(&text, number, gates) {
                faults.push(format!("src/{file}:{number}: {}", line.trim()));
            }
        }
    }
    let root = sources().into_iter().find(|(file, _)| file == "program/main.rs").unwrap().1;
    let room = root.lines().position(|line| line == "mod sandbox;").unwrap();
    assert!(is_gated(&root, room + 1, &["target_os = \"linux\""]), "the sandbox is Linux's");
    assert!(found >= 20, "only {found} mentions found: the scan is broken");
    assert!(faults.is_empty(), "for one system alone, and without a `cfg`:\n{}", faults.join("\n"));
}

/// True if the line with this number (from 1), or something that it stands in, has one of these gates. The source is
/// formatted, so that what a line stands in is the nearest line above that is indented less.
fn is_gated(text: &str, number: usize, gates: &[&str]) -> bool {
    let lines: Vec<&str> = text.lines().collect();
    let indent = |line: &str| line.len() - line.trim_start().len();
    let mut at = number - 1;
    loop {
        let attributes = lines[..at].iter().rev().take_while(|line| line.trim_start().starts_with("#["));
        let opens = |attribute: &str, gate: &str| attribute.contains(gate) && !attribute.contains("not(");
        if attributes.into_iter().any(|line| line.contains("cfg(") && gates.iter().any(|gate| opens(line, gate))) {
            return true;
        }
        let depth = indent(lines[at]);
        let above = lines[..at].iter().rposition(|line| !line.trim().is_empty() && indent(line) < depth);
        match above {
            Some(above) => at = above,
            None => return false,
        }
    }
}

#[test]
fn gates_are_found() {
    let text = "#[cfg(unix)]\nfn a() {\n    use std::os::unix::x;\n\n    if y {\n        b();\n    }\n}\n\
                fn b() {\n    #[cfg(not(unix))]\n    use std::os::unix::x;\n    #[doc(hidden)]\n    #[cfg(unix)]\n    c();\n    d();\n}\n";
    let found: Vec<usize> = (1..=text.lines().count()).filter(|&n| is_gated(text, n, &["unix"])).collect();
    // The gate itself is no part of what it gates; blank lines stand in nothing.
    assert_eq!(found.iter().copied().filter(|n| [3, 6, 11, 14, 15].contains(n)).collect::<Vec<_>>(), [3, 6, 14]);
}
