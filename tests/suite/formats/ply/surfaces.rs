//! Surfaces in PLY files: normals, texture coordinates, colours and textures.

use crate::support::files::bundle::{files, read_bundle};
use crate::support::files::mesh::codes;
use crate::support::files::mesh::read;
use crate::support::files::ply::{ENCODINGS, Encoding, INDICES, Ply, XYZ, list};
use crate::support::scenes;
use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::import::Bundle;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::material::ImageContent;

fn corner<T: Copy>(mesh: &Mesh, values: &[T], triangle: usize, corner: usize) -> T {
    values[mesh.attribute_triangles[triangle][corner] as usize]
}

/// A triangle whose vertices have three more values each.
fn triangle(encoding: Encoding, more: &[&str], values: [&[f64]; 3]) -> Ply {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let records: Vec<Vec<f64>> = positions.iter().zip(values).map(|(p, v)| [p, v].concat()).collect();
    Ply::new(encoding).element("vertex", &[&XYZ, more].concat(), &records)
}

fn face() -> [Vec<f64>; 1] {
    [list(&[0.0, 1.0, 2.0])]
}

#[test]
fn normals_and_texture_coordinates() {
    let uv_names = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]];
    let mut cases = 0;
    for encoding in ENCODINGS {
        for [u, v] in uv_names {
            let more = ["float nx", "double ny", "float nz", &format!("float {u}"), &format!("double {v}")];
            let values: [&[f64]; 3] =
                [&[0.0, 0.0, 2.0, 0.25, 0.75], &[1.0, 0.0, 0.0, 0.5, 1.5], &[0.0, -4.0, 0.0, 0.0, 0.0]];
            let mesh = read(&triangle(encoding, &more, values).element("face", &INDICES, &face()).bytes()).unwrap();
            let at = |k| (corner(&mesh, &mesh.normals, 0, k), corner(&mesh, &mesh.uvs, 0, k));
            assert_eq!(at(0), ([0.0, 0.0, 1.0], [0.25, 0.25]));
            assert_eq!(at(1), ([1.0, 0.0, 0.0], [0.5, -0.5]));
            assert_eq!(at(2), ([0.0, -1.0, 0.0], [0.0, 1.0]));
            cases += 1;
        }
        // Half of a normal is none.
        let half = triangle(encoding, &["float nx", "float s"], [&[1.0, 0.0]; 3]);
        let mesh = read(&half.element("face", &INDICES, &face()).bytes()).unwrap();
        assert!(mesh.normals.is_empty() && mesh.uvs.is_empty());
    }
    assert_eq!(cases, 9);
}

#[test]
fn vertex_colours_are_srgb() {
    // sRGB 0.5 is 0.2140411 in linear light, and so is 128 of 255 nearly.
    let half = |v: f64| libm::pow((v + 0.055) / 1.055, 2.4) as f32;
    let cases: [(&str, &str, [f64; 4], [f32; 4]); 8] = [
        ("uchar", "uchar", [255.0, 128.0, 0.0, 51.0], [1.0, half(128.0 / 255.0), 0.0, 0.2]),
        ("int", "uint", [255.0, 128.0, 0.0, 51.0], [1.0, half(128.0 / 255.0), 0.0, 0.2]),
        ("ushort", "ushort", [65535.0, 32768.0, 0.0, 13107.0], [1.0, half(32768.0 / 65535.0), 0.0, 0.2]),
        ("float", "float", [1.0, 0.5, 0.0, 0.25], [1.0, half(0.5), 0.0, 0.25]),
        ("double", "uchar", [1.0, 0.5, 0.0, 51.0], [1.0, half(0.5), 0.0, 0.2]),
        ("float", "float", [255.0, 128.0, 0.0, 51.0], [1.0, half(128.0 / 255.0), 0.0, 0.2]),
        ("char", "uchar", [127.0, 0.0, -5.0, 255.0], [half(127.0 / 255.0), 0.0, 0.0, 1.0]),
        ("float", "float", [f64::NAN, 0.5, 0.0, f64::NAN], [1.0, half(0.5), 0.0, 1.0]),
    ];
    let mut ran = 0;
    for encoding in ENCODINGS {
        for (kind, alpha, given, expected) in cases {
            for prefix in ["", "diffuse_"] {
                let names = ["red", "green", "blue"].map(|c| format!("{kind} {prefix}{c}"));
                let more = [names[0].as_str(), &names[1], &names[2], &format!("{alpha} {prefix}alpha")];
                let mesh = read(&triangle(encoding, &more, [&given; 3]).element("face", &INDICES, &face()).bytes());
                let mesh = mesh.unwrap();
                let color = corner(&mesh, &mesh.colors, 0, 1);
                let near = color.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
                assert!(near, "{kind} {alpha} {encoding:?}: {color:?} {expected:?}");
                assert_eq!(mesh.materials[0].base_color, Some([1.0; 4]), "no tint");
                ran += 1;
            }
        }
    }
    assert_eq!(ran, 48);
    // The same numbers as OBJ.
    let obj = b"v 0 0 0 0.5 0.25 1\nv 1 0 0 0.5 0.25 1\nv 0 1 0 0.5 0.25 1\nf 1 2 3\n";
    let more = ["float red", "float green", "float blue"];
    let ply = triangle(Encoding::Ascii, &more, [&[0.5, 0.25, 1.0]; 3]).element("face", &INDICES, &face()).bytes();
    assert_eq!(read(&ply).unwrap().colors, read(obj).unwrap().colors);
}

#[test]
fn faces_have_colours_and_corners_texture_coordinates() {
    let square: Vec<Vec<f64>> =
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].iter().map(|[x, y]| vec![*x, *y, 0.0]).collect();
    let uvs = |shift: f64| list(&[shift, 0.0, shift + 1.0, 0.0, shift + 1.0, 1.0]);
    let faces = [
        [list(&[0.0, 1.0, 2.0]), uvs(0.0), vec![255.0, 0.0, 0.0]].concat(),
        [list(&[0.0, 2.0, 3.0]), uvs(4.0), vec![0.0, 255.0, 0.0]].concat(),
        [list(&[0.0, 1.0, 3.0]), list(&[9.0, 9.0]), vec![255.0, 0.0, 0.0]].concat(),
    ];
    let properties =
        ["list uchar int vertex_indices", "list uchar float texcoord", "uchar red", "uchar green", "uchar blue"];
    for encoding in ENCODINGS {
        let ply = Ply::new(encoding).element("vertex", &XYZ, &square).element("face", &properties, &faces);
        let mesh = read(&ply.bytes()).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 3));
        assert_eq!([0, 1, 2].map(|k| corner(&mesh, &mesh.uvs, 0, k)), [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
        assert_eq!([0, 1, 2].map(|k| corner(&mesh, &mesh.uvs, 1, k)), [[4.0, 1.0], [5.0, 1.0], [5.0, 0.0]]);
        assert_eq!(corner(&mesh, &mesh.uvs, 2, 0), [0.0, 0.0]);
        for (t, color) in [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]].into_iter().enumerate() {
            assert!((0..3).all(|k| corner(&mesh, &mesh.colors, t, k) == color));
        }
        assert_eq!(codes(&mesh), ["texcoords_ignored"]);
        // Colours of vertices win.
        let more = ["uchar red", "uchar green", "uchar blue"];
        let own = triangle(encoding, &more, [&[0.0, 0.0, 255.0]; 3]);
        let mesh = read(&own.element("face", &properties, &faces[..1]).bytes()).unwrap();
        assert!((0..3).all(|k| corner(&mesh, &mesh.colors, 0, k) == [0.0, 0.0, 1.0, 1.0]));
        assert_eq!(codes(&mesh), ["face_colors_ignored"]);
    }
}

#[test]
fn textures_come_from_the_bundle() {
    let uvs = list(&[0.0, 0.0, 1.0, 0.0, 1.0, 1.0]);
    let face = |number: f64| [list(&[0.0, 1.0, 2.0]), uvs.clone(), vec![number]].concat();
    let properties = ["list uchar int vertex_indices", "list uchar float texcoord", "int texnumber"];
    for encoding in ENCODINGS {
        let ply = triangle(encoding, &[], [&[]; 3])
            .line("comment TextureFile Wood Dark.png")
            .line("comment TextureFile C:\\scans\\b.png")
            .line("comment TextureFile gone.png")
            .line("comment TextureFile tex/b.png");
        let ply = ply.element("face", &properties, &[1.0, 0.0, 2.0, -1.0, 3.0, 9.0].map(face)).bytes();
        let bundle = files(&[("scan/m.ply", &ply), ("scan/wood dark.png", b"\x89PNG a"), ("tex/b.png", b"\x89PNG b")]);
        let mesh = read_bundle(&Bundle::of_files(bundle)).unwrap();
        assert_eq!(mesh.triangle_materials, [1, 0, 2, 4, 3, 4]);
        let image =
            |m: usize| mesh.materials[m].base_texture.map(|texture| &mesh.images[texture.image as usize].content);
        let encoded = |bytes: &[u8]| ImageContent::Encoded(bytes.into());
        assert_eq!(image(0), Some(&encoded(b"\x89PNG a")));
        assert_eq!(image(1), Some(&encoded(b"\x89PNG b")));
        assert_eq!(image(2), Some(&ImageContent::Absent));
        assert_eq!((image(3), mesh.images.len()), (image(1), 3));
        assert_eq!(image(4), None);
        let white = Some([1.0; 4]);
        assert_eq!(mesh.materials.iter().map(|m| m.base_color).collect::<Vec<_>>(), [white, white, None, white, None]);
        assert_eq!(codes(&mesh), ["textures_undefined", "textures_missing"]);
    }
    // A texture without coordinates is not drawn.
    let bare = triangle(Encoding::Ascii, &[], [&[]; 3]).line("comment TextureFile a.png");
    let mesh = read(&bare.element("face", &INDICES, &self::face()).bytes()).unwrap();
    assert_eq!((mesh.materials.len(), mesh.materials[0].base_texture, codes(&mesh)), (1, None, vec!["uvs_missing"]));
}

/// A sheet of two quads with a texture and colours: as OBJ, and as PLY with texture coordinates a
/// vertex and a corner.
#[test]
fn textured_and_coloured_files_draw_what_obj_draws() {
    let mut png = Vec::new();
    let image = image::RgbImage::from_fn(16, 16, |x, y| {
        image::Rgb([(x * 16) as u8, (y * 16) as u8, 255 * ((x + y) % 2) as u8])
    });
    image.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    let vertices: Vec<[f64; 8]> = (0..6_u32)
        .map(|i| {
            let (x, y) = (f64::from(i % 3), f64::from(i / 3));
            let color = |k: u32| f64::from((i + k) % 3) * 0.5;
            [x, y, x * y * 0.25, x * 0.5, y, color(0), color(1), color(2)]
        })
        .collect();
    let quads = [[0, 1, 4, 3], [1, 2, 5, 4]];
    let faces = quads.map(|quad: [usize; 4]| list(&quad.map(|v| v as f64)));
    let mut obj = String::from("mtllib m.mtl\nusemtl m\n");
    for [x, y, z, u, v, r, g, b] in &vertices {
        obj += &format!("v {x} {y} {z} {r} {g} {b}\nvt {u} {v}\n");
    }
    for quad in quads {
        let corners: Vec<String> = quad.iter().map(|v| format!("{0}/{0}", v + 1)).collect();
        obj += &format!("f {}\n", corners.join(" "));
    }
    let draw = |entry: (&str, &[u8]), style: &str| {
        let bundle = files(&[entry, ("m.mtl", b"newmtl m\nKd 1 1 1\nmap_Kd t.png\n"), ("t.png", &png)]);
        let mesh = read_bundle(&Bundle::of_files(bundle)).unwrap();
        let plan = scenes::plan(&mesh, &scenes::spec(&[("size", "96"), ("view", "front"), ("style", style)]));
        CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap().rgba
    };
    let mut cases = 0;
    for style in ["smooth", "flat", "unlit"] {
        let expected = draw(("m.obj", obj.as_bytes()), style);
        assert!(
            expected.chunks(4).any(|p| p[0] > p[2].saturating_add(50))
                && expected.chunks(4).any(|p| p[2] > p[0].saturating_add(50)),
            "colourful"
        );
        for encoding in ENCODINGS {
            let colors = ["double red", "double green", "double blue"];
            let at_vertices = [&XYZ[..], &["float s", "float t"], &colors].concat();
            let all: Vec<Vec<f64>> = vertices.iter().map(|v| v.to_vec()).collect();
            let named = || Ply::new(encoding).line("comment TextureFile t.png");
            let by_vertex = named().element("vertex", &at_vertices, &all).element("face", &INDICES, &faces);
            let without: Vec<Vec<f64>> = vertices.iter().map(|v| [&v[..3], &v[5..]].concat()).collect();
            let wedges: Vec<Vec<f64>> = quads
                .iter()
                .zip(&faces)
                .map(|(quad, face)| {
                    let uvs: Vec<f64> = quad.iter().flat_map(|&v| [vertices[v][3], vertices[v][4]]).collect();
                    [face.clone(), list(&uvs)].concat()
                })
                .collect();
            let by_corner = named().element("vertex", &[&XYZ[..], &colors].concat(), &without);
            let by_corner = by_corner.element("face", &[INDICES[0], "list uchar double texcoord"], &wedges);
            for ply in [by_vertex, by_corner] {
                assert!(draw(("m.ply", &ply.bytes()), style) == expected, "{style} {encoding:?}");
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 18);
}
