//! Runs the commands of README.md and of documents in docs/ as they stand there, and checks what
//! each prints and writes. Only the server's address and the words SHA256 and ID, which stand for
//! what an earlier answer has given, are replaced. Commands that need more than a test has, such as
//! a container engine, are not run; each says why.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Instant;

use crate::support::files::bundle::zipped;
use crate::support::server::{CUBE_OBJ, PATIENCE, Server, meshsnap};
use crate::support::skip::{Need, skip};

/// What a command does.
enum Outcome {
    /// It writes a picture of this size.
    Draws(&'static str, [u32; 2]),
    /// It prints all of these.
    Prints(&'static [&'static str]),
    /// It ends with this code, and prints all of these.
    Ends(i32, &'static [&'static str]),
    /// It runs until it is stopped, and has written this picture by then.
    Stays(&'static str, [u32; 2]),
    /// It is not typed here, for this reason: another test tries it, or it needs what a test has not.
    Elsewhere(&'static str),
}
use Outcome::{Draws, Elsewhere, Ends, Prints, Stays};

/// A part of each command of the document, in their order, and what the command does.
const README: &[(&str, Outcome)] = &[
    ("cargo run --release -- serve", Elsewhere("the curl line that it prints is tried in `http::answers`")),
    ("style=wire' -o out.png", Draws("out.png", [512, 512])),
    ("tests/run", Elsewhere("CI begins with it")),
    ("background=transparent&format=webp", Draws("knot.webp", [512, 512])),
    ("file=@wood.png", Draws("model.png", [512, 512])),
    (
        "rules=watertight,max-triangles:100000",
        Prints(&["\"rule\":\"watertight\"", "\"rule\":\"max-triangles\"", "\"ok\":true"]),
    ),
    ("cargo install --path .", Elsewhere("`cargo xtask package` builds the crate")),
    ("--size 800x600 --view top", Draws("knot.png", [800, 600])),
    ("'more/*.stl' -o pictures/", Prints(&["3 drawn, 0 failed"])),
    ("meshsnap inspect api/examples/knot.obj", Prints(&["triangles    4480", "volume 17.1457", "watertight"])),
    ("meshsnap check parts/ --rules", Ends(1, &["watertight: 4 open edges in 1 loop", "1 ok, 1 failed"])),
    ("meshsnap diff old/hinge.stl new/hinge.stl", Ends(1, &["moved by (0, 0, 1.5)"])),
    ("docker build", Elsewhere("takes a container engine")),
    ("docker run", Elsewhere("takes a container engine")),
    ("Authorization: Bearer choose-one", Draws("out.png", [512, 512])),
];

const HTTP: &[(&str, Outcome)] = &[
    ("style=outline&size=256&view=front", Draws("front.png", [256, 256])),
    ("background=transparent&format=webp", Draws("knot.webp", [512, 512])),
    ("style=xray", Draws("xray.png", [512, 512])),
    ("wire.edges=polygons", Draws("quads.png", [512, 512])),
    ("request=@api/examples/outline.json", Draws("knot.png", [512, 512])),
    ("style=topology", Draws("topology.png", [512, 512])),
    ("request=@api/examples/materials.json", Draws("lamp.png", [512, 512])),
    ("file=@wood.png", Draws("model.png", [512, 512])),
    ("@model.zip", Draws("model.png", [512, 512])),
    ("/v1/meshes", Prints(&["\"sha256\":\"SHA256\"", "\"size_bytes\":99782"])),
    ("SHA256/render.png?style=wire&size=256' -o knot.png", Draws("knot.png", [256, 256])),
    ("/v1/meshes/SHA256", Prints(&["\"triangles\": 4480,", "\"bounds\":"])),
    ("meshsnap sign", Prints(&["/v1/meshes/SHA256/render.png?style=wire&exp=", "&sig="])),
    ("curl -i --data-binary", Prints(&["HTTP/1.1 202 Accepted", "location: /v1/jobs/", "\"state\":"])),
    ("Prefer: wait=10", Prints(&["\"id\":\"ID\"", "\"state\":\"done\""])),
    ("/v1/jobs/ID/result -o knot.png", Draws("knot.png", [512, 512])),
    ("curl -N", Prints(&["event: done", "data: {"])),
    ("curl -X DELETE", Prints(&["\"id\":\"ID\"", "\"state\":\"done\""])),
    ("meshsnap jobs --dead", Prints(&["1 stored mesh"])),
    ("mesh=@api/examples/knot.obj", Prints(&["\"jobs\":[", "knot.obj", "lamp.obj"])),
    (
        "rules=watertight,max-triangles:100000",
        Prints(&["\"rule\":\"watertight\"", "\"rule\":\"max-triangles\"", "\"ok\":true"]),
    ),
    ("warn=has-uv&fail=422", Prints(&["\"ok\":true", "\"rule\":\"has-uv\""])),
    ("/v1/diff", Prints(&["\"same\": false", "the whole mesh moved by (0, 0, 1.5)"])),
    ("-o heat.png", Draws("heat.png", [1024, 512])),
    ("Idempotency-Key: build-118", Prints(&["HTTP/1.1 202 Accepted"])),
];

const COMMAND_LINE: &[(&str, Outcome)] = &[
    ("--size 800x600 --view top", Draws("knot.png", [800, 600])),
    ("< api/examples/knot.obj > knot.png", Draws("knot.png", [512, 512])),
    ("--sheet front,left,top,iso", Draws("sheet.png", [512, 512])),
    ("--turntable 24", Draws("turn.webp", [512, 512])),
    ("--explain", Prints(&["skipped hull", "encode", "total"])),
    ("meshsnap render model.obj model.mtl wood.png", Draws("model.png", [512, 512])),
    ("--siblings", Stays("model.png", [512, 512])),
    ("'more/*.stl' -o pictures/", Prints(&["3 drawn, 0 failed"])),
    ("meshsnap inspect api/examples/knot.obj", Prints(&["triangles    4480", "volume 17.1457", "watertight"])),
    ("meshsnap inspect part.stl --print --parts", Prints(&["at least 2 thick", "open loops 0"])),
    ("meshsnap inspect model.glb --uv", Prints(&["stretch 1.000 (L2), 1.000 (Linf)"])),
    ("meshsnap inspect parts/ --jsonl", Prints(&["open.stl", "sound.stl"])),
    ("meshsnap diff old/hinge.stl new/hinge.stl", Ends(1, &["moved by (0, 0, 1.5)"])),
    ("--side-by-side seen.png", Prints(&["no pixel differs"])),
];

const CHECKS: &[(&str, Outcome)] = &[
    ("meshsnap check parts/ --rules", Ends(1, &["watertight: 4 open edges in 1 loop", "1 ok, 1 failed"])),
    ("--html page.html", Prints(&["2 ok, 0 failed"])),
    ("warn=has-normals", Prints(&["\"ok\":true,\"checks\"", "\"detail\":\"it has no vertex normals\""])),
    ("fail=422' > verdict.json", Prints(&[])),
    ("kind=check", Prints(&["HTTP/1.1 202 Accepted"])),
    ("max_distance=0.01&fail=422", Prints(&["\"same\": false"])),
    ("-o heat.webp", Draws("heat.webp", [1024, 512])),
    ("kind=diff", Prints(&["HTTP/1.1 202 Accepted"])),
];

const OPERATIONS: &[(&str, Outcome)] = &[
    ("OTEL_EXPORTER_OTLP_ENDPOINT", Elsewhere("`http::jobs::traces` does so")),
    ("/v1/meshes", Prints(&["\"sha256\":\"SHA256\""])),
    ("\"mesh\": \"SHA256\"", Draws("knot.png", [512, 512])),
    ("meshsnap jobs --dead", Prints(&["1 stored mesh"])),
    ("meshsnap jobs --jsonl", Prints(&[])),
    ("docker build", Elsewhere("takes a container engine")),
    ("docker run", Elsewhere("takes a container engine")),
    ("Authorization: Bearer choose-one", Draws("out.png", [512, 512])),
    ("AWS_ENDPOINT_URL", Elsewhere("the next one needs it")),
    ("meshsnap serve --store s3://", Elsewhere("`http::shared_store` does so")),
    ("nats-server -js", Elsewhere("`http::shared_queue` does so")),
    ("meshsnap serve --queue nats://", Elsewhere("`http::shared_queue` does so")),
    ("meshsnap jobs --dead --queue", Elsewhere("`http::shared_queue::service` does so")),
];

const PIPELINES: &[(&str, Outcome)] = &[
    ("--update", Prints(&["./parts/open.stl: ok", "15 ok, 0 failed"])),
    ("meshsnap check . --baseline .meshsnap", Prints(&["15 ok, 0 failed"])),
];

/// The commands in the blocks of a document that are for a shell.
fn commands(document: &str) -> Vec<String> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(document)).unwrap();
    let mut is_shell = false;
    let mut found = Vec::new();
    for line in text.lines() {
        match line.strip_prefix("```") {
            Some(language) => is_shell = !is_shell && language == "sh",
            None if is_shell && !line.is_empty() && !line.starts_with('#') => found.push(line.to_owned()),
            None => {}
        }
    }
    found
}

/// A cube of triangles as STL, moved upwards, without its last faces.
fn stl(up: f32, without: usize) -> String {
    let text = std::str::from_utf8(CUBE_OBJ).unwrap();
    let corner = |line: &str| line[2..].split(' ').map(|word| word.parse::<f32>().unwrap()).collect::<Vec<_>>();
    let corners: Vec<_> = text.lines().filter(|line| line.starts_with("v ")).map(corner).collect();
    let mut out = "solid cube\n".to_owned();
    let faces: Vec<Vec<usize>> = text
        .lines()
        .filter(|line| line.starts_with("f "))
        .map(|line| line[2..].split(' ').map(|word| word.parse().unwrap()).collect())
        .collect();
    for face in &faces[..faces.len() - without] {
        for triangle in [[face[0], face[1], face[2]], [face[0], face[2], face[3]]] {
            out += "facet normal 0 0 0\nouter loop\n";
            for corner in triangle.map(|number| &corners[number - 1]) {
                out += &format!("vertex {} {} {}\n", corner[0], corner[1], corner[2] + up);
            }
            out += "endloop\nendfacet\n";
        }
    }
    out + "endsolid cube\n"
}

/// Puts the files there that the documents speak of.
fn furnish(folder: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    };
    for entry in std::fs::read_dir(root.join("api/examples")).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("api/examples/{}", path.file_name().unwrap().to_str().unwrap());
        write(&name, &std::fs::read(path).unwrap());
    }
    let uvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let model: String = ["mtllib model.mtl\n", uvs, "usemtl wood\n"].concat()
        + &std::str::from_utf8(CUBE_OBJ).unwrap().lines().fold(String::new(), |text, line| {
            let with_uv = |(i, word): (usize, &str)| format!(" {word}/{}", i + 1);
            match line.strip_prefix("f ") {
                Some(face) => text + "f" + &face.split(' ').enumerate().map(with_uv).collect::<String>() + "\n",
                None => text + line + "\n",
            }
        });
    let mtl = b"newmtl wood\nmap_Kd wood.png\n";
    let mut wood = std::io::Cursor::new(Vec::new());
    let planks = image::RgbImage::from_fn(16, 16, |x, y| image::Rgb([150 + 5 * (y % 4) as u8, 100, 40 + x as u8]));
    planks.write_to(&mut wood, image::ImageFormat::Png).unwrap();
    let wood = wood.into_inner();
    write("model.obj", model.as_bytes());
    write("model.mtl", mtl);
    write("wood.png", &wood);
    write("model.zip", &zipped(&[("model.obj", model.as_bytes()), ("model.mtl", mtl), ("wood.png", &wood)]));
    write("model.glb", &std::fs::read(root.join("tests/data/models/BoxTextured.glb")).unwrap());
    let (sound, moved, open) = (stl(0.0, 0), stl(1.5, 0), stl(0.0, 1));
    for (name, text) in [
        ("old.stl", &sound),
        ("new.stl", &moved),
        ("old/hinge.stl", &sound),
        ("new/hinge.stl", &moved),
        ("part.stl", &sound),
        ("models/a.stl", &sound),
        ("models/b.stl", &open),
        ("more/c.stl", &moved),
        ("parts/sound.stl", &sound),
        ("parts/open.stl", &open),
    ] {
        write(name, text.as_bytes());
    }
}

/// A shell in the folder, for one command.
fn shell(command: &str, folder: &Path) -> Command {
    let mut shell = Command::new("bash");
    // As `meshsnap()` has it: without the developer's own settings.
    for (name, value) in meshsnap().get_envs() {
        match value {
            Some(value) => shell.env(name, value),
            None => shell.env_remove(name),
        };
    }
    let programs = Path::new(env!("CARGO_BIN_EXE_meshsnap")).parent().unwrap().display().to_string();
    shell.env("PATH", format!("{programs}:{}", std::env::var("PATH").unwrap())).env("MESHSNAP_API_KEYS", "choose-one");
    shell.env("MESHSNAP_DATA_DIR", folder.join("data"));
    shell.args(["-c", command]).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    shell
}

fn printed(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat()
}

fn is_picture(path: &Path, size: [u32; 2]) -> Result<(), String> {
    let bytes = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let picture = image::load_from_memory(&bytes).map_err(|error| format!("{}: {error}", path.display()))?.to_rgba8();
    let first = *picture.get_pixel(0, 0);
    match <[u32; 2]>::from(picture.dimensions()) == size && picture.pixels().any(|pixel| *pixel != first) {
        true => Ok(()),
        false => Err(format!("{}: {:?}, or blank", path.display(), picture.dimensions())),
    }
}

/// Types the commands of a document. Returns how many were run.
fn type_all(document: &str, rows: &[(&str, Outcome)], folder: &Path) -> usize {
    let data_dir = folder.join("data").display().to_string();
    let server = Server::start(&["--workers", "2", "--ephemeral=false", "--data-dir", &data_dir]);
    let knot = std::fs::read(folder.join("api/examples/knot.obj")).unwrap();
    let sha256: String =
        <sha2::Sha256 as sha2::Digest>::digest(&knot).iter().map(|byte| format!("{byte:02x}")).collect();
    let (mut job, mut ran) = (String::new(), 0);
    let commands = commands(document);
    assert_eq!(commands.len(), rows.len(), "{document} has other commands than this test knows: {commands:#?}");
    for (command, (part, outcome)) in commands.iter().zip(rows) {
        assert!(command.contains(part), "{document}: `{part}` is no part of the command {command}");
        let fill = |text: &str| {
            text.replace("SHA256", &sha256).replace("/ID", &format!("/{job}")).replace("\"ID\"", &format!("\"{job}\""))
        };
        let typed = fill(command).replace("127.0.0.1:8080", &server.address.to_string());
        let (code, words): (i32, &[&str]) = match outcome {
            Draws(file, _) => {
                let _ = std::fs::remove_file(folder.join(file));
                (0, &[])
            }
            Prints(words) => (0, words),
            Ends(code, words) => (*code, words),
            Stays(file, size) => {
                ran += 1;
                let path = folder.join(file);
                let _ = std::fs::remove_file(&path);
                let (mut child, began) = (shell(&typed, folder).spawn().unwrap(), Instant::now());
                while let Err(why) = is_picture(&path, *size) {
                    assert!(began.elapsed() < PATIENCE, "{command}: {why}");
                    std::thread::sleep(std::time::Duration::from_millis(20));
                }
                assert!(child.try_wait().unwrap().is_none(), "{command} has ended");
                child.kill().unwrap();
                child.wait().unwrap();
                continue;
            }
            Elsewhere(why) => {
                println!("not typed: {command} ({why})");
                continue;
            }
        };
        ran += 1;
        let output = shell(&typed, folder).output().unwrap();
        let text = printed(&output);
        assert_eq!(output.status.code(), Some(code), "{command}\n{text}");
        for word in words {
            assert!(text.contains(&fill(word)), "{command} does not print {word}\n{text}");
        }
        if let Draws(file, size) = outcome {
            is_picture(&folder.join(file), *size).unwrap_or_else(|why| panic!("{command}: {why}\n{text}"));
        }
        if let Some(location) =
            text.lines().find_map(|line| line.strip_prefix("location: /v1/jobs/")).filter(|_| job.is_empty())
        {
            job = location.trim().to_owned();
        }
    }
    ran
}

#[test]
fn what_the_documents_say_is_what_happens() {
    if Command::new("curl").arg("--version").stdout(Stdio::null()).status().is_err() {
        return skip(Need::Curl, "curl");
    }
    let mut ran = 0;
    for (document, rows) in [
        ("README.md", README),
        ("docs/http.md", HTTP),
        ("docs/command-line.md", COMMAND_LINE),
        ("docs/checks.md", CHECKS),
        ("docs/operations.md", OPERATIONS),
        ("docs/ci/README.md", PIPELINES),
    ] {
        let folder = tempfile::tempdir().unwrap();
        furnish(folder.path());
        // Pictures that are compared were drawn before.
        for name in ["golden.png", "drawn.png"] {
            let draw = format!("meshsnap render model.obj --siblings -o {name} --size 64");
            assert!(shell(&draw, folder.path()).status().unwrap().success());
        }
        ran += type_all(document, rows, folder.path());
    }
    println!("{ran} commands");
    assert_eq!(ran, 64);
}
