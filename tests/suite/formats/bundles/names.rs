//! Bundles: which names files may have, how a name inside a bundle is resolved, and which file is
//! the mesh.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use crate::support::files::mesh::Read;
use meshsnap_render::import::{Bundle, BundleFile, Folder, Format, MeshFault, import};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::material::ImageContent;
use std::path::Path;

use crate::support::data;
use crate::support::files::archive::{Raw, archive};
use crate::support::files::bundle::{Model, files, read_bundle, zipped};
use crate::support::server::CUBE_OBJ;

#[test]
fn names_that_no_file_may_have() {
    let long = "x".repeat(1025);
    let bad = [
        ("/etc/passwd", "absolute"),
        ("\\server\\share", "absolute"),
        ("C:\\x.obj", "drive"),
        ("c:x.obj", "drive"),
        ("../x.obj", "`..`"),
        ("a/../x.obj", "`..`"),
        ("a\\..\\..\\x.obj", "`..`"),
        ("a\0b", "control"),
        ("a\nb", "control"),
        ("", "empty"),
        ("./", "empty"),
        (long.as_str(), "longer"),
    ];
    for (name, part) in bad {
        let error = BundleFile::new(name, Vec::new()).unwrap_err().to_string();
        assert!(error.contains(part) && error.len() < 250, "{name:?}: {error}");
    }
    assert_eq!(bad.len(), 12);
    for (name, path) in [("./a//b\\c d.png", "a/b/c d.png"), ("..a", "..a"), ("ünï/中", "ünï/中")] {
        assert_eq!(BundleFile::new(name, Vec::new()).unwrap().path, path);
    }
}

#[test]
fn names_inside_a_bundle_mean_what_they_would_on_disk() {
    let names = ["m/scene.obj", "m/tex/Wood.png", "m/a b.png", "top.png", "x/dup.png", "y/dup.png", "m/100%.png"];
    let folder = Folder::new(files(&names.map(|name| (name, b"" as &[u8]))), 0);
    let found = [
        ("tex/Wood.png", "m/tex/Wood.png"),
        ("./tex//Wood.png", "m/tex/Wood.png"),
        ("tex\\Wood.png", "m/tex/Wood.png"),
        ("TEX/wood.PNG", "m/tex/Wood.png"),
        ("a%20b.png", "m/a b.png"),
        ("a b.png", "m/a b.png"),
        ("100%.png", "m/100%.png"),
        ("100%25.png", "m/100%.png"),
        ("../top.png", "top.png"),
        ("tex/../../m/./a b.png", "m/a b.png"),
        ("../x/dup.png", "x/dup.png"),
        // No such folder, but only one file of that name.
        ("elsewhere/wood.png", "m/tex/Wood.png"),
        ("top.png", "top.png"),
    ];
    for (uri, path) in found {
        assert_eq!(folder.resolve(uri).unwrap().map(|f| f.path.as_str()), Some(path), "{uri}");
    }
    for uri in ["dup.png", "nothing.png", "", ".", "https://example.com/top.png", "file:top.png", "m/", "%00"] {
        assert_eq!(folder.resolve(uri).unwrap().map(|f| f.path.as_str()), None, "{uri}");
    }
    for uri in ["../../top.png", "..%2f..%2ftop.png", "/top.png", "\\top.png", "C:\\top.png", "..\\..\\..\\top.png"] {
        let error = folder.resolve(uri).unwrap_err();
        assert_eq!(error.fault, MeshFault::OutsideBundle, "{uri}");
        assert!(error.detail.contains("leads out of the upload"), "{error}");
    }
    assert_eq!(found.len(), 13);
}

#[test]
fn the_mesh_among_the_files_is_found_or_asked_for() {
    let noise = [b"\x89PNG\r\n\x1a\n".to_vec(), vec![7; 5000]].concat();
    let cube: &[u8] = CUBE_OBJ;
    let two = files(&[("a/one.obj", cube), ("two.obj", cube), ("t.png", &noise)]);
    let error = read_bundle(&Bundle::of_files(two.clone())).unwrap_err();
    assert_eq!(error.fault, MeshFault::EntryUnclear);
    assert!(error.detail.contains("\"a/one.obj\", \"two.obj\"") && !error.detail.contains("t.png"), "{error}");
    let asked = |entry: &str| read_bundle(&Bundle::of_files(two.clone()).with_entry(Some(entry.into())));
    for entry in ["a/one.obj", "one.obj", "A\\ONE.obj", "two.obj", "elsewhere/two.obj"] {
        assert_eq!(asked(entry).unwrap().triangles.len(), 12, "{entry}");
    }
    for (entry, fault, part) in [
        ("three.obj", MeshFault::EntryUnclear, "\"a/one.obj\""),
        ("", MeshFault::EntryUnclear, "\"a/one.obj\""),
        ("t.png", MeshFault::Unrecognised, "\"t.png\" is a picture"),
    ] {
        let error = asked(entry).unwrap_err();
        assert!(error.fault == fault && error.detail.contains(part), "{entry}: {error}");
    }
    let error = read_bundle(&Bundle::of_files(files(&[("a.mtl", b"newmtl a\nKd 1 1 1\n"), ("t.png", &noise)])));
    let error = error.unwrap_err();
    assert!(error.fault == MeshFault::Unrecognised && error.detail.contains("\"a.mtl\", \"t.png\""), "{error}");
    let many: Vec<(String, &[u8])> = (0..13).map(|i| (format!("{i:02}.txt"), b"x" as &[u8])).collect();
    let many: Vec<(&str, &[u8])> = many.iter().map(|(name, bytes)| (name.as_str(), *bytes)).collect();
    let error = read_bundle(&Bundle::of_files(files(&many))).unwrap_err();
    assert!(error.detail.ends_with("\"00.txt\", \"01.txt\", \"02.txt\", \"03.txt\", \"04.txt\", \"05.txt\", \"06.txt\", \"07.txt\", \"08.txt\", \"09.txt\" and 3 more"), "{error}");
    // A file that only resembles an STL is one by the name of an STL, and not by that of a texture.
    let mut loose = vec![0; 84 + 50 * 2 + 3];
    loose[80] = 2;
    let named = |name| files(&[("cube.obj", cube), (name, &loose)]);
    assert!(read_bundle(&Bundle::of_files(named("x.ktx"))).is_ok());
    assert_eq!(read_bundle(&Bundle::of_files(named("x.stl"))).unwrap_err().fault, MeshFault::EntryUnclear);
    let limits = Limits::default();
    let of = |format| {
        let bundle = Bundle::of_files(named("x.stl"));
        import(&bundle, Some(format), &limits, &mut Budget::new(&limits), &Deadline::default()).map(Read::from)
    };
    assert_eq!(of(Format::Obj).unwrap().triangles.len(), 12);
    assert_eq!(of(Format::Gltf).unwrap_err().fault, MeshFault::Unrecognised);
}

#[test]
fn real_models_come_with_their_materials_however_they_are_packed() {
    let models = Model::all();
    for model in &models {
        let files_of = model.files();
        let in_folder = |prefix: &str| -> Vec<(String, &[u8])> {
            files_of.iter().map(|(name, bytes)| (format!("{prefix}{name}"), *bytes)).collect()
        };
        let nested = in_folder("some/folder/");
        let nested: Vec<(&str, &[u8])> = nested.iter().map(|(name, bytes)| (name.as_str(), *bytes)).collect();
        let junk: &[(&str, &[u8])] = &[("some/", b""), ("__MACOSX/some/._x.obj", CUBE_OBJ), ("some/.DS_Store", b"x")];
        let bundles = [
            Bundle::of_files(files(&files_of)),
            Bundle::of_one(zipped(&files_of)),
            Bundle::of_one(zipped(&[&nested, junk].concat())),
            Bundle::of_files(vec![BundleFile::new("x.zip", zipped(&files_of)).unwrap()]),
        ];
        for (i, bundle) in bundles.iter().enumerate() {
            let mesh = read_bundle(bundle).unwrap();
            let [slot] = mesh.materials.as_slice() else { panic!("{i}: {:?}", mesh.materials) };
            assert_eq!(slot.name, model.material);
            assert_eq!(slot.base_color, Some([1.0; 4]));
            assert_eq!(slot.base_texture.map(|t| t.image), Some(0));
            let [image] = mesh.images.as_slice() else { panic!("{i}") };
            let ImageContent::Encoded(bytes) = &image.content else { panic!("{i}: {image:?}") };
            assert_eq!(bytes.as_ref(), files_of[2].1, "{i}");
            assert!(image.name.contains(files_of[2].0), "{}", image.name);
            let codes: Vec<&str> = mesh.report.warnings.iter().map(|w| w.code).collect();
            assert!(codes.contains(&"tr_ignored"), "{codes:?}");
            assert!(!codes.iter().any(|c| ["mtl_ignored", "textures_missing"].contains(c)), "{codes:?}");
        }
        let alone = read_bundle(&Bundle::of_one(files_of[0].1.to_vec())).unwrap();
        let warning = alone.report.warnings.iter().find(|w| w.code == "mtl_ignored").unwrap();
        assert!(warning.detail.contains(files_of[1].0), "{warning:?}");
        let without = read_bundle(&Bundle::of_files(files(&files_of[..2]))).unwrap();
        let warning = without.report.warnings.iter().find(|w| w.code == "textures_missing").unwrap();
        assert!(warning.detail.contains(files_of[2].0), "{warning:?}");
        assert_eq!(without.images[0].content, ImageContent::Absent);
    }
    assert_eq!(models.len(), 2);
}

#[test]
fn gltf_finds_its_buffers() {
    let cube = data::folder("corpus/gltf/CubeImageUriSpaces");
    finds_its_buffers(&cube, "CubeImageUriSpaces.gltf", &["CubeImageUriMultipleSpaces.gltf"], 12);
    let out = r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"../x.bin","byteLength":36}],"bufferViews":[{"buffer":0,"byteLength":36}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}]}"#;
    let bundle = |gltf, bin| Bundle::of_files(files(&[(gltf, out.as_bytes()), (bin, &[0; 36])]));
    assert_eq!(read_bundle(&bundle("x.gltf", "x.bin")).unwrap_err().fault, MeshFault::OutsideBundle);
    assert_eq!(read_bundle(&bundle("m/x.gltf", "x.bin")).unwrap_err().fault, MeshFault::Empty, "three equal points");
}

#[test]
fn a_large_gltf_finds_its_buffers() {
    let Some(folder) = data::large_folder("models") else { return };
    finds_its_buffers(&folder.join("PalmTree"), "PalmTree.gltf", &[], 101);
}

/// Reads the folder's files as a bundle, without those of `others`, and then its entry alone.
fn finds_its_buffers(folder: &Path, entry: &str, others: &[&str], triangles_min: usize) {
    let name = |path: &Path| path.file_name().unwrap().to_str().unwrap().to_owned();
    let paths = data::files(folder).into_iter().filter(|path| !others.contains(&name(path).as_str()));
    let all: Vec<(String, Vec<u8>)> = paths.map(|path| (name(&path), std::fs::read(&path).unwrap())).collect();
    let all: Vec<(&str, &[u8])> = all.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    for bundle in [Bundle::of_files(files(&all)), Bundle::of_one(zipped(&all))] {
        assert!(read_bundle(&bundle).unwrap().triangles.len() >= triangles_min);
    }
    let error = read_bundle(&Bundle::of_one(std::fs::read(folder.join(entry)).unwrap())).unwrap_err();
    assert_eq!(error.fault, MeshFault::OutsideBundle);
    assert!(error.detail.contains(".bin") && error.detail.contains("add it"), "{error}");
}

/// The files of an archive, and parts of what is said of it.
type Case<'a> = (Vec<(&'a str, &'a [u8])>, &'a [&'a str]);

/// An archive's stored, unpacked entry can be read, but is not if nothing names it.
#[test]
fn archives_in_archives_and_archives_without_a_mesh_are_said_to_be_that() {
    let inner = archive(&[Raw::stored("cube.obj", CUBE_OBJ)], 1);
    let picture = b"\x89PNG\r\n\x1a\n".as_slice();
    let cases: [Case; 6] = [
        (vec![("inner.zip", &inner)], &["\"inner.zip\" is a zip archive", "send it alone"]),
        (vec![("model.3mf", &inner)], &["\"model.3mf\" is a zip archive"]),
        (
            vec![("a.txt", b"hello"), ("inner.zip", &inner)],
            &["\"a.txt\", \"inner.zip\"; \"inner.zip\" is a zip archive"],
        ),
        (vec![("read me.txt", b"hello")], &["\"read me.txt\" is not a mesh in a known format"]),
        (vec![("t.png", picture)], &["\"t.png\" is a picture"]),
        (vec![("a.txt", b"a"), ("t.png", picture)], &["none of the files is a mesh", "\"a.txt\", \"t.png\""]),
    ];
    let mut read = 0;
    for (files, parts) in &cases {
        let stored: Vec<Raw> = files.iter().map(|(name, bytes)| Raw::stored(name, bytes)).collect();
        let count = stored.len() as u16;
        for bundle in [Bundle::of_one(archive(&stored, count)), Bundle::of_files(self::files(files))] {
            // In a form, an archive that is the only file is the whole upload.
            if files.len() == 1 && bundle.is_zip() && bundle.files()[0].path != "mesh" {
                assert_eq!(read_bundle(&bundle).unwrap().triangles.len(), 12);
                continue;
            }
            let error = read_bundle(&bundle).unwrap_err();
            let holds_archive = files.iter().any(|(_, bytes)| bytes.starts_with(b"PK"));
            let fault = if holds_archive { MeshFault::BundleBroken } else { MeshFault::Unrecognised };
            assert_eq!(error.fault, fault, "{error}");
            assert!(parts.iter().all(|part| error.detail.contains(part)), "{error}");
            read += 1;
        }
    }
    assert_eq!((cases.len(), read), (6, 10));
}
