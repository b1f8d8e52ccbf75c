//! HTML pages in headless Chromium, checked for accessibility by axe-core, at two widths, light and
//! dark: the reports of `meshsnap check`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use super::super::check::{check, folder};
use crate::http::page::browser_and;

/// Widths of a phone and of a desk.
const WIDTHS_PX: [u32; 2] = [500, 1280];

/// Runs axe, and leaves what it found in the page.
const SCRIPT: &str = "axe.run(document, { resultTypes: ['violations'] }).then((result) => {
  const found = document.createElement('script');
  found.type = 'application/json';
  const nodes = (one) => one.nodes.map((node) => node.html.slice(0, 200) + ' ' + node.failureSummary);
  found.textContent = JSON.stringify({
    violations: result.violations.map((one) => [one.id, ...nodes(one)]),
    passes: result.passes.map((one) => one.id),
    dark: matchMedia('(prefers-color-scheme: dark)').matches,
    width: innerWidth,
    overflow: document.documentElement.scrollWidth - innerWidth,
  }).replaceAll('<', '\\\\u003c');
  found.id = 'axe-found';
  document.body.append(found);
});";

/// The browser and the source of axe-core. None, and the test counts as skipped, where one is missing.
fn tools() -> Option<(PathBuf, String)> {
    let (browser, modules) = browser_and("axe-core")?;
    Some((browser, fs::read_to_string(modules.join("axe-core/axe.min.js")).unwrap()))
}

/// A page as the browser has it after its scripts have run.
fn opened(browser: &Path, page: &str, width_px: u32, is_dark: bool) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("page.html");
    fs::write(&file, page).unwrap();
    let mut command = Command::new(browser);
    command.args(["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-dev-shm-usage"]);
    command.args(["--hide-scrollbars", "--virtual-time-budget=30000", "--dump-dom"]);
    command.arg(format!("--window-size={width_px},900")).arg(format!("--user-data-dir={}", folder.path().display()));
    command.arg(format!("--blink-settings=preferredColorScheme={}", if is_dark { 0 } else { 1 }));
    let output = command.arg(format!("file://{}", file.display())).stdin(Stdio::null()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// What axe finds of a page.
fn found(browser: &Path, axe: &str, page: &str, width_px: u32, is_dark: bool) -> Value {
    let body = page.strip_suffix("</html>\n").unwrap_or(page);
    let body = body.strip_suffix("</body>\n").unwrap_or(body);
    let with_axe = format!("{body}<script>{axe}</script><script>{SCRIPT}</script></body></html>");
    let opened = opened(browser, &with_axe, width_px, is_dark);
    let start = "id=\"axe-found\">";
    let at = opened.find(start).unwrap_or_else(|| panic!("axe has not run: {}", &opened[..opened.len().min(2000)]));
    let text = &opened[at + start.len()..];
    serde_json::from_str(&text[..text.find("</script>").unwrap()]).unwrap()
}

/// Pages with all that pages can have: faults of each kind, places, pictures, what has changed.
fn pages() -> Vec<(&'static str, String)> {
    let folder = folder();
    let run = |words: &[&str]| {
        let (_, _, said) = check(folder.path(), &[words, &["--html", "page.html"]].concat());
        fs::read_to_string(folder.path().join("page.html")).unwrap_or_else(|error| panic!("{error}: {said}"))
    };
    let views = ["parts", "--views", "iso,front", "--baseline", "known"];
    run(&[&views[..], &["--rules", "watertight", "--update"]].concat());
    let good = fs::read(folder.path().join("parts/good.obj")).unwrap();
    fs::write(folder.path().join("parts/hole.obj"), [&good[..], b"v 3 3 3\nf 1 2 9\n"].concat()).unwrap();
    let rules = ["broken.stl", "--rules", "watertight,opens", "--warn", "has-uv"];
    let changed = run(&[&views[..], &rules].concat());
    for part in ["Blink", "difference", ">places</summary>", "class=\"error\"", "class=\"warning\""] {
        let part = part.trim_start_matches('>');
        assert!(changed.contains(part), "{part}: {changed}");
    }
    let ok = run(&["parts/good.obj", "--rules", "watertight"]);
    vec![("what has changed", changed), ("no fault", ok)]
}

#[test]
fn pages_have_no_fault_of_accessibility() {
    let Some((browser, axe)) = tools() else { return };
    let mut count = 0;
    for (name, page) in pages() {
        for (width_px, is_dark) in WIDTHS_PX.into_iter().flat_map(|width_px| [(width_px, false), (width_px, true)]) {
            let found = found(&browser, &axe, &page, width_px, is_dark);
            let at = format!("{name}, {width_px} px, {}", if is_dark { "dark" } else { "light" });
            assert_eq!(found["violations"], serde_json::json!([]), "{at}");
            assert_eq!((&found["dark"], &found["width"]), (&is_dark.into(), &width_px.into()), "{at}");
            assert!(found["passes"].as_array().unwrap().len() > 10, "{at}: {found}");
            // Nothing but tables scrolls sideways.
            assert!(found["overflow"].as_i64().unwrap() <= 0, "{at}: {found}");
            count += 1;
        }
        // axe finds faults where there are some.
        let wrong = page.replace(" lang=\"en\"", "");
        let found = found(&browser, &axe, &wrong, WIDTHS_PX[0], false);
        assert_eq!(found["violations"][0][0], "html-has-lang", "{found}");
    }
    assert_eq!(count, 8);
}
