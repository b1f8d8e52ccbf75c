use bytes::Bytes;

use super::*;
use crate::jobs::{Media, Timings};
use crate::store::Reading;
use meshsnap_render::backend::{BackendKind, DrawTimes};
use meshsnap_render::image::ImageFormat;
use meshsnap_render::import::{Bundle, BundleFile};
use meshsnap_render::warning::Warning;

fn mesh(files: &[(&str, &str)], owner: &str) -> NewMesh {
    let files: Vec<BundleFile> = files
        .iter()
        .map(|(path, text)| BundleFile { path: (*path).into(), bytes: Bytes::copy_from_slice(text.as_bytes()) })
        .collect();
    let digest = if files.len() == 1 { Digest::of(&files[0].bytes) } else { Digest::of_files(&files) };
    NewMesh {
        digest,
        bundle: Bundle::of_files(files),
        reading: Reading { format_in: None, entry: Some("a.obj".into()) },
        report: Bytes::from_static(b"{\n}"),
        owners: vec![Owner::new(owner)],
    }
}

fn picture() -> Finished {
    Finished {
        content: Bytes::from_static(b"not\na picture"),
        memory: None,
        media: Media::Picture(ImageFormat::Png),
        has_failed: false,
        backend: BackendKind::Cpu,
        is_substitute: false,
        warnings: vec![Warning { code: "some_code", detail: "a sentence".into() }],
        selection: None,
        mesh_was_kept: true,
        timings: Timings::default(),
        draw_times: DrawTimes::default(),
    }
}

fn store() -> (tempfile::TempDir, SharedStore) {
    let folder = tempfile::tempdir().unwrap();
    let store = SharedStore::new(&format!("file://{}", folder.path().display())).unwrap();
    (folder, store)
}

fn run<T>(what: impl Future<Output = T>) -> T {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap().block_on(what)
}

fn everybody() -> Access {
    Access::open(Owner::new("address 127.0.0.1"))
}

/// Three kinds: one file, an empty one, several.
#[test]
fn meshes_come_back_as_they_were() {
    let (_folder, store) = store();
    let sides = [
        mesh(&[("", "v 0 0 0\nv 1 0 0\n")], "name one"),
        mesh(&[("", "")], ""),
        mesh(&[("a.obj", "v 0 0 0"), ("a.mtl", ""), ("b/c.png", "\u{0}\n")], "name two"),
    ];
    run(async {
        store.reach().await.unwrap();
        for mesh in &sides {
            assert!(store.find_mesh(mesh.digest, &everybody()).await.unwrap().is_none());
            store.put_mesh(mesh).await.unwrap();
            let found = store.find_mesh(mesh.digest, &everybody()).await.unwrap().unwrap();
            let read = store.read_mesh(mesh.digest, &found).await.unwrap().unwrap();
            let files = |mesh: &NewMesh| -> Vec<(String, Bytes)> {
                mesh.bundle.files().iter().map(|file| (file.path.clone(), file.bytes.clone())).collect()
            };
            assert_eq!(files(&read), files(mesh));
            assert_eq!((read.digest, &read.reading, &read.report), (mesh.digest, &mesh.reading, &mesh.report));
            assert_eq!(read.owners, mesh.owners);
        }
    });
}

#[test]
fn each_party_has_its_own_and_the_last_one_takes_the_pictures_along() {
    let (_folder, store) = store();
    let [one, two] = ["one", "two"].map(|owner| mesh(&[("", "v 0 0 0")], owner));
    let digest = one.digest;
    let access = |owner: &str| {
        let mut access = Access::default();
        access.owner = Owner::new(owner);
        access
    };
    run(async {
        store.reach().await.unwrap();
        store.put_mesh(&one).await.unwrap();
        store.put_picture(digest, "W/\"key\"", &picture()).await.unwrap();
        assert!(store.find_mesh(digest, &access("one")).await.unwrap().is_some());
        assert!(store.find_mesh(digest, &access("two")).await.unwrap().is_none());
        assert!(!store.delete_mesh(digest, &access("two")).await.unwrap(), "it is another's");
        store.put_mesh(&two).await.unwrap();
        assert!(store.delete_mesh(digest, &access("one")).await.unwrap());
        assert!(!store.delete_mesh(digest, &access("one")).await.unwrap(), "twice");
        assert!(store.find_mesh(digest, &access("two")).await.unwrap().is_some());
        let found = store.picture(digest, "W/\"key\"").await.unwrap().unwrap();
        assert_eq!((found.content, found.warnings), (picture().content, picture().warnings));
        assert!(store.picture(digest, "\"key\"").await.unwrap().is_none(), "another key");
        assert!(store.delete_mesh(digest, &everybody()).await.unwrap(), "whoever sees all deletes all");
        assert!(store.picture(digest, "W/\"key\"").await.unwrap().is_none(), "its pictures go with it");
    });
}

/// Every object with one byte changed, and each of its beginnings, is either the mesh itself or none.
#[test]
fn damaged_objects_are_no_meshes_and_no_pictures() {
    let whole = mesh(&[("a.obj", "v 0 0 0"), ("a.mtl", "Kd 1 1 1")], "one");
    let object = Bytes::from(objects::of_mesh(&whole, &whole.owners[0]));
    let other = mesh(&[("", "v 0 0 0")], "one");
    assert!(objects::read_mesh(whole.digest, object.clone()).is_some());
    assert!(objects::read_mesh(other.digest, object.clone()).is_none(), "under another's name");
    let mut refused = 0;
    for end in 0..object.len() {
        assert!(objects::read_mesh(whole.digest, object.slice(..end)).is_none(), "{end} bytes");
        let mut changed = object.to_vec();
        changed[end] ^= 1;
        match objects::read_mesh(whole.digest, changed.into()) {
            Some(read) => {
                assert_eq!(Digest::of_files(read.bundle.files()), whole.digest);
                assert_eq!(read.report, whole.report);
            }
            None => refused += 1,
        }
    }
    assert!(refused > 50, "{refused}");
    let object = Bytes::from(objects::of_picture(&picture()));
    assert!(objects::read_picture(object.clone()).is_some());
    for end in 0..object.len() {
        assert!(objects::read_picture(object.slice(..end)).is_none());
    }
    // Numbers that no object of this size can have.
    let line = "{\"owner\":\"\",\"report_bytes\":18446744073709551615,\"report_sha256\":\"\",\"files\":[]}\n";
    assert!(objects::read_mesh(whole.digest, Bytes::from_static(line.as_bytes())).is_none());
}

#[test]
fn addresses_that_are_none_are_named() {
    for address in ["", "s3:/b", "s3://", "s3:///a", "s3://a b", "s3://a?b", "file://a", "file://", "/a", "http://a/b"]
    {
        let error = SharedStore::new(address).unwrap_err().to_string();
        assert!(error.contains("s3://BUCKET/PREFIX") && error.contains(address), "{address}: {error}");
    }
    let file = tempfile::NamedTempFile::new().unwrap();
    let error = SharedStore::new(&format!("file://{}", file.path().display())).unwrap_err().to_string();
    assert!(error.contains("cannot be used"), "{error}");
}
