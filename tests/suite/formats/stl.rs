//! STL files as programs write them: colours, headers that lie, counts that were never filled in.

use crate::support::files::damage::{cut_everywhere, mutate};
use crate::support::files::mesh::{Solid, codes, read, read_limited};
use crate::support::files::same::assert_same_shape;
use meshsnap_render::import::{Format, MeshFault};
use meshsnap_render::limits::Limits;
use meshsnap_render::mesh::Mesh;

fn triangles() -> Solid {
    Solid::cuboid().triangulated(&[[0, 2, 3], [4, 5, 7], [0, 1, 5]])
}

/// A file with this header and these attribute bytes.
fn stl(header: &[u8], attributes: [u16; 3]) -> Vec<u8> {
    let mut bytes = triangles().stl_binary();
    bytes[..header.len()].copy_from_slice(header);
    for (i, attribute) in attributes.iter().enumerate() {
        bytes[84 + 50 * i + 48..84 + 50 * i + 50].copy_from_slice(&attribute.to_le_bytes());
    }
    bytes
}

fn colors(mesh: &Mesh) -> Vec<[[f32; 4]; 3]> {
    mesh.attribute_triangles.iter().map(|t| t.map(|v| mesh.colors[v as usize])).collect()
}

#[test]
fn colours_of_both_kinds_are_read() {
    let plain = read(&stl(b"solid", [0; 3])).unwrap();
    assert!(plain.colors.is_empty() && plain.materials[0].base_color.is_none());
    // Without bit 15 anywhere there is no colour, only what some program counted there.
    assert!(read(&stl(b"x", [0, 0x7FFF, 3])).unwrap().colors.is_empty());
    let (red, green, blue, white) = ([1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [1.0; 4]);
    let magics: &[u8] = b"made by a program COLOR=\x00\xFF\x00\xFF,MATERIAL=\xFF\xFF\xFF\xFF";
    type Case<'c> = (&'c [u8], [u16; 3], [[f32; 4]; 3]);
    let cases: [Case<'_>; 4] = [
        (b"solid VisCAM", [0x8000 | 31 << 10, 0x8000 | 31, 31], [red, blue, white]),
        (magics, [31, 31 << 10, 0x8000 | 31], [red, blue, green]),
        (magics, [0, 0, 0], [green; 3]),
        (magics, [0xFFFF; 3], [green; 3]),
    ];
    for (header, attributes, expected) in cases {
        let mesh = read(&stl(header, attributes)).unwrap();
        assert_same_shape(&plain, &mesh, "coloured");
        assert_eq!(colors(&mesh), expected.map(|color| [color; 3]), "{attributes:?}");
        assert_eq!(mesh.materials[0].base_color, Some([1.0; 4]));
    }
    assert_eq!(cases.len(), 4);
    let half = colors(&read(&stl(b"", [0x8000 | 16, 0, 0])).unwrap())[0][0][2];
    assert!((half - 0.229).abs() < 0.001, "16 of 31 in sRGB: {half}");
}

#[test]
fn headers_that_lie_are_seen_through() {
    let good = stl(b"solid this is text?", [0; 3]);
    let plain = read(&good).unwrap();
    assert_eq!((plain.report.format, plain.triangles.len()), (Format::StlBinary, 3));
    let with_count = |count: u32| {
        let mut bytes = good.clone();
        bytes[80..84].copy_from_slice(&count.to_le_bytes());
        bytes
    };
    for count in [0, u32::MAX] {
        let mesh = read(&with_count(count)).unwrap();
        assert_same_shape(&plain, &mesh, "uncounted");
        assert_eq!(codes(&mesh), ["count_missing"]);
        // Half a triangle more says that it is something else.
        let mut odd = with_count(count);
        odd.extend([0; 25]);
        assert!(read(&odd).is_err());
    }
    assert_eq!(codes(&read(&with_count(2)).unwrap()), ["trailing_bytes"]);
    assert!(read(&with_count(4)).unwrap_err().detail.contains("4 triangles, which needs"));
    // "facet" in the header of a binary file.
    assert_eq!(read(&stl(b"solid facet normal", [0; 3])).unwrap().triangles.len(), 3);
    // Text with the wrong number of things in it.
    let text = triangles().stl_ascii();
    assert_eq!(read(format!("{text}{text}").as_bytes()).unwrap().triangles.len(), 6, "two solids in a file");
    for (from, to) in [("endloop", "vertex 0 0 0\nendloop"), ("endsolid a test\n", ""), ("vertex 1.5", "vertex 1.5x")] {
        assert_eq!(read(text.replacen(from, to, 1).as_bytes()).unwrap_err().fault, MeshFault::Broken, "{to}");
    }
    // Line ends of old Macs, one line, and names that look like more.
    let expected = read(text.as_bytes()).unwrap();
    let texts = [
        text.replace('\n', "\r"),
        text.replace('\n', " "),
        text.replace("solid a test", "solid facet vertex endfacet"),
        text.replace('\n', " ").replace("solid a test", "solid facet of vertex 1"),
    ];
    for text in &texts {
        assert_same_shape(&expected, &read(text.as_bytes()).unwrap_or_else(|error| panic!("{error}: {text}")), text);
    }
    assert_eq!(texts.len(), 4);
    assert_eq!(read(texts[1].as_bytes()).unwrap().report.metadata.generator.as_deref(), Some("a test"));
    assert_eq!(read(texts[1].repeat(2).as_bytes()).unwrap().triangles.len(), 6, "two solids on a line");
    assert!(read(texts[1].split("endsolid").next().unwrap().as_bytes()).unwrap_err().detail.contains("cut off"));
    let shouting = text.to_ascii_uppercase().replace('\n', "\r\n");
    assert_eq!(read(shouting.as_bytes()).unwrap().report.format, Format::StlAscii);
}

#[test]
fn files_cut_off_or_changed_are_survived() {
    let colored = stl(b"COLOR=\x00\xFF\x00\xFF", [31, 0x8000, 0]);
    assert_eq!(cut_everywhere(&colored, Format::StlBinary), 0);
    let drawn = mutate(&colored, Format::StlBinary, 20_000, 0x57_1001);
    assert!(drawn > 1000 && drawn < 19_900, "{drawn}");
    let drawn = mutate(triangles().stl_ascii().as_bytes(), Format::StlAscii, 20_000, 0x57_1002);
    assert!(drawn > 1000 && drawn < 19_900, "{drawn}");
    let tight = Limits::default().with(|limits| limits.memory_bytes = 600);
    assert!(matches!(read_limited(&colored, None, &tight).unwrap_err().fault, MeshFault::Limit(_)));
}
