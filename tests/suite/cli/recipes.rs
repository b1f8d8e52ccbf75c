//! The recipes of docs/ci, as far as they run without a code host.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use super::baseline::{git, git_command};
use super::check::folder;
use crate::support::server::{CUBE_OBJ, meshsnap};
use crate::support::skip::{Need, skip};

fn recipe(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/ci").join(name)
}

/// The search path, with the program first.
fn path() -> String {
    let program = PathBuf::from(meshsnap().get_program());
    format!("{}:{}", program.parent().unwrap().display(), std::env::var("PATH").unwrap())
}

#[test]
fn the_step_of_the_action_writes_reports_and_a_code() {
    let folder = folder();
    git(folder.path(), &["init", "-q"]);
    git(folder.path(), &["add", "."]);
    git(folder.path(), &["commit", "-qm", "first"]);
    fs::write(folder.path().join("meshsnap.toml"), "[check]\nrules = [\"opens\", \"watertight\"]\n").unwrap();
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n";
    fs::write(folder.path().join("parts/a b.obj"), pointer).unwrap();
    let run = |paths: &str, since: &str| -> (Output, String, String) {
        let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap_or_default();
        ["summary", "outputs"].iter().for_each(|name| drop(fs::remove_file(folder.path().join(name))));
        let mut command = Command::new("bash");
        command.arg(recipe("github/check.sh")).current_dir(folder.path()).env("PATH", path()).stdin(Stdio::null());
        command.env("MESHSNAP_PATHS", paths).env("MESHSNAP_SINCE", since);
        command.env("GITHUB_STEP_SUMMARY", "summary").env("GITHUB_OUTPUT", "outputs");
        (command.output().unwrap(), read("summary"), read("outputs"))
    };
    let (output, summary, outputs) = run("parts\n", "");
    assert!(output.status.success(), "{output:?}");
    assert!(
        summary.starts_with("### meshsnap check: 2 of 3 files failed\n") && summary.contains("Git LFS"),
        "{summary}"
    );
    assert_eq!(outputs, "code=1\n");
    for report in ["junit.xml", "faults.sarif", "comment.md", "page.html"] {
        assert!(folder.path().join("meshsnap-reports").join(report).exists(), "{report}");
    }
    let (_, summary, outputs) = run("parts/a b.obj\nparts/good.obj", "HEAD");
    assert!(summary.starts_with("### meshsnap check: 1 of 1 file failed\n"), "{summary}");
    assert_eq!(outputs, "code=1\n");
    // No input is a command or an option, and a mistake fails the step.
    for (paths, since) in [("$(touch x)", ""), ("--help", ""), ("parts", "--output=x"), ("parts", "$(touch x)")] {
        let (output, _, outputs) = run(paths, since);
        assert!(!output.status.success() || outputs == "code=1\n", "{paths} {since}: {outputs}");
    }
    assert!(!folder.path().join("x").exists());
}

#[test]
fn the_hook_refuses_a_commit_with_a_fault() {
    let folder = folder();
    git(folder.path(), &["init", "-q"]);
    let hook = folder.path().join(".git/hooks/pre-commit");
    fs::create_dir_all(hook.parent().unwrap()).unwrap();
    fs::copy(recipe("pre-commit"), &hook).unwrap();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        fs::set_permissions(&hook, fs::Permissions::from_mode(0o755)).unwrap();
    }
    fs::write(folder.path().join("meshsnap.toml"), "[check]\nrules = [\"watertight\"]\n").unwrap();
    let commit = |files: &[&str]| {
        git(folder.path(), &[&["add", "--"], files].concat());
        let output = git_command(folder.path(), &["commit", "-qm", "a"]).env("PATH", path()).output().unwrap();
        (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    // Nothing to check, and a mesh that is ok.
    assert!(commit(&["meshsnap.toml"]).0);
    fs::write(folder.path().join("parts/a name.obj"), CUBE_OBJ).unwrap();
    let (is_done, said) = commit(&["parts/a name.obj", "parts/good.obj"]);
    assert!(is_done && said.contains("2 ok, 0 failed"), "{said}");
    let (is_done, said) = commit(&["parts/hole.obj"]);
    assert!(!is_done && said.contains("0 ok, 1 failed"), "{said}");
}

#[test]
fn the_workflows_name_what_the_program_has() {
    // Options of the recipes, whose YAML is read by the code hosts alone.
    let options = ["--junit", "--sarif", "--markdown", "--html", "--since"];
    let help = meshsnap().args(["check", "--help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    for name in ["github/check.sh", "gitlab.yml"] {
        let text = fs::read_to_string(recipe(name)).unwrap();
        let used: Vec<&str> = text
            .split(|c: char| !(c.is_ascii_lowercase() || c == '-'))
            .filter(|word| word.starts_with("--") && word.len() > 2)
            .collect();
        assert!(
            used.len() >= 3 && used.iter().all(|word| options.contains(word) && help.contains(word)),
            "{name}: {used:?}"
        );
    }
    // What a pull request chooses goes through the environment, never into a command.
    for name in ["github/action.yml", "github/check.yml", "github/comment.yml"] {
        let text = fs::read_to_string(recipe(name)).unwrap();
        let in_scripts =
            text.lines().filter(|line| line.trim_start().starts_with("run: ") || line.starts_with("          "));
        assert!(in_scripts.clone().all(|line| !line.contains("${{") || line.contains(": ${{")), "{name}");
    }
}

/// A tool of `target/python`. None, and the test counts as skipped, where it is missing.
fn tool(name: &str) -> Option<Command> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/python/bin").join(name);
    if !path.is_file() {
        skip(Need::Python, &format!("{name} in target/python"));
        return None;
    }
    Some(Command::new(path))
}

#[track_caller]
fn passes(command: &mut Command) {
    let output = command.output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&said));
}

#[test]
fn the_recipes_are_valid_by_the_schemas_of_the_code_hosts() {
    let workflows = ["github/check.yml", "github/comment.yml"];
    let kinds: [(&[&str], &[&str]); 3] = [
        (&["vendor.github-workflows"], &workflows),
        (&["vendor.github-actions"], &["github/action.yml"]),
        (&["vendor.gitlab-ci", "--data-transform", "gitlab-ci"], &["gitlab.yml"]),
    ];
    let mut checked = 0;
    for (schema, names) in kinds {
        let Some(mut command) = tool("check-jsonschema") else { return };
        passes(command.arg("--builtin-schema").args(schema).args(names.iter().map(|name| recipe(name))));
        checked += names.len();
    }
    assert_eq!(checked, 4);
    // The schema refuses what is wrong.
    let folder = tempfile::tempdir().unwrap();
    let wrong = folder.path().join("action.yml");
    let action = fs::read_to_string(recipe("github/action.yml")).unwrap();
    fs::write(&wrong, action.replace("using: composite", "using: anything")).unwrap();
    let Some(mut command) = tool("check-jsonschema") else { return };
    let refused = command.args(["--builtin-schema", "vendor.github-actions"]).arg(&wrong).output().unwrap();
    assert_eq!(refused.status.code(), Some(1), "{refused:?}");
}

#[test]
fn the_scripts_have_no_fault_that_shellcheck_knows() {
    let Some(mut command) = tool("shellcheck") else { return };
    passes(command.arg(recipe("github/check.sh")).arg(recipe("pre-commit")));
    // The scripts within the action.
    let action = fs::read_to_string(recipe("github/action.yml")).unwrap();
    let lines = action.lines().filter_map(|line| line.trim().strip_prefix("run: "));
    let script: String = lines.map(|line| format!("{line}\n")).collect();
    assert_eq!(script.lines().count(), 3, "{script}");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("action.sh");
    fs::write(&file, format!("#!/bin/bash\n{script}")).unwrap();
    let Some(mut command) = tool("shellcheck") else { return };
    passes(command.arg(&file));
    fs::write(&file, format!("#!/bin/bash\n{}", comment_step())).unwrap();
    let Some(mut command) = tool("shellcheck") else { return };
    passes(command.arg(&file));
}

/// The script of the workflow that comments.
fn comment_step() -> String {
    let text = fs::read_to_string(recipe("github/comment.yml")).unwrap();
    let (_, script) = text.split_once("        run: |\n").unwrap();
    script.lines().map(|line| line.strip_prefix("          ").unwrap().to_owned() + "\n").collect()
}

/// The step with a stand-in for `gh`, which has one pull request and remembers its comment.
#[test]
fn a_pull_request_has_one_comment_which_is_updated() {
    let folder = tempfile::tempdir().unwrap();
    let path_of = |name: &str| folder.path().join(name);
    let gh = "#!/bin/bash\nset -eu\necho \"$*\" >> calls\ncase \"$*\" in\n\
              'run download 5 --repo o/r --name meshsnap --dir reports') mkdir -p reports; cp table.md reports/comment.md ;;\n\
              *'repos/o/r/pulls'*'head=you:topic'*) cat number ;;\n\
              *--paginate*issues/7/comments*) if [ -e body ]; then echo 11; fi ;;\n\
              *POST*issues/7/comments*|*PATCH*issues/comments/11*) cp body.md body ;;\n\
              *) exit 9 ;;\nesac\n";
    fs::create_dir(path_of("bin")).unwrap();
    fs::write(path_of("bin/gh"), gh).unwrap();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        fs::set_permissions(path_of("bin/gh"), fs::Permissions::from_mode(0o755)).unwrap();
    }
    fs::write(path_of("step.sh"), comment_step()).unwrap();
    let run = |table: &str, number: &str| {
        fs::write(path_of("table.md"), table).unwrap();
        fs::write(path_of("number"), number).unwrap();
        fs::remove_file(path_of("calls")).ok();
        let mut command = Command::new("bash");
        command.arg("step.sh").current_dir(folder.path()).stdin(Stdio::null());
        command.env("PATH", format!("{}:{}", path_of("bin").display(), path()));
        let of_event = [("REPOSITORY", "o/r"), ("RUN", "5"), ("HEAD_OWNER", "you"), ("HEAD_BRANCH", "topic")];
        passes(command.envs(of_event));
        let calls = fs::read_to_string(path_of("calls")).unwrap();
        let body = fs::read_to_string(path_of("body")).unwrap_or_default();
        (calls.matches("POST").count(), calls.matches("PATCH").count(), body)
    };
    assert_eq!(run("table", ""), (0, 0, String::new()), "no pull request is open");
    assert_eq!(run("table 1", "7\n"), (1, 0, "<!-- meshsnap -->\ntable 1".to_owned()));
    assert_eq!(run("table 2", "7\n"), (0, 1, "<!-- meshsnap -->\ntable 2".to_owned()));
    // A table that is too long for a comment is cut.
    let (_, _, body) = run(&"x".repeat(70_000), "7\n");
    assert_eq!(body.len(), 60_000 + "<!-- meshsnap -->\n".len());
}
