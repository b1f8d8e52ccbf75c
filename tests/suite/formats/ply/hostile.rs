//! PLY files made to cost a lot, cut off anywhere, or changed at random.

use crate::support::files::mesh::{Noise, Solid, read, read_as, read_limited};
use crate::support::files::ply::{ENCODINGS, Encoding, INDICES, Ply, XYZ, list};
use crate::support::work::within_bytes;
use meshsnap_render::import::{Format, MeshFault};
use meshsnap_render::limits::Limits;

/// Bytes that a changed file of a kilobyte may allocate.
const COST_MAX: u64 = 16 << 20;

#[test]
fn memory_and_triangles_are_limited() {
    // One face of twenty million corners, which a byte each is enough for.
    let bytes = |properties: &str, body: &[u8]| {
        let head = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty uchar x\nproperty uchar y\nproperty uchar z\n";
        [format!("{head}element face 1\n{properties}end_header\n").as_bytes(), &[0, 0, 0, 1, 0, 0, 0, 1, 0], body]
            .concat()
    };
    let corners = 20_000_000_u32;
    let list = |count: u32| [&count.to_le_bytes()[..], &vec![0; count as usize]].concat();
    let property = "property list uint uchar vertex_indices\n";
    let many = bytes(property, &list(corners));
    let one = format!("{property}property list uint uchar texcoord\n");
    let with_uvs = bytes(&one, &[list(9_000_000), list(18_000_000)].concat());
    let small = Limits::default().with(|limits| limits.memory_bytes = 64 << 20);
    for (file, limits) in [(&many, &Limits::default()), (&many, &small), (&with_uvs, &small)] {
        // The importer holds its bytes once; what a limit refuses is not allocated.
        let most = limits.memory_bytes.min(1 << 30) + 2 * file.len() as u64;
        let error = within_bytes(most, "a face of many corners", || read_limited(file, None, limits).unwrap_err());
        assert!(matches!(error.fault, MeshFault::Limit(_)), "{error}");
    }
    assert!(read(&with_uvs).is_err());
}

/// A file with everything in it.
fn small(encoding: Encoding) -> Vec<u8> {
    let solid = Solid::cuboid();
    let records: Vec<Vec<f64>> = solid
        .positions
        .iter()
        .map(|p| [&p[..], &[0.0, 0.0, 1.0, 0.5, 0.5, 255.0, 128.0, 0.0, 255.0]].concat())
        .collect();
    let more = [
        "float nx",
        "float ny",
        "float nz",
        "float s",
        "float t",
        "uchar red",
        "uchar green",
        "uchar blue",
        "uchar alpha",
    ];
    let faces: Vec<Vec<f64>> = solid
        .face_records()
        .iter()
        .map(|face| [face.clone(), list(&[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]), vec![0.0]].concat())
        .collect();
    Ply::new(encoding)
        .line("comment TextureFile a.png")
        .element("vertex", &[&XYZ, &more[..]].concat(), &records)
        .element("face", &[INDICES[0], "list uchar float texcoord", "int texnumber"], &faces)
        .element("unknown", &["list short short a", "double b"], &[vec![1.0, 2.0, 0.5]])
        .element("tristrips", &["list int int vertex_indices"], &[list(&[0.0, 1.0, 2.0, -1.0, 3.0, 4.0, 5.0])])
        .bytes()
}

#[test]
fn a_file_cut_off_anywhere_is_told() {
    let mut cases = 0;
    for encoding in ENCODINGS {
        let bytes = small(encoding);
        assert_eq!(read(&bytes).unwrap().triangles.len(), 14);
        let whole = bytes.trim_ascii_end().len();
        for length in 0..bytes.len() {
            for format in [None, Some(Format::Ply)] {
                let result = read_as(&bytes[..length], format);
                // A text may lose the last digit's white space, and nothing else.
                let is_whole = encoding == Encoding::Ascii && length >= whole;
                assert_eq!(result.is_ok(), is_whole, "{encoding:?} {length}");
                if let Err(error) = result {
                    let fits = matches!(error.fault, MeshFault::Unrecognised | MeshFault::Broken);
                    assert!(fits && !error.detail.is_empty(), "{encoding:?} {length}: {error}");
                }
                cases += 1;
            }
        }
    }
    assert!(cases > 6000, "{cases}");
}

#[test]
fn mutated_files_never_panic_and_never_cost_much() {
    let mut noise = Noise(0x5EED_0F01);
    let (mut cases, mut drawn) = (0, 0);
    for encoding in ENCODINGS {
        let good = small(encoding);
        for _ in 0..20_000 {
            let mut bytes = good.clone();
            for _ in 0..=noise.next() % 4 {
                let at = (noise.next() % bytes.len() as u64) as usize;
                match noise.next() % 5 {
                    0 => bytes[at] = noise.next() as u8,
                    1 => bytes[at] ^= 1 << (noise.next() % 8),
                    2 if bytes.len() > 1 => _ = bytes.remove(at),
                    3 => bytes.truncate(at.max(1)),
                    _ => bytes.insert(at, b"0123456789-.e \nnaif"[(noise.next() % 19) as usize]),
                }
            }
            drawn += u32::from(within_bytes(COST_MAX, "a changed file", || read_as(&bytes, Some(Format::Ply)).is_ok()));
            cases += 1;
        }
    }
    assert_eq!(cases, 60_000);
    assert!(drawn > 3_000 && drawn < 55_000, "{drawn}");
}
