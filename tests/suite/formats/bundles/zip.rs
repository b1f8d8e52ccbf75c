//! Zip archives: sound ones are read, and each kind of dishonest one is refused with its own
//! reason, within a bound on memory.

use crate::support::files::archive::{Raw, archive};
use meshsnap_render::import::{Bundle, MeshFault, import};
use meshsnap_render::limits::{Budget, Deadline, Limits};

use crate::support::files::bundle::{read_bundle, zipped};
use crate::support::files::mesh::Noise;
use crate::support::server::{CUBE_OBJ, Server};
use crate::support::work::within_bytes;

fn fault(bytes: Vec<u8>, limits: &Limits) -> (MeshFault, String) {
    // Unpacking before the refusal is bounded, whatever the archive says of itself.
    let most = limits.bundle_bytes.min(256 << 20) + 4 * bytes.len() as u64 + (1 << 20);
    let bundle = Bundle::of_one(bytes);
    let refuse = || import(&bundle, None, limits, &mut Budget::new(limits), &Deadline::default());
    let error = within_bytes(most, "an archive", refuse).unwrap_err();
    (error.fault, error.detail)
}

#[test]
fn honest_archives_are_read() {
    let cube = [Raw::stored("a/cube.obj", CUBE_OBJ), Raw::deflated("readme.txt", b"Nothing here.")];
    assert_eq!(read_bundle(&Bundle::of_one(archive(&cube, 2))).unwrap().triangles.len(), 12);
    let small = [Raw::deflated("cube.obj", CUBE_OBJ)];
    assert_eq!(read_bundle(&Bundle::of_one(archive(&small, 1))).unwrap().triangles.len(), 12);
    // Something before the archive, as self-extracting ones have, and a comment after it.
    let mut around = b"PK\x03\x04".to_vec();
    around.extend(archive(&cube, 2));
    assert_eq!(read_bundle(&Bundle::of_one(around)).unwrap().triangles.len(), 12);
    let mut comment = archive(&cube, 2);
    let end = comment.len() - 2;
    comment[end] = 5;
    comment.extend(b"hello");
    assert_eq!(read_bundle(&Bundle::of_one(comment)).unwrap().triangles.len(), 12);
}

#[test]
fn dishonest_archives_are_refused_for_what_they_are() {
    let cube = || Raw::deflated("cube.obj", CUBE_OBJ);
    let with = |change: &dyn Fn(&mut Raw)| {
        let mut raw = cube();
        change(&mut raw);
        archive(&[raw], 1)
    };
    let named = |name: &[u8]| with(&|raw| raw.name = name.to_vec());
    let whole = archive(&[cube()], 1);
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("up", named(b"../cube.obj"), "`..`"),
        ("up on Windows", named(b"a\\..\\..\\cube.obj"), "`..`"),
        ("absolute", named(b"/etc/cube.obj"), "absolute"),
        ("drive", named(b"C:/cube.obj"), "drive"),
        ("NUL", named(b"cube.obj\0.png"), "control"),
        ("no name", named(b""), "empty"),
        ("long", named(&[b'x'; 2000]), "longer"),
        ("symlink", with(&|raw| raw.mode = 0o120_777), "symbolic link"),
        ("encrypted", with(&|raw| raw.flags = 1), "\"cube.obj\" of the zip archive is encrypted"),
        ("bzip2", with(&|raw| raw.method = 12), "\"cube.obj\" of the zip archive is packed by a method"),
        ("wrong sum", with(&|raw| raw.crc ^= 1), "checksum"),
        ("says too little", with(&|raw| raw.size -= 1), "cannot be unpacked"),
        ("says too much", with(&|raw| raw.size += 1), "cannot be unpacked"),
        ("says far too much", with(&|raw| raw.size = 400 << 20), "larger than its packed form"),
        ("noise", with(&|raw| raw.packed = vec![0x55; 300]), "cannot be unpacked"),
        ("two sizes", with(&|raw| raw.method = 0), "two different sizes"),
        ("twice", archive(&[cube(), cube()], 2), "two files are named"),
        ("shared", archive(&[cube(), Raw { name: b"b.obj".into(), start: Some(0), ..cube() }], 2), "overlap"),
        ("beyond", archive(&[cube(), Raw { name: b"b.obj".into(), start: Some(9_999), ..cube() }], 2), "outside"),
        ("in the directory", archive(&[cube(), Raw { start: Some(0), packed: vec![0; 300], ..cube() }], 2), "outside"),
        ("more than there are", archive(&[cube()], 7), "entries"),
        ("cut off", whole[..whole.len() - 5].to_vec(), "cannot be read"),
        ("a header alone", b"PK\x03\x04".to_vec(), "cannot be read"),
        ("nested", archive(&[Raw::stored("inner.zip", &whole)], 1), "\"inner.zip\" is a zip archive"),
        (
            "beside",
            archive(&[Raw::stored("b", b"b"), Raw::stored("inner.zip", &whole)], 2),
            "\"inner.zip\" is a zip archive",
        ),
    ];
    for (name, bytes, part) in &cases {
        let (fault, detail) = fault(bytes.clone(), &Limits::default());
        assert_eq!(fault, MeshFault::BundleBroken, "{name}: {detail}");
        assert!(detail.to_lowercase().contains(part), "{name}: {detail}");
        assert!(detail.len() < 400, "{name}: {detail}");
    }
    assert_eq!(cases.len(), 25);
    let nothing: [(&str, Vec<u8>, &str); 3] = [
        ("empty", archive(&[Raw::stored("folder/", b"")], 1), "no files"),
        (
            "pictures",
            archive(&[Raw::stored("a.png", b"\x89PNG"), Raw::stored("b.txt", b"b")], 2),
            "\"a.png\", \"b.txt\"",
        ),
        ("3MF", archive(&[Raw::stored("3D/3dmodel.model", b"<?xml"), Raw::stored("b.txt", b"<")], 2), "3dmodel.model"),
    ];
    for (name, bytes, part) in nothing {
        let (fault, detail) = fault(bytes, &Limits::default());
        assert!(fault == MeshFault::Unrecognised && detail.contains(part), "{name}: {detail}");
    }
}

#[test]
fn bombs_break_a_limit_before_they_go_off() {
    let zeros = vec![0; 64 << 20];
    let bomb = Raw::deflated("zeros.bin", &zeros);
    assert!(bomb.packed.len() * 1000 < zeros.len(), "{}", bomb.packed.len());
    let nine = (0..9).map(|i| Raw { name: format!("{i}.bin").into(), ..bomb.clone() }).collect::<Vec<_>>();
    let many: Vec<Raw> = (0..65_535).map(|i| Raw::stored(&format!("{i}"), b"")).collect();
    let small = Limits::default().with(|limits| limits.memory_bytes = 1 << 20);
    let cases: [(&str, Vec<u8>, &Limits, &str); 5] = [
        ("too large together", archive(&nine, 9), &Limits::default(), "--limit-bundle-bytes"),
        (
            "too large",
            archive(std::slice::from_ref(&bomb), 1),
            &Limits::default().with(|limits| limits.bundle_bytes = 1000),
            "--limit-bundle-bytes",
        ),
        ("too large for the job", archive(std::slice::from_ref(&bomb), 1), &small, "--limit-memory-bytes"),
        ("65,535 entries", archive(&many, 65_535), &Limits::default(), "--limit-bundle-entries"),
        ("1,001 entries", archive(&many[..1001], 1001), &Limits::default(), "--limit-bundle-entries"),
    ];
    for (name, bytes, limits, flag) in cases {
        let (fault, detail) = fault(bytes, limits);
        assert!(matches!(&fault, MeshFault::Limit(limit) if limit.flag == flag), "{name}: {detail}");
    }
    // Many entries, each a little too small to be a bomb by itself.
    let small_bomb = Raw::deflated("zeros.bin", &zeros[..15 << 20]);
    let several = (0..3).map(|i| Raw { name: format!("{i}.bin").into(), ..small_bomb.clone() }).collect::<Vec<_>>();
    let (fault_of_many, detail) = fault(archive(&several, 3), &Limits::default());
    assert!(fault_of_many == MeshFault::BundleBroken && detail.contains("and others before it"), "{detail}");
    // It says that it is small and is not.
    let (fault_of_liar, detail) = fault(archive(&[Raw { size: 1000, ..bomb.clone() }], 1), &Limits::default());
    assert!(fault_of_liar == MeshFault::BundleBroken && detail.contains("larger"), "{detail}");
    let stopped = Deadline::default();
    stopped.stop();
    let limits = Limits::default();
    let bundle = Bundle::of_one(archive(&[bomb], 1));
    let error = import(&bundle, None, &limits, &mut Budget::new(&limits), &stopped).unwrap_err();
    assert_eq!(error.fault, MeshFault::Stopped);
}

#[test]
fn archives_of_signatures_alone_end_in_time() {
    let fill = |word: &[u8], length: usize| word.iter().copied().cycle().take(length).collect::<Vec<u8>>();
    let bodies = [
        fill(b"PK\x03\x04", 16 << 20),
        [fill(b"PK\x03\x04", 4), fill(b"PK\x01\x02", 16 << 20), fill(b"PK\x05\x06", 60_000)].concat(),
        [fill(b"PK\x03\x04", 4), fill(b"PK\x06\x06", 16 << 20), fill(b"PK\x05\x06\0\0\0\0", 66_000)].concat(),
        [
            fill(b"PK\x03\x04", 4),
            vec![0; 16 << 20],
            fill(b"PK\x05\x06\0\0\0\0\x01\0\x01\0\x2e\0\0\0\x04\0\0\0\0\0", 66_000),
        ]
        .concat(),
    ];
    let count = bodies.len();
    for body in bodies {
        let (fault, detail) = fault(body, &Limits::default());
        assert_eq!(fault, MeshFault::BundleBroken, "{detail}");
    }
    assert_eq!(count, 4);
}

#[test]
fn a_server_that_got_a_bomb_goes_on() {
    let server = Server::start(&["--workers", "1", "--limit-bundle-bytes", "1000000", "--limit-bundle-entries", "3"]);
    let bomb = archive(&[Raw::deflated("zeros.obj", &vec![0; 32 << 20])], 1);
    let many: Vec<Raw> = (0..4).map(|i| Raw::stored(&format!("{i}"), b"")).collect();
    let cases: [(Vec<u8>, u16, &str, Option<&str>); 4] = [
        (bomb, 422, "limit_exceeded", Some("--limit-bundle-bytes")),
        (archive(&many, 4), 422, "limit_exceeded", Some("--limit-bundle-entries")),
        (archive(&[Raw::stored("../x.obj", CUBE_OBJ)], 1), 422, "bundle_broken", None),
        (archive(&[Raw::stored("inner.zip", &zipped(&[("x.obj", CUBE_OBJ)]))], 1), 422, "bundle_broken", None),
    ];
    let before = server.resident_bytes();
    for _ in 0..5 {
        for (body, status, code, flag) in &cases {
            let answer = server.post("/v1/render?size=16", body);
            answer.problem(*status, code);
            assert_eq!(answer.json()["flag"].as_str(), *flag);
        }
    }
    let grown = server.resident_bytes().saturating_sub(before);
    assert!(grown < 64 << 20, "{grown} bytes");
    server.post("/v1/render?size=16", &zipped(&[("cube.obj", CUBE_OBJ)])).picture(16, 16);
    let limits = server.get("/v1/capabilities").json()["limits"].take();
    assert_eq!((&limits["bundle_bytes"], &limits["bundle_entries"]), (&1_000_000.into(), &3.into()));
}

/// Every archive that is nearly right: whatever it is taken for, the reader does not panic and
/// allocates little.
#[test]
fn damaged_archives_never_panic() {
    let mtl: &[u8] = b"newmtl A\nKd 0.5\nmap_Kd -s 2 2 1 a.png\nd 0.5\nnewmtl B\nPr 0.5\nnorm -bm 2 a.png\n";
    let obj: &[u8] = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl A\nf 1/1 2/1 3/1\nusemtl B\nf 3 2 1\n";
    let honest =
        archive(&[Raw::stored("m.obj", obj), Raw::deflated("m.mtl", mtl), Raw::stored("a.png", b"\x89PNG")], 3);
    assert!(read_bundle(&Bundle::of_one(honest.clone())).is_ok());
    let limits = Limits::default().with(|limits| limits.memory_bytes = 64 << 20);
    let mut noise = Noise(7);
    let mut random = |below: usize| (noise.next() >> 33) as usize % below;
    let (mut read, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let mut bytes = honest.clone();
        for _ in 0..=random(3) {
            let at = random(bytes.len());
            match random(5) {
                0 => bytes[at] = random(256) as u8,
                1 => bytes[at] ^= 1 << random(8),
                2 => bytes[at] = [0, 0xff, 0x7f, 0x80][random(4)],
                3 => drop(bytes.drain(at..(at + 1 + random(8)).min(bytes.len()))),
                _ => bytes.splice(at..at, [random(256) as u8; 4]).for_each(drop),
            }
        }
        // Said to be an archive, since its first bytes may be gone as well.
        let read_it = || import(&Bundle::zip(bytes), None, &limits, &mut Budget::new(&limits), &Deadline::default());
        match within_bytes(128 << 20, "a changed archive", read_it) {
            Ok(_) => read += 1,
            Err(error) => {
                assert!(!error.detail.is_empty() && error.detail.len() < 2000, "{error}");
                refused += 1;
            }
        }
    }
    assert_eq!(read + refused, 20_000);
    assert!(read > 500 && refused > 500, "{read} read, {refused} refused");
}
