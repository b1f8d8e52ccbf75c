//! MTL: what each statement becomes, and libraries that are broken or hostile.

use crate::support::work::within_bytes;
use meshsnap_render::import::{Bundle, MeshError, MeshFault};
use meshsnap_render::mesh::material::{AlphaMode, ImageContent, MaterialSlot, Wrap};

use crate::support::files::bundle::{files, read_bundle};
use crate::support::files::mesh::{Noise, Read, codes};

/// A triangle in each of three materials.
const OBJ: &[u8] =
    b"mtllib lib.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl A\nf 1 2 3\nusemtl B\nf 1 3 2\nusemtl C\nf 3 2 1\n";

fn read_mtl(mtl: &[u8]) -> Result<Read, MeshError> {
    read_bundle(&Bundle::of_files(files(&[
        ("m.obj", OBJ),
        ("lib.mtl", mtl),
        ("a.png", b"\x89PNG a"),
        ("with space.png", b"\x89PNG b"),
        ("tex/n.png", b"\x89PNG c"),
    ])))
}

/// The first material, from statements.
fn slot(statements: &str) -> (MaterialSlot, Read) {
    let mesh = read_mtl(format!("newmtl A\n{statements}\nnewmtl B\nnewmtl C\n").as_bytes()).unwrap();
    (mesh.materials[0].clone(), mesh)
}

fn close(a: Option<[f32; 4]>, b: [f32; 4]) -> bool {
    a.is_some_and(|a| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6))
}

#[test]
fn colours_and_factors() {
    // sRGB 0.5 is 0.2140411 in linear light.
    const HALF: f32 = 0.214_041_1;
    let colors: [(&str, [f32; 4]); 10] = [
        ("Kd 1 0.5 0", [1.0, HALF, 0.0, 1.0]),
        ("Kd 0.5", [HALF, HALF, HALF, 1.0]),
        ("  kd\t0.5 # grey", [HALF, HALF, HALF, 1.0]),
        ("Kd 7 -1 1", [1.0, 0.0, 1.0, 1.0]),
        ("d 0.25", [1.0, 1.0, 1.0, 0.25]),
        ("d -halo 0.25", [1.0, 1.0, 1.0, 0.25]),
        ("Tr 0.25", [1.0, 1.0, 1.0, 0.75]),
        ("Tr 0.9\nd 0.25", [1.0, 1.0, 1.0, 0.25]),
        ("d 0.25\nTr 0.9", [1.0, 1.0, 1.0, 0.25]),
        ("Kd 0.5\nd 0", [HALF, HALF, HALF, 0.0]),
    ];
    for (text, expected) in colors {
        let (slot, mesh) = slot(text);
        assert!(close(slot.base_color, expected), "{text}: {slot:?}");
        let expected = if expected[3] < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque };
        assert_eq!(slot.alpha, expected, "{text}");
        assert_eq!(codes(&mesh), [""; 0], "{text}");
    }
    let (material, mesh) = slot("Kd 0.5\nTr 1");
    assert_eq!((material.base_color.map(|c| c[3]), material.alpha), (Some(1.0), AlphaMode::Opaque));
    assert_eq!(codes(&mesh), ["tr_ignored"]);

    let roughness = |text: &str| slot(text).0.roughness.unwrap();
    assert_eq!((roughness("Pr 0.25\nNs 3"), roughness("Ns 0"), roughness("Ns -5")), (0.25, 1.0, 1.0));
    // n = 2 / roughness^4 - 2
    assert!((roughness("Ns 30") - 0.5).abs() < 1e-6 && (roughness("Ns 19998") - 0.1).abs() < 1e-6);
    let (material, _) = slot("Pm 2\nKe 0.5 2 0\nillum 0\nKa 1 1 1\nKs 1 1 1\nNi 1.5\nTf 1 1 1");
    assert_eq!(material.metallic, Some(1.0));
    let emissive = material.emissive.unwrap();
    assert!((emissive[0] - HALF).abs() < 1e-6 && emissive[1] > 4.0 && emissive[2] == 0.0, "{emissive:?}");
    assert_eq!(slot("").0, MaterialSlot { name: "A".into(), ..MaterialSlot::default() });
}

#[test]
fn textures_with_options() {
    let (material, mesh) = slot("map_Kd -clamp on -s 2 4 1 -o 0.25 0.5 -blendu off -mm 0 1 -bm 2 with space.png");
    let texture = material.base_texture.unwrap();
    // v up: v' = 4 v + 0.5; down: 1 - (4 (1 - v) + 0.5) = 4 v - 3.5.
    assert_eq!(texture.transform, [[2.0, 0.0, 0.25], [0.0, 4.0, -3.5]]);
    assert_eq!(texture.wrap, [Wrap::Clamp; 2]);
    assert_eq!(mesh.images.len(), 1);
    assert_eq!(mesh.images[0].content, ImageContent::Encoded((b"\x89PNG b" as &[u8]).into()));
    assert_eq!(material.base_color, None, "nothing was said of it");

    let (material, mesh) = slot("norm -bm 0.5 tex\\N.png\nmap_Ke a.png\nmap_Kd ./a.png\nmap_d a.png");
    assert_eq!(material.normal_scale, Some(0.5));
    let images = [material.base_texture, material.emissive_texture, material.normal_texture];
    assert_eq!(images.map(|t| t.unwrap().image), [0, 0, 1], "an image is there once");
    assert_eq!((mesh.images.len(), material.emissive, material.alpha), (2, Some([1.0; 3]), AlphaMode::Mask(0.5)));
    assert_eq!(codes(&mesh), [""; 0]);

    assert_eq!(slot("map_Kd a.png").0.alpha, AlphaMode::Opaque);
    assert_eq!(slot("map_Kd a.png\nmap_d a.png\nd 0.5").0.alpha, AlphaMode::Blend);
    let (material, mesh) =
        slot("map_Kd a.png\nmap_d tex/n.png\nmap_Bump a.png\nbump a.png\nmap_Pr a.png\nmap_Ka a.png");
    assert_eq!(material.alpha, AlphaMode::Opaque);
    assert_eq!(codes(&mesh), ["bump_ignored", "maps_ignored", "map_d_ignored"]);
    let (_, mesh) = slot("map_Kd a.png\nmap_roughness_or_the_like a.png");
    assert_eq!(codes(&mesh), ["maps_ignored"], "a keyword longer than any that is read");
    // Other people's folders, and names that no file of the upload has.
    for name in ["C:\\Users\\me\\A.PNG", "/home/me/a.png", "../../a.png", "textures/a.png", "a%2Epng"] {
        let (_, mesh) = slot(&format!("map_Kd {name}"));
        assert_eq!(mesh.images[0].content, ImageContent::Encoded((b"\x89PNG a" as &[u8]).into()), "{name}");
    }
    let (_, mesh) = slot("map_Kd gone.png\nmap_Ke https://example.com/a.png\nnorm gone.png");
    assert_eq!(mesh.images.len(), 2);
    assert!(mesh.images.iter().all(|image| image.content == ImageContent::Absent));
    assert_eq!(codes(&mesh), ["textures_missing"]);
    let detail = &mesh.report.warnings[0].detail;
    assert!(detail.contains("\"gone.png\", \"https://example.com/a.png\""), "{detail}");
}

#[test]
fn libraries_are_found_by_name() {
    let cube = |head: &str| format!("{head}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl A\nf 1 2 3\n");
    let named = |name: &str, obj: &str, mtl: &str| {
        let bundle = [("m/m.obj", obj.as_bytes()), (name, b"newmtl A\nKd 0 1 0\n"), (mtl, b"newmtl A\nKd 1 0 0\n")];
        read_bundle(&Bundle::of_files(files(&bundle))).unwrap()
    };
    let green = Some([0.0, 1.0, 0.0, 1.0]);
    let cases = [
        ("m/two words.mtl", "mtllib two words.mtl"),
        ("m/x.mtl", "mtllib nothing.mtl x.mtl"),
        ("x.mtl", "mtllib ../x.mtl"),
        ("m/x.mtl", "mtllib x.mtl other.mtl"),
        ("m/x.mtl", "mtllib x.mtl\nmtllib other.mtl\nmtllib x.mtl"),
        ("m/X.MTL", "mtllib C:\\elsewhere\\x.mtl"),
        ("caf\u{e9}.mtl", "mtllib caf\u{e9}.mtl"),
    ];
    for (name, head) in cases {
        let mesh = named(name, &cube(head), "m/other.mtl");
        assert_eq!(mesh.materials[0].base_color, green, "{head}: the first definition counts");
    }
    assert_eq!(cases.len(), 7);
    let mut latin1 = cube("mtllib caf\u{1}.mtl").into_bytes();
    latin1.iter_mut().filter(|b| **b == 1).for_each(|b| *b = 0xe9);
    let bundle = files(&[("m.obj", &latin1), ("caf\u{e9}.mtl", b"newmtl A\nKd 0 1 0\n")]);
    assert_eq!(read_bundle(&Bundle::of_files(bundle)).unwrap().materials[0].base_color, green);
    // Names are bytes: what is no text is matched all the same, and shown as well as can be.
    let bundle = files(&[
        ("m.obj", b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl \xff\xfe\nf 1 2 3\nusemtl \xff\nf 1 2 3\n"),
        ("m.mtl", b"newmtl \xff\nKd 1 0 0\r\nnewmtl \xff\xfe \r\nKd 0 1 0\nnewmtl a\nKd 0 0 1"),
    ]);
    let mesh = read_bundle(&Bundle::of_files(bundle)).unwrap();
    assert_eq!(mesh.materials[0].base_color, green);
    assert_eq!(mesh.materials[1].base_color, Some([1.0, 0.0, 0.0, 1.0]));
    assert_eq!(mesh.materials[0].name, "\u{fffd}\u{fffd}");
    let mesh = read_mtl(b"newmtl a\nnewmtl B\n").unwrap();
    assert_eq!(codes(&mesh), ["materials_undefined"]);
    assert!(mesh.report.warnings[0].detail.ends_with("\"A\", \"C\""), "names have a case: {:?}", mesh.report.warnings);
}

#[test]
fn broken_and_hostile_libraries() {
    let bad_lines = [
        "Kd",
        "Kd x",
        "Kd nan nan nan",
        "Kd 1 1 inf",
        "Kd 0.5 0.5",
        "Kd xyz 1 1 1",
        "Ke spectral a.rfl",
        "d",
        "d opaque",
        "Tr inf",
        "Ns 1e400",
        "Pr nan",
        "map_Kd",
        "map_Kd -s",
        "map_Kd -clamp on",
        "norm -bm",
        "map_Ke -blendu",
    ];
    for line in bad_lines {
        let (material, mesh) = slot(line);
        assert_eq!(material, MaterialSlot { name: "A".into(), ..MaterialSlot::default() }, "{line}");
        assert_eq!(codes(&mesh), ["mtl_lines_ignored"], "{line}");
    }
    assert_eq!(bad_lines.len(), 17);
    for text in ["", "\0\0\0", "Kd 1 1 1", "newmtl", "newmtl \nKd 1", "\u{feff}# x", "map_Kd a.png", "\\\n\\\n\\"] {
        assert_eq!(codes(&read_mtl(text.as_bytes()).unwrap()), ["materials_undefined"], "{text:?}");
    }
    let (material, mesh) = slot("map_Kd -weird name -s.png\nnorm -s 1e8 1e8 1e8 -o 5");
    assert_eq!(codes(&mesh), ["textures_missing"]);
    assert!(mesh.report.warnings[0].detail.contains("\"-weird name -s.png\", \"5\""), "{:?}", mesh.report.warnings);
    assert!(material.normal_texture.unwrap().transform.iter().flatten().all(|v| v.is_finite()));

    let million: String = (0..1_000_000).map(|i| format!("newmtl m{i}\nKd 1 1 1\nmap_Kd {i}.png\n")).collect();
    let long = "x".repeat(30_000_000);
    let texts = [
        million + "newmtl A\nKd 0.5\n",
        format!("{long}\nnewmtl {long}\nnewmtl A\nKd {long}\nmap_Kd {long}\nKd 0.5\n"),
        format!("newmtl A\nmap_Kd {}-s\nKd 0.5\n", "-s 1 ".repeat(5_000_000)),
        format!("newmtl A\nKd 0.5{}\n", "\\\n".repeat(10_000_000)),
    ];
    for text in &texts {
        let most = 16 * text.len() as u64 + (64 << 20);
        let mesh = within_bytes(most, "a long library", || read_mtl(text.as_bytes()).unwrap());
        assert!(close(mesh.materials[0].base_color, [0.214_041_1, 0.214_041_1, 0.214_041_1, 1.0]));
        assert_eq!(mesh.images.len(), 0);
    }
    // As many materials that are used: the names are paid for.
    let mut obj = String::from("mtllib x.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
    let mut mtl = String::new();
    for i in 0..700_000 {
        obj += &format!("usemtl {i}\nf 1 2 3\n");
        mtl += &format!("newmtl {i}\nmap_Kd {i}.png\nnorm n{i}.png\n");
    }
    let error = read_bundle(&Bundle::of_files(files(&[("m.obj", obj.as_bytes()), ("x.mtl", mtl.as_bytes())])));
    assert!(matches!(error.unwrap_err().fault, MeshFault::Limit(_)));
}

/// Statements thrown together, some of them cut: each is read or passed over.
#[test]
fn soups_of_statements_are_read() {
    const WORDS: [&str; 30] = [
        "newmtl",
        "A",
        "B",
        "\n",
        "\n",
        "\n",
        "Kd",
        "Ke",
        "d",
        "Tr",
        "Ns",
        "Pm",
        "Pr",
        "map_Kd",
        "map_d",
        "map_Ke",
        "norm",
        "-s",
        "-o",
        "-clamp",
        "on",
        "-bm",
        "0.5",
        "1",
        "-1e30",
        "nan",
        "a.png",
        "tex/n.png",
        "\\\n",
        "#",
    ];
    let mut noise = Noise(3);
    let mut textured = 0;
    for _ in 0..5_000 {
        let mut text = "newmtl A\n".to_owned();
        for _ in 0..60 {
            text += WORDS[(noise.next() >> 33) as usize % WORDS.len()];
            text += " ";
        }
        let mesh = read_mtl(text.as_bytes()).unwrap();
        for slot in &mesh.materials {
            let textures = [slot.base_texture, slot.emissive_texture, slot.normal_texture];
            for texture in textures.into_iter().flatten() {
                assert!((texture.image as usize) < mesh.images.len(), "{text}");
                assert!(texture.transform.iter().flatten().all(|v| v.is_finite()), "{text}");
                textured += 1;
            }
            let factors = [slot.metallic, slot.roughness, slot.base_color.map(|c| c[3])];
            assert!(factors.into_iter().flatten().all(|v| (0.0..=1.0).contains(&v)), "{text}");
            assert!(slot.emissive.iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{text}");
        }
    }
    assert!(textured > 500, "{textured}");
}
