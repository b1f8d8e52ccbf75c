//! The command line: what it prints, writes and returns.

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::support::server::{CUBE_OBJ, Server, meshsnap};
use crate::support::skip::{Need, skip};

fn run(arguments: &[&str], stdin: &[u8]) -> Output {
    let mut command = meshsnap();
    command.args(arguments);
    output_of(command, stdin)
}

fn output_of(mut command: Command, stdin: &[u8]) -> Output {
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // A command that fails early closes its input; that is its right.
    let _ = child.stdin.take().unwrap().write_all(stdin);
    child.wait_with_output().unwrap()
}

/// Runs, checks the exit code and that failures are one sentence, and returns standard error.
#[track_caller]
fn fails(arguments: &[&str], stdin: &[u8], code: i32) -> String {
    let output = run(arguments, stdin);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
    assert!(output.stdout.is_empty(), "{arguments:?} wrote to standard output");
    if code != 2 {
        assert_eq!(stderr.lines().count(), 1, "{arguments:?}: {stderr}");
    }
    stderr
}

#[test]
fn render_reads_and_writes_standard_streams() {
    let output = run(&["render", "-", "-o", "-", "--size", "40x30", "--backend", "cpu"], CUBE_OBJ);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty());
    let picture = image::load_from_memory_with_format(&output.stdout, image::ImageFormat::Png).unwrap();
    assert_eq!((picture.width(), picture.height()), (40, 30));
}

#[test]
fn the_extension_chooses_the_format_and_a_flag_overrides_it() {
    let directory = tempfile::tempdir().unwrap();
    let mesh = directory.path().join("cube.obj");
    std::fs::write(&mesh, CUBE_OBJ).unwrap();
    let cases = [
        ("a.png", None, image::ImageFormat::Png),
        ("a.webp", None, image::ImageFormat::WebP),
        ("a.jpg", None, image::ImageFormat::Jpeg),
        ("a.JPEG", None, image::ImageFormat::Jpeg),
        ("a", None, image::ImageFormat::Png),
        ("a.png", Some("webp"), image::ImageFormat::WebP),
        ("a.bin", Some("jpeg"), image::ImageFormat::Jpeg),
    ];
    for (name, format, expected) in cases {
        let out = directory.path().join(name);
        let mut arguments = vec!["render", mesh.to_str().unwrap(), "-o", out.to_str().unwrap(), "--size", "16"];
        arguments.extend(format.iter().flat_map(|f| ["--format", f]));
        let output = run(&arguments, b"");
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(image::guess_format(&std::fs::read(&out).unwrap()).unwrap(), expected, "{name} {format:?}");
    }
}

#[test]
fn render_and_http_draw_the_same_bytes() {
    let server = Server::start(&[]);
    let query = "style=wire&size=64&wire.color=%23f00&up=z&view=left&background=transparent";
    let over_http = server.post(&format!("/v1/render?{query}"), CUBE_OBJ);
    let arguments = "render - -o - --backend cpu --style wire --size 64 --set wire.color=#f00 --up z --view left \
                     --background transparent";
    let output = run(&arguments.split_whitespace().collect::<Vec<_>>(), CUBE_OBJ);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.stdout, over_http.body);
}

#[test]
fn a_request_file_is_overridden_by_flags_and_those_by_set() {
    let directory = tempfile::tempdir().unwrap();
    let request = directory.path().join("r.json");
    std::fs::write(&request, br#"{"style":"wire","image":{"width":20,"height":10}}"#).unwrap();
    let request = request.to_str().unwrap();
    let size = |more: &[&str]| {
        let arguments = [&["render", "-", "-o", "-", "--backend", "cpu", "--request", request], more].concat();
        let output = run(&arguments, CUBE_OBJ);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let picture = image::load_from_memory(&output.stdout).unwrap();
        (picture.width(), picture.height())
    };
    assert_eq!(size(&[]), (20, 10));
    assert_eq!(size(&["--size", "30"]), (30, 30));
    assert_eq!(size(&["--set", "image.width=5", "--size", "30"]), (5, 30));
}

#[test]
fn a_section_can_be_set_as_json_and_later_flags_override_earlier_ones() {
    let draw = |more: &[&str]| {
        let arguments = [&["render", "-", "-o", "-", "--size", "48", "--backend", "cpu"], more].concat();
        let output = run(&arguments, CUBE_OBJ);
        assert!(output.status.success(), "{more:?}: {}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    let plain = draw(&[]);
    let same: [[&[&str]; 2]; 5] = [
        [
            &["--set", r#"outline={"thickness":8,"unit":"px"}"#],
            &["--set", "outline.thickness=8", "--set", "outline.unit=px"],
        ],
        [&["--set", r##"wire= {"color":"#f00"} "##], &["--set", "wire.color=#f00"]],
        [
            &["--set", r#"camera={"eye":[3,2,1],"target":[0,0,0]}"#],
            &["--set", "camera.eye=3,2,1", "--set", "camera.target=0,0,0"],
        ],
        [&["--set", r#"materials={"default":{"wire":{}}}"#], &["--set", "materials.default.wire={}"]],
        [&["--style", "flat", "--set", "style=smooth", "--set", "style=wire"], &["--style", "wire"]],
    ];
    for [left, right] in same {
        assert!(draw(left) == draw(right), "{left:?} is not {right:?}");
        assert!(draw(left) != plain || left[1].starts_with("materials"), "{left:?} does nothing");
    }
    assert_eq!(same.len(), 5);
    let webp = draw(&["--set", r#"image={"format":"webp"}"#]);
    assert_eq!(image::guess_format(&webp).unwrap(), image::ImageFormat::WebP);
}

#[test]
fn failures_are_one_sentence_with_the_right_exit_code() {
    let directory = tempfile::tempdir().unwrap();
    let nowhere = directory.path().join("no/such/out.png");
    let nowhere = nowhere.to_str().unwrap();
    let cases: &[(&[&str], &[u8], i32, &str)] = &[
        (&["render", "missing.obj", "-o", "-"], b"", 1, "missing.obj"),
        (&["render", "-", "-o", "-"], b"", 1, "empty"),
        (&["render", "-", "-o", "-"], b"not a mesh at all", 1, "-:"),
        (&["render", "-", "-o", "-", "--size", "0"], CUBE_OBJ, 2, "--size"),
        (&["render", "-", "-o", "-", "--set", "wire.colour=#f00"], CUBE_OBJ, 2, "wire.color"),
        (&["render", "-", "-o", "-", "--request", "missing.json"], CUBE_OBJ, 1, "missing.json"),
        (&["render", "-", "-o", "-", "--limit-triangles", "3"], CUBE_OBJ, 1, "--limit-triangles"),
        (&["render", "-", "-o", "-", "--limit-memory-bytes", "100"], CUBE_OBJ, 1, "--limit-memory-bytes"),
        (&["render", "-", "-o", nowhere, "--size", "8"], CUBE_OBJ, 2, "out.png"),
        (&["render", "-", "-o", "out.bmp"], CUBE_OBJ, 2, "bmp"),
        (&["render", "-", "-o", "-", "--set", "wire"], CUBE_OBJ, 2, "KEY=VALUE"),
        (&["render", "-", "-o", "-", "--set", "wire=on"], CUBE_OBJ, 2, "one key alone is wire.KEY=VALUE"),
        (&["render", "-", "-o", "-", "--set", "wire={thickness:8}"], CUBE_OBJ, 2, "not JSON at line 1, column 2"),
        (&["render", "-", "-o", "-", "--set", "wire={\"lit\":1}"], CUBE_OBJ, 2, "`wire.lit` is 1"),
        (&["inspect", "-", "--set", "size=8"], CUBE_OBJ, 2, "scene.time_s"),
        (&["inspect", "-", "--set", "scene.time_s=-1"], CUBE_OBJ, 2, "`scene.time_s`"),
        (&["render", "-", "-o", "-", "--format-in", "dae"], CUBE_OBJ, 2, "obj"),
        (&["render", "-", "-", "-o", "-"], b"", 2, "once"),
        (&["render"], b"", 2, "MESH"),
        (&["render", "-", "-o", "-", "--sise", "8"], b"", 2, "--size"),
        (&["draw"], b"", 2, "draw"),
        (&["inspect", "-"], b"\0\0\0", 1, "-:"),
        (&["serve", "--workers", "0"], b"", 2, "from 1 to 1024"),
        (&["serve", "--listen", "0.0.0.0:0"], b"", 2, "--no-auth"),
        (&["serve", "--listen", "[::]:0"], b"", 2, "MESHSNAP_API_KEYS"),
        (&["serve", "--listen", "nonsense"], b"", 2, "nonsense"),
        (&["serve", "--config", "missing.toml"], b"", 2, "missing.toml"),
        (&["serve", "--log", "a=b=c"], b"", 2, "filter"),
        (&["health", "http://127.0.0.1:1"], b"", 1, "127.0.0.1:1"),
    ];
    for (arguments, stdin, code, part) in cases {
        let stderr = fails(arguments, stdin, *code);
        assert!(stderr.contains(part), "{arguments:?}: {stderr}");
    }
    assert_eq!(cases.len(), 29);
    assert!(!Path::new(nowhere).exists());
}

#[test]
fn the_number_of_threads_has_bounds() {
    for (threads, code) in [("0", 2), ("1", 0), ("3", 0), ("1025", 2), ("-1", 2)] {
        let output = run(&["render", "-", "-o", "-", "--size", "8", "--threads", threads], CUBE_OBJ);
        assert_eq!(output.status.code(), Some(code), "{threads}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn inspect_says_what_is_in_the_file() {
    let output = run(&["inspect", "-", "--json"], CUBE_OBJ);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["format"], "obj");
    assert_eq!((report["triangles"].as_u64(), report["polygons"].as_u64()), (Some(12), Some(6)));
    assert_eq!(report["positions"], 8);
    assert_eq!(report["bounds"]["min"], serde_json::json!([-1.0, -1.0, -1.0]));
    assert_eq!(report["bounds"]["size"], serde_json::json!([2.0, 2.0, 2.0]));
    let topology = &report["topology"];
    assert_eq!((topology["is_watertight"].as_bool(), topology["open_edges"].as_u64()), (Some(true), Some(0)));
    assert_eq!((topology["components"].as_u64(), topology["euler_characteristic"].as_i64()), (Some(1), Some(2)));
    let open = run(&["inspect", "-"], b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let open = String::from_utf8(open.stdout).unwrap();
    assert!(open.contains("3 edges: 3 open"), "{open}");
    let text = run(&["inspect", "-"], CUBE_OBJ);
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(text.contains("triangles") && text.contains("6 x 4"), "{text}");
    let charts = run(&["inspect", "-", "--uv"], b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n");
    let charts = String::from_utf8(charts.stdout).unwrap();
    assert!(
        charts.contains("charts       1, 50.0 % of the texture's area, stretch 1.000 (L2), 1.000 (Linf)"),
        "{charts}"
    );
}

#[test]
fn inspect_reports_on_many_meshes_by_lines() {
    let folder = super::check::folder();
    let inspect = |arguments: &[&str]| {
        let mut command = meshsnap();
        command.current_dir(folder.path()).arg("inspect").args(arguments).stdin(Stdio::null());
        let output = command.output().unwrap();
        let lines = String::from_utf8(output.stdout).unwrap();
        let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        (output.status.code(), lines, String::from_utf8(output.stderr).unwrap())
    };
    let (code, lines, stderr) =
        inspect(&["parts", "broken.stl", "absent.obj", "colored.obj", "colored.mtl", "--jsonl"]);
    assert_eq!(code, Some(1), "{stderr}");
    let paths: Vec<&str> = lines.iter().map(|line| line["path"].as_str().unwrap()).collect();
    assert_eq!(paths, ["absent.obj", "broken.stl", "colored.obj", "parts/good.obj", "parts/hole.obj"]);
    let errors: Vec<bool> = lines.iter().map(|line| line["error"].is_string()).collect();
    assert_eq!(errors, [true, true, false, false, false]);
    assert_eq!(lines[0], serde_json::json!({ "path": "absent.obj", "error": "there is no such file" }));
    // Its library was read, or there were a warning.
    assert_eq!(lines[2]["warnings"], serde_json::json!([]));
    assert_eq!((&lines[3]["triangles"], &lines[4]["topology"]["open_edges"]), (&12.into(), &4.into()));
    assert!(lines[3].get("uv").is_none() && stderr.contains("meshsnap: broken.stl: "), "{stderr}");
    // The report of one mesh is that of --json, with its path.
    let alone = run(&["inspect", "-", "--json", "--uv", "--parts"], CUBE_OBJ);
    let mut alone: Value = serde_json::from_slice(&alone.stdout).unwrap();
    alone["path"] = "parts/good.obj".into();
    let (code, lines, _) = inspect(&["parts/good.obj", "--jsonl", "--uv", "--parts"]);
    assert_eq!((code, lines), (Some(0), vec![alone]));
    assert_eq!(inspect(&["parts", "--jsonl", "--json"]).0, Some(2));
}

#[test]
fn explain_tells_what_was_skipped_and_how_long_it_took() {
    let arguments = ["render", "-", "-o", "-", "--size", "16", "--style", "flat", "--backend", "cpu", "--explain"];
    let output = run(&arguments, CUBE_OBJ);
    let stderr = String::from_utf8(output.stderr).unwrap();
    for part in ["drawn by cpu", "gpu: no", "read", "parse", "plan", "render", "visibility", "shade", "encode", "total"]
    {
        assert!(stderr.contains(part), "{part}: {stderr}");
    }
    assert!(stderr.contains("skipped "), "{stderr}");
}

#[test]
fn explain_counts_mixed_pixels() {
    let explained = |more: &[&str]| {
        let arguments = ["render", "-", "-o", "-", "--size", "64", "--samples", "adaptive", "--explain", "--style"];
        let output = run(&[&arguments[..], more].concat(), CUBE_OBJ);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let flat = explained(&["flat"]);
    let line = flat.lines().find(|line| line.starts_with("mixed pixels, drawn from 64 or 256 points each")).unwrap();
    let count: u32 = line.rsplit(' ').next().unwrap().parse().unwrap();
    assert!((100..2000).contains(&count), "{line}");
    assert!(flat.contains("drawn by cpu") && flat.contains("mixed "), "{flat}");
    assert!(explained(&["wire"]).contains("mixed pixels"));
    let frame = explained(&["wireframe"]);
    assert!(!frame.contains("mixed pixels"), "{frame}");
    assert!(frame.contains("warning: image.samples is adaptive, and no face is filled"), "{frame}");
}

/// Drivers look for a display where nothing tells them not to, and complain on standard error.
#[test]
fn a_gpu_without_a_display_is_no_complaint() {
    for folder in [None, Some(""), Some("relative")] {
        let mut command = meshsnap();
        for name in ["XDG_RUNTIME_DIR", "WAYLAND_DISPLAY", "DISPLAY", "NODEVICE_SELECT", "MESA_VK_DEVICE_SELECT"] {
            command.env_remove(name);
        }
        command.envs(folder.map(|folder| ("XDG_RUNTIME_DIR", folder)));
        command.args(["render", "-", "--backend", "gpu", "--size", "16", "-o", "-"]);
        let output = output_of(command, CUBE_OBJ);
        let said = String::from_utf8(output.stderr).unwrap();
        if said.contains("there is no GPU to draw on") {
            skip(Need::Gpu, "Vulkan");
            return;
        }
        assert!(output.status.success() && said.is_empty(), "{folder:?}: {said}");
    }
}

/// What a driver makes of shaders is kept, and read again; damage costs time and nothing else.
#[test]
fn kept_shaders_change_no_picture() {
    let folder = std::env::temp_dir().join(format!("meshsnap-shaders-{}", std::process::id()));
    let cache_dir = folder.to_str().unwrap();
    let draw = || {
        run(
            &["render", "-", "--backend", "gpu", "--size", "32", "--cache-dir", cache_dir, "--explain", "-o", "-"],
            CUBE_OBJ,
        )
    };
    let first = draw();
    let said = String::from_utf8(first.stderr).unwrap();
    if said.contains("there is no GPU to draw on") {
        skip(Need::Gpu, "Vulkan");
        return;
    }
    assert!(first.status.success() && said.contains("drawn by gpu"), "{said}");
    for stage in ["  transform", "  visibility", "  shade", "  resolve"] {
        assert!(said.contains(stage), "{stage}: {said}");
    }
    let files: Vec<_> =
        std::fs::read_dir(&folder).map(|all| all.map(|file| file.unwrap().path()).collect()).unwrap_or_default();
    assert_eq!(files.len(), 1, "{files:?}");
    assert!(draw().stdout == first.stdout, "the second start draws another picture");
    for file in &files {
        let mut bytes = std::fs::read(file).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        std::fs::write(file, &bytes).unwrap();
        assert!(draw().stdout == first.stdout, "a damaged file changes the picture");
        assert_ne!(std::fs::read(file).unwrap(), bytes, "a damaged file stays");
    }
    let _ = std::fs::remove_dir_all(&folder);
}

#[test]
fn health_and_settings_from_everywhere() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("meshsnap.toml");
    std::fs::write(&file, "limit-triangles = 11\nlimit-nodes = 12\nlimit_image_px = 13\nworkers = 1\n").unwrap();
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--limit-triangles", "31", "--config"]).arg(&file);
    command.env("MESHSNAP_LIMIT_TRIANGLES", "21").env("MESHSNAP_LIMIT_NODES", "22").env("MESHSNAP_DATA_DIR", "");
    let server = Server::start_with(&mut command);
    let limits = server.get("/v1/capabilities").json()["limits"].take();
    assert_eq!(limits["triangles"], 31, "flag over variable");
    assert_eq!(limits["nodes"], 22, "variable over file");
    assert_eq!(limits["image_px"], 13, "file over default");
    assert_eq!(limits["json_depth"], 64, "default");

    assert!(run(&["health", &format!("http://{}", server.address)], b"").status.success());
    assert!(run(&["health", &format!("http://{}/readyz", server.address)], b"").status.success());
    assert!(!run(&["health", &format!("http://{}/nothing", server.address)], b"").status.success());
}

#[test]
fn help_version_and_completions_go_to_standard_output() {
    for arguments in [&["--help"][..], &["--version"], &["render", "--help"], &["completions", "bash"]] {
        let output = run(arguments, b"");
        assert!(output.status.success() && !output.stdout.is_empty() && output.stderr.is_empty(), "{arguments:?}");
    }
}
