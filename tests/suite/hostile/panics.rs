//! A decoder of another crate that panics: the job's file is refused, and the server goes on. If
//! the decoder read a texture, the file is drawn without that texture.

use crate::formats::fbx::basics::cube;
use crate::formats::gltf::packed::Sheet;
use crate::formats::three_mf::{ITEM, cube_model, package};
use crate::support::files::bundle::zipped;
use crate::support::files::fbx::binary;
use crate::support::server::{CUBE_OBJ, Server, meshsnap};

/// Starts a server in which the decoder of this name panics.
fn server(decoder: &str) -> Server {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_TEST_PANIC_IN", decoder);
    Server::start_with(&mut command)
}

#[test]
fn a_panic_of_a_decoder_is_the_files_fault() {
    let cases = [
        ("zip", zipped(&[("cube.obj", CUBE_OBJ)])),
        ("XML", package(cube_model(ITEM).as_bytes())),
        ("FBX", binary(&cube(vec![]))),
        ("Draco", Sheet::new().draco().glb()),
        ("meshoptimizer", Sheet::new().meshopt("EXT_meshopt_compression").glb()),
    ];
    for (decoder, bytes) in cases {
        let server = server(decoder);
        for _ in 0..3 {
            let detail = server.post("/v1/render?size=16", &bytes).problem(422, "decoder_failed");
            assert!(detail.contains(&format!("the {decoder} decoder failed")), "{detail}");
            // The next job is drawn, and the next of the same kind refused again.
            server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
        }
    }
}

/// No texture costs the picture, and no panic of its decoder either.
#[test]
fn a_panic_of_a_texture_decoder_is_a_warning() {
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let obj = b"mtllib a.mtl\nusemtl A\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    let ktx2 = include_bytes!("../../data/models/ktx2/2d_uastc.ktx2");
    for (decoder, name, picture) in
        [("image", "a.png", png.get_ref().as_slice()), ("pixels", "a.png", png.get_ref()), ("Basis", "a.ktx2", ktx2)]
    {
        let mtl = format!("newmtl A\nmap_Kd {name}\n");
        let bytes = zipped(&[("a.obj", obj), ("a.mtl", mtl.as_bytes()), (name, picture)]);
        let server = server(decoder);
        let answer = server.post("/v1/render?size=16&style=smooth", &bytes);
        answer.picture(16, 16);
        let warnings = answer.header("x-warnings").unwrap_or_default().to_owned();
        assert!(warnings.contains("texture"), "{decoder}: {warnings}");
        assert!(Server::start(&[]).post("/v1/render?size=16&style=smooth", &bytes).header("x-warnings").is_none());
    }
}
