//! Tests that PLY triangles in the layout that is read fast, many at once, give the same mesh or
//! the same error as triangles that are read record by record.

use super::read;
use crate::import::Format;
use crate::import::bundle::{Bundle, entry};
use crate::import::context::Context;
use crate::limits::{Budget, Deadline, Limits};

/// A file whose counts have `count_bytes`: only those of one byte are read in one go.
fn file(faces: &[Vec<i32>], vertices: i32, count_bytes: usize, is_big: bool) -> Vec<u8> {
    let order = if is_big { "big" } else { "little" };
    let count_type = if count_bytes == 1 { "uchar" } else { "ushort" };
    let mut file = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list {count_type} int vertex_indices\nend_header\n",
        faces.len()
    )
    .into_bytes();
    let mut push = |bytes: &[u8]| if is_big { file.extend(bytes.iter().rev()) } else { file.extend(bytes) };
    for i in 0..vertices {
        [i % 100, i / 100, i % 7].iter().for_each(|c| push(&(*c as f32).to_le_bytes()));
    }
    for face in faces {
        push(&(face.len() as u16).to_le_bytes()[..count_bytes]);
        face.iter().for_each(|index| push(&index.to_le_bytes()));
    }
    file
}

/// Everything that a file becomes, or its error up to the place.
fn outcome(bytes: &[u8]) -> String {
    let limits = Limits::default();
    let (mut budget, deadline) = (Budget::new(&limits), Deadline::default());
    let files = Bundle::of_one(bytes.to_vec()).into_files();
    let (folder, _) = entry::choose(files, &Bundle::default(), Some(Format::Ply), &deadline).unwrap();
    let mut cx = Context {
        limits: &limits,
        budget: &mut budget,
        deadline: &deadline,
        bundle: &folder,
        time_s: None,
        counts_loose: false,
    };
    match read(bytes, &mut cx) {
        Ok(raw) => format!("{raw:?}"),
        Err(error) => error.detail.split_once(": ").map_or(error.detail.clone(), |(_, what)| what.to_owned()),
    }
}

#[test]
fn triangles_in_one_go_and_record_by_record_agree() {
    let triangles = |count: i32| (0..count).map(|i| vec![i % 900, i % 900 + 1, i % 900 + 99]).collect::<Vec<_>>();
    let long = triangles(40_000);
    let with = |at: usize, face: Vec<i32>| {
        let mut faces = long.clone();
        faces[at] = face;
        faces
    };
    let cases = [
        (triangles(1), true),
        (long.clone(), true),
        (with(0, vec![0, 1, 2, 3]), true),
        (with(20_000, vec![0, 1, 101, 100]), true),
        (with(39_999, vec![0, 1]), true),
        (with(17_000, vec![0, 1, 1000]), false),
        (with(3, vec![0, 1, -1]), false),
        (with(16_384, vec![i32::MAX, 1, 2]), false),
    ];
    for (faces, is_good) in &cases {
        let plain = outcome(&file(faces, 1000, 2, false));
        assert_eq!(plain.starts_with("RawMesh"), *is_good, "{}", &plain[..plain.len().min(200)]);
        for is_big in [false, true] {
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let given = pool.install(|| outcome(&file(faces, 1000, 1, is_big)));
                assert!(given == plain, "{threads} threads: {}", &given[..given.len().min(200)]);
            }
        }
    }
    assert_eq!(cases.len(), 8);
    // A file that ends within a record says so.
    let whole = file(&long, 1000, 1, false);
    let cut = outcome(&whole[..whole.len() - 5]);
    assert!(cut.contains("face 40000 of 40000"), "{cut}");
}
