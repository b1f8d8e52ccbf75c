//! Help texts, manual pages, and what shells complete.

use std::process::{Command, Stdio};

use crate::support::server::meshsnap;
use crate::support::skip::{Need, skip};

fn text_of(arguments: &[&str]) -> String {
    let output = meshsnap().args(arguments).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{arguments:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The commands that `--help` lists, but for `help`.
fn commands() -> Vec<String> {
    let help = text_of(&["--help"]);
    let (_, list) = help.split_once("Commands:\n").unwrap();
    let lines = list.lines().take_while(|line| line.starts_with("  "));
    let names: Vec<String> = lines.filter_map(|line| line.split_whitespace().next().map(str::to_owned)).collect();
    assert!(names.len() >= 10 && names.last().is_some_and(|name| name == "help"), "{help}");
    names.into_iter().filter(|name| name != "help").collect()
}

#[test]
fn help_fits_in_100_columns_and_its_short_form_on_a_screen() {
    for command in &commands() {
        let (short, long) = (text_of(&[command, "-h"]), text_of(&[command, "--help"]));
        for line in short.lines().chain(long.lines()) {
            assert!(line.chars().count() <= 100, "{command}: {line}");
        }
        assert!(short.lines().count() <= 40, "{command}: {} lines", short.lines().count());
    }
    for command in ["render", "inspect", "check", "diff", "serve"] {
        let (short, long) = (text_of(&[command, "-h"]), text_of(&[command, "--help"]));
        assert!(long.contains("\nExamples:\n  meshsnap ") && !short.contains("Examples:"), "{command}");
        assert!(long.lines().count() > 2 * short.lines().count(), "{command}");
    }
    assert!(text_of(&["serve", "--help"]).contains("MESHSNAP_API_KEYS"));
    assert!(text_of(&["render", "--help"]).contains("\nPicture:\n"));
}

#[test]
fn manual_pages_have_every_flag() {
    for command in commands().iter().filter(|&command| command != "man") {
        let page = text_of(&["man", command]);
        assert!(page.contains(&format!(".TH MESHSNAP-{} 1", command.to_uppercase())), "{command}");
        let help = text_of(&[command, "--help"]);
        let flags = help.split_whitespace().filter_map(|word| word.strip_prefix("--")).filter(|flag| flag.len() > 1);
        for flag in flags.filter(|flag| flag.chars().all(|c| c.is_ascii_lowercase() || c == '-')) {
            // Hyphens are escaped in pages.
            let escaped = format!("\\-\\-{}", flag.replace('-', "\\-"));
            assert!(page.contains(&escaped), "{command} has no --{flag}");
        }
    }
    assert!(text_of(&["man"]).contains(".TH MESHSNAP 1"));
}

/// A command line whose last word is to be completed, and some of what must be offered.
const COMPLETED: &[(&str, &[&str])] = &[
    ("meshsnap rend", &["render"]),
    ("meshsnap render --style wi", &["wire", "wireframe"]),
    ("meshsnap render --view ", &["front", "iso"]),
    ("meshsnap render --format ", &["png", "webp", "jpeg"]),
    ("meshsnap render --backend ", &["auto", "gpu", "cpu"]),
    ("meshsnap inspect --format-in ", &["obj", "3mf"]),
    ("meshsnap check --format ", &["text", "jsonl"]),
    ("meshsnap serve --log-format ", &["json"]),
];

#[test]
fn shells_complete_values() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("wire.png"), "").unwrap();
    for shell in ["bash", "fish"] {
        let script = directory.path().join(shell);
        std::fs::write(&script, text_of(&["completions", shell])).unwrap();
        for (line, expected) in COMPLETED {
            let program = match shell {
                "bash" => format!(
                    "source '{}'; read -ra COMP_WORDS <<< '{line}'; [[ '{line}' == *' ' ]] && COMP_WORDS+=(''); \
                     COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _meshsnap meshsnap \"${{COMP_WORDS[-1]}}\" \
                     \"${{COMP_WORDS[-2]}}\"; printf '%s\\n' \"${{COMPREPLY[@]}}\"",
                    script.display()
                ),
                _ => format!("source '{}'; complete -C '{line}'", script.display()),
            };
            let mut command = Command::new(shell);
            command.current_dir(&directory).args(["-c", &program]).stdin(Stdio::null()).stderr(Stdio::null());
            let Ok(output) = command.output() else {
                skip(Need::Shell, shell);
                break;
            };
            let offered = String::from_utf8(output.stdout).unwrap();
            let words: Vec<&str> = offered.lines().filter_map(|line| line.split_whitespace().next()).collect();
            assert!(expected.iter().all(|word| words.contains(word)), "{shell}: {line}: {offered}");
            assert!(!words.contains(&"wire.png"), "{shell}: {line} offers files");
        }
    }
}

/// zsh completes on a terminal only, so that it gets one.
#[test]
fn zsh_completes_values() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("_meshsnap"), text_of(&["completions", "zsh"])).unwrap();
    let program = "zmodload zsh/zpty; zpty z zsh -f -i
        zpty -w z \"PS1=; fpath=($PWD \\$fpath); autoload -U compinit; compinit -u -D; echo rea\\dy\"
        zpty -r -m z line '*ready*'
        zpty -w -n z $'meshsnap render --backend \\t\\t'
        zpty -r -m z line '*auto*cpu*gpu*' && print -r -- \"$line\"
        zpty -d z";
    let mut command = Command::new("zsh");
    command.current_dir(&directory).args(["-f", "-c", program]).stdin(Stdio::null()).stderr(Stdio::null());
    let Ok(output) = command.output() else { return skip(Need::Shell, "zsh") };
    let offered = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(["auto", "cpu", "gpu"].iter().all(|word| offered.contains(word)), "{offered}");
}
