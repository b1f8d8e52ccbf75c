//! Mistakes that people make on the command line. Each row is a command, its exit code and what is
//! said about it: enough to put it right.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::Stdio;

use crate::support::files::bundle::zipped;
use crate::support::server::{CUBE_OBJ, meshsnap};

/// The commands, run in a folder with the files of [`folder`]. The text after `<` is standard input.
const MISTAKES: &[(&str, i32, &str)] = &[
    // Names of files.
    ("render cube.obh -o out.png", 1, "cube.obh: there is no such file; did you mean cube.obj?"),
    ("render nothing.stl -o out.png", 1, "nothing.stl: there is no such file"),
    (
        "render parts -o out.png",
        2,
        "parts: is a folder; to draw each mesh in it, give a folder for the pictures: -o DIR/",
    ),
    ("render cube.obj -o none/out.png", 2, "there is no folder none; make it first"),
    (
        "render cube.obj -o cube.obj --format png",
        2,
        "cube.obj: is the input itself, and inputs are never written over; give another name",
    ),
    ("render cube.obj -o ./parts/../cube.obj --format png", 2, "is the same file as the input cube.obj"),
    ("render - - -o out.png", 2, "`-`, standard input, can be given once"),
    ("render none -o pictures/", 1, "none: there is no such file\n0 drawn, 1 failed"),
    ("render '*.xyz' -o pictures/", 1, "*.xyz: no file fits this pattern"),
    ("render look.json red.mtl -o pictures/", 1, "red.mtl: is not used: no mesh refers to it\n0 drawn, 1 failed"),
    ("render - -o pictures/", 2, "`-`, standard input, is one mesh without a name: give -o FILE, not a folder"),
    ("render cube.obj -o pictures/ --explain", 2, "--explain is for a single picture: give -o FILE, not a folder"),
    ("inspect parts", 2, "parts: is a folder, and a file is needed"),
    (
        "render cube.obj -o out.bmp",
        2,
        "out.bmp: no image format is called `bmp`; write png, webp or jpg, or give --format",
    ),
    ("render cube.obj --request look.jsn -o out.png", 1, "look.jsn: there is no such file; did you mean look.json?"),
    // Files that belong together.
    (
        "render red.obj -o out.png --size 16",
        0,
        "red.obj refers to \"red.mtl\", which lies beside it: meshsnap render red.obj red.mtl -o out.png --size 16",
    ),
    (
        "render 'parts/a b.gltf' -o out.png",
        1,
        "parts/a b.gltf refers to \"parts/a b.bin\", which lies beside it: meshsnap render 'parts/a b.gltf' 'parts/a b.bin' -o out.png",
    ),
    (
        "render lost.gltf -o out.png",
        1,
        "lost.gltf: buffer 0 of the glTF file is \"gone.bin\", and the command does not name it: add it, embed it, or take a GLB",
    ),
    ("render cube.obj red.mtl -o out.png --size 16", 0, "red.mtl: is not used: the mesh does not refer to it"),
    (
        "render both.zip cube.obj -o out.png --size 16",
        0,
        "both.zip: is not used: a zip archive is opened only where it is named alone",
    ),
    (
        "render cube.obj red.obj -o out.png",
        1,
        "several files are meshes: \"cube.obj\", \"red.obj\"; say which one to draw with --entry, or draw each of them with -o DIR/",
    ),
    (
        "render both.zip -o out.png",
        1,
        "both.zip: several files are meshes: \"a.obj\", \"b.obj\"; say which one to draw with --entry",
    ),
    (
        "render both.zip --entry c.obj -o out.png",
        1,
        "--entry is \"c.obj\", and there is no such file among \"a.obj\", \"b.obj\"",
    ),
    // Files that are no mesh.
    ("render three.tar -o out.png", 1, "\"three.tar\" is a tar archive: unpack it (`tar -xf`)"),
    ("render three.tar --format-in obj -o out.png", 1, "\"three.tar\" is a tar archive"),
    ("render cube.obj.gz -o out.png", 1, "\"cube.obj.gz\" is a gzip archive: unpack it"),
    (
        "render lfs.glb -o out.png",
        1,
        "\"lfs.glb\" is a pointer of Git LFS, not the file that it stands for: fetch that with `git lfs pull`",
    ),
    (
        "render part.step -o out.png",
        1,
        "\"part.step\" is a STEP file, which is not read: convert it to OBJ, STL, PLY, OFF, FBX, 3MF, glTF or GLB",
    ),
    ("render scene.usda -o out.png", 1, "\"scene.usda\" is a USD file, which is not read: convert it"),
    ("render scene.dae -o out.png", 1, "\"scene.dae\" is a COLLADA file, which is not read: convert it"),
    ("render scene.blend -o out.png", 1, "\"scene.blend\" is a Blender file, which is not read: convert it"),
    ("render empty.obj -o out.png", 1, "\"empty.obj\" is empty, and should be a mesh"),
    (
        "render - -o out.png < nonsense",
        1,
        "-: the input is not a mesh in a known format (OBJ, STL, PLY, OFF, FBX, 3MF, glTF or GLB); if it is one, name it with --format-in",
    ),
    // Values.
    ("render cube.obj -o out.png --style wier", 2, "a similar value exists: 'wire'"),
    ("render cube.obj -o out.png --view fromt", 2, "a similar value exists: 'front'"),
    ("render cube.obj -o out.png --sheet front,tpo", 2, "invalid value 'tpo' for '--sheet <V,V,...>'"),
    ("render cube.obj -o out.png --backend cuda", 2, "[possible values: auto, gpu, cpu]"),
    ("render cube.obj -o out.png --samples 2", 2, "[possible values: adaptive, 1, 4, 8, 16]"),
    ("render cube.obj -o out.png --format-in dae", 2, "[possible values: obj, gltf, glb, stl, ply, off, fbx, 3mf]"),
    (
        "render cube.obj -o out.png --size 640*480",
        2,
        "--size is \"640*480\", and allowed is N or WxH, with whole numbers from 1 to 4096",
    ),
    (
        "render cube.obj -o out.png --size 5000",
        2,
        "--size is \"5000\", and allowed is N or WxH, with whole numbers from 1 to 4096",
    ),
    (
        "render cube.obj -o out.png --background white",
        2,
        "--background is \"white\", and allowed is a colour: #rgb, #rgba, #rrggbb, #rrggbbaa (or without #) or transparent",
    ),
    (
        "render cube.obj -o out.png --set wire.colour=#f00",
        2,
        "--set: there is no key `wire.colour` (given \"#f00\"); did you mean wire.color?",
    ),
    (
        "render cube.obj -o out.png --set materials.Glass.surface.opactiy=0.3",
        2,
        "did you mean materials.Glass.surface.opacity? (the keys of materials.Glass.surface are",
    ),
    ("render cube.obj -o out.png --set style=wier", 2, "(did you mean wire?)"),
    ("render cube.obj -o out.png --set wire", 2, "--set wire: write KEY=VALUE, such as wire.color=#f00"),
    (
        "render cube.obj -o out.png --request broken.json",
        1,
        "broken.json: the request document is not JSON at line 1, column 18 (trailing comma)\n",
    ),
    (
        "render cube.obj -o out.png --request typo.json",
        1,
        "typo.json: there is no key `sytle` (given \"wire\"); did you mean style?",
    ),
    ("inspect cube.obj --set size=8", 2, "allowed is scene.time_s"),
    (
        "render cube.obj -o out.png --limit-triangles 3",
        1,
        "cube.obj: the number of triangles is more than 3 (raise the limit with --limit-triangles)",
    ),
    ("render cube.obj -o out.png --limit-body-bytes 10", 2, "unexpected argument '--limit-body-bytes' found"),
    (
        "render cube.obj -o out.png --limit-nodes few",
        2,
        "--limit-nodes is \"few\", and allowed is a whole number from 1 to",
    ),
    ("render cube.obj -o out.png --sise 8", 2, "a similar argument exists: '--size'"),
    ("render cube.obj", 2, "--output <OUT>"),
    ("cube.obj", 2, "cube.obj is a file. To draw it: meshsnap render cube.obj -o out.png"),
    ("rendr cube.obj -o out.png", 2, "a similar subcommand exists: 'render'"),
    // The server.
    (
        "serve --listen :8099",
        2,
        "--listen is \":8099\", and allowed is an address and a port, such as 127.0.0.1:8099 for this machine alone or 0.0.0.0:8099 for others too",
    ),
    ("serve --listen localhost", 2, "such as 127.0.0.1:8080 for this machine alone"),
    (
        "serve --listen no.such.host.invalid:80",
        2,
        "--listen no.such.host.invalid:80: there is no such address on this machine",
    ),
    ("serve --listen 0.0.0.0:0", 2, "set MESHSNAP_API_KEYS, or say --no-auth"),
    ("serve --workers 0", 2, "--workers is \"0\", and allowed is a whole number from 1 to 1024"),
    ("serve --log verbose", 2, "`log` is \"verbose\", which is no level; use off, error, warn, info, debug or trace"),
    ("serve --config none.toml", 2, "none.toml: the configuration cannot be read"),
    ("health http://127.0.0.1:1", 1, "http://127.0.0.1:1/healthz: not healthy"),
];

/// The files that the commands name.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    fs::create_dir(folder.path().join("parts")).unwrap();
    write("cube.obj", CUBE_OBJ);
    write("red.obj", &[b"mtllib red.mtl\nusemtl red\n", CUBE_OBJ].concat());
    write("red.mtl", b"newmtl red\nKd 1 0 0\n");
    let gltf = |bin: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"buffers":[{{"uri":"{bin}","byteLength":36}}],"bufferViews":[{{"buffer":0,"byteLength":36}}],"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}]}}"#
        )
    };
    write("parts/a b.gltf", gltf("a%20b.bin").as_bytes());
    write("parts/a b.bin", &[0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).concat());
    write("lost.gltf", gltf("gone.bin").as_bytes());
    write("both.zip", &zipped(&[("a.obj", CUBE_OBJ), ("b.obj", CUBE_OBJ)]));
    let mut tar = vec![0; 512];
    tar[..5].copy_from_slice(b"a.obj");
    tar[257..263].copy_from_slice(b"ustar\0");
    write("three.tar", &[&tar, CUBE_OBJ, &tar, CUBE_OBJ].concat());
    write("cube.obj.gz", b"\x1F\x8B\x08\0\0\0\0\0\0\x03v 0 0 0\n");
    write("lfs.glb", b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n");
    write("part.step", b"ISO-10303-21;\nHEADER;\n");
    write("scene.usda", b"#usda 1.0\ndef Mesh \"a\" {}\n");
    write("scene.dae", b"<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"x\">\n");
    write("scene.blend", b"BLENDER-v300");
    write("empty.obj", b"");
    write("look.json", b"{}");
    write("broken.json", b"{\"style\": \"wire\",}");
    write("typo.json", b"{\"sytle\": \"wire\"}");
    folder
}

/// Exit code and standard error of a command.
fn run(folder: &Path, line: &str) -> (Option<i32>, String) {
    let (line, stdin) = line.split_once(" < ").unwrap_or((line, ""));
    let words = shlex::split(line).unwrap();
    let mut command = meshsnap();
    command.current_dir(folder).args(words).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let _ = child.stdin.take().unwrap().write_all(stdin.as_bytes());
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn mistakes_are_named_with_their_remedy() {
    let folder = folder();
    let mut faults = Vec::new();
    for &(line, code, part) in MISTAKES {
        let (actual, said) = run(folder.path(), line);
        if actual != Some(code) || !said.contains(part) {
            faults.push(format!("{line}\n  exit code {actual:?}, expected {code}\n  {said}  expected: {part}"));
        }
        for word in ["upload", "`entry`", "format_in", "%23", "URL", "os error", "the body", "bundle"] {
            if said.replace("--limit-bundle", "").contains(word)
                && !line.starts_with("serve")
                && !line.starts_with("health")
            {
                faults.push(format!("{line}\n  says `{word}`: {said}"));
            }
        }
    }
    assert!(MISTAKES.len() >= 30);
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn files_beside_the_mesh_are_read_if_asked() {
    let folder = folder();
    for line in
        ["render red.obj --siblings -o out.png --size 16", "render 'parts/a b.gltf' --siblings -o out.png --size 16"]
    {
        assert_eq!(run(folder.path(), line), (Some(0), String::new()), "{line}");
    }
    // Not those outside of its folder.
    fs::write(folder.path().join("parts/out.obj"), [b"mtllib ../red.mtl\nusemtl red\n", CUBE_OBJ].concat()).unwrap();
    let (code, said) = run(folder.path(), "render parts/out.obj --siblings -o out.png --size 16");
    assert!(code == Some(0) && said.contains("does not name the material library"), "{said}");
}

/// The command that a message proposes does what it says, with the textures that only the material
/// library names.
#[test]
fn the_proposed_command_works() {
    let folder = folder();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    write("my mesh.obj", &[b"mtllib my mesh.mtl\nusemtl red\nvt 0 0\n", CUBE_OBJ].concat());
    write("my mesh.mtl", b"newmtl red\nmap_Kd wood.png\n");
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).unwrap();
    write("wood.png", png.get_ref());
    let (code, said) = run(folder.path(), "render 'my mesh.obj' -o out.png --size 16");
    assert_eq!(code, Some(0), "{said}");
    let (_, proposed) = said.trim().split_once("beside it: meshsnap ").expect(&said);
    assert_eq!(proposed, "render 'my mesh.obj' 'my mesh.mtl' wood.png -o out.png --size 16");
    assert_eq!(run(folder.path(), proposed), (Some(0), String::new()));
}

#[test]
fn a_level_of_the_log_has_its_usual_names() {
    let folder = folder();
    for (level, code, part) in
        [("warning", 0, "red.mtl"), ("WARN", 0, "red.mtl"), ("verbose", 2, "MESHSNAP_LOG is \"verbose\"")]
    {
        let mut command = meshsnap();
        command.current_dir(folder.path()).env("MESHSNAP_LOG", level);
        let output = command.args(["render", "red.obj", "-o", "out.png", "--size", "16"]).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(code) && said.contains(part), "{level}: {said}");
    }
}
