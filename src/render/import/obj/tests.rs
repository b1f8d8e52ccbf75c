//! Tests of the OBJ importer, above all that the mesh does not depend on the size of the parts that
//! a text is cut into, on the number of threads, or on which of the two ways (fast or general)
//! parses a line.

use super::assemble::Summary;
use super::read_text;
use crate::import::bundle::{Bundle, entry};
use crate::import::context::Context;
use crate::import::raw::RawMesh;
use crate::import::test_random::Random;
use crate::import::{Format, MeshError};
use crate::limits::{Budget, Deadline, Limits};

/// Everything that a text becomes, or its error.
fn read(text: &str, part_bytes: usize, is_quick: bool) -> String {
    match try_read(text, part_bytes, is_quick) {
        Ok((summary, raw)) => format!("{summary:?} {raw:?}"),
        Err(error) => format!("{error:?}"),
    }
}

fn try_read(text: &str, part_bytes: usize, is_quick: bool) -> Result<(Summary, RawMesh), MeshError> {
    let limits = Limits::default();
    let (mut budget, deadline) = (Budget::new(&limits), Deadline::default());
    let files = Bundle::of_one(text.as_bytes().to_vec()).into_files();
    let (folder, _) = entry::choose(files, &Bundle::default(), Some(Format::Obj), &deadline).unwrap();
    let mut cx = Context {
        limits: &limits,
        budget: &mut budget,
        deadline: &deadline,
        bundle: &folder,
        time_s: None,
        counts_loose: false,
    };
    let mut raw = RawMesh::default();
    let summary = read_text(text.as_bytes(), part_bytes, is_quick, &mut raw, &mut cx)?;
    Ok((summary, raw))
}

impl Random {
    fn number(&mut self) -> String {
        let whole = self.below(2_000_000) as f64 - 1e6;
        match self.below(12) {
            0 => format!("{}", whole / 7.0),
            1 => format!("{:e}", whole / 3.0),
            2 => "nan".into(),
            3 => format!("{whole:+}."),
            _ => format!("{:.*}", self.below(7) as usize, whole / 1e4),
        }
    }

    fn corner(&mut self, counts: [u64; 3]) -> String {
        let mut index = |count: u64| {
            let index = self.below(count) + 1;
            if self.below(8) == 0 { format!("-{}", count + 1 - index) } else { index.to_string() }
        };
        let [v, vt, vn] = counts.map(&mut index);
        match self.below(4) {
            0 => v,
            1 => format!("{v}/{vt}"),
            2 => format!("{v}//{vn}"),
            _ => format!("{v}/{vt}/{vn}"),
        }
    }

    fn line(&mut self, counts: &mut [u64; 3]) -> String {
        let numbers = |random: &mut Self, n: u64| (0..n).map(|_| random.number()).collect::<Vec<_>>().join(" ");
        match self.below(40) {
            0 => format!("usemtl {}", ["a", "b", "c d # e"][self.below(3) as usize]),
            1 => "# a comment \\".into(),
            2 => format!("l {} {}", self.corner(*counts), self.corner(*counts)),
            3 => format!("p {}", self.corner(*counts)),
            4 => format!("f {}", self.corner(*counts)),
            5 => "s off".into(),
            6 => "mtllib x.mtl".into(),
            7..14 => {
                counts[0] += 1;
                let more = [3, 3, 3, 3, 4, 6][self.below(6) as usize];
                format!("v {}", numbers(self, more))
            }
            14..17 => {
                counts[1] += 1;
                let more = 1 + self.below(3);
                format!("vt {}", numbers(self, more))
            }
            17..20 => {
                counts[2] += 1;
                format!("vn {}", numbers(self, 3))
            }
            _ => {
                let form = self.corner(*counts);
                let slashes = form.matches('/').count();
                let mut corners = vec![form];
                while corners.len() < 3 + self.below(3) as usize {
                    let other = self.corner(*counts);
                    // Faces mostly have corners of one kind.
                    if other.matches('/').count() == slashes || self.below(50) == 0 {
                        corners.push(other);
                    }
                }
                format!("f {}", corners.join([" ", "  ", "\t", " \\\n"][(self.below(16) / 5) as usize]))
            }
        }
    }

    fn text(&mut self, lines: usize) -> String {
        let mut text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n".to_owned();
        let mut counts = [3, 1, 1];
        for _ in 0..lines {
            text += &self.line(&mut counts);
            text += ["\n", "\n", "\n", "\r\n", " \n", " # c\n"][self.below(6) as usize];
        }
        text
    }
}

#[test]
fn parts_threads_and_both_ways_agree() {
    let mut random = Random(0x0123_4567_89AB_CDEF);
    let (mut meshes, mut errors) = (0, 0);
    for round in 0..60 {
        let mut text = random.text(300);
        if round % 3 == 0 {
            // Something is broken somewhere.
            let at = random.below(text.len() as u64) as usize;
            text.insert_str(at, ["\nf 1 2 999999\n", "\nv 1 2\n", "\nf 1 2 -9999\n", "x"][random.below(4) as usize]);
        }
        let expected = read(&text, usize::MAX, false);
        if expected.starts_with("MeshError") {
            errors += 1
        } else {
            meshes += 1
        }
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for part_bytes in [1, 50, 2000, usize::MAX] {
                for is_quick in [false, true] {
                    let given = pool.install(|| read(&text, part_bytes, is_quick));
                    assert!(given == expected, "{threads} threads, parts of {part_bytes}, {is_quick}: {text}");
                }
            }
        }
    }
    assert!(meshes >= 30 && errors >= 8, "{meshes} meshes, {errors} errors");
}

#[test]
fn too_much_work_is_left_to_one_thread() {
    // Each polygon keeps every ear test busy; together they take more tests than a file may.
    let mut text = String::new();
    for i in 0..4000 {
        let r = if i % 2 == 0 { 1.0 } else { 1.0 + f64::from(i) };
        let a = f64::from(i) * 0.7;
        text += &format!("v {} {} 0\n", r * libm::cos(a), r * libm::sin(a));
    }
    let polygon: String = (1..=4000).map(|i| format!(" {i}")).collect();
    text += &format!("f{polygon}\n").repeat(16);
    let whole = read(&text, usize::MAX, true);
    assert!(whole.contains("polygons_fanned"), "{}", &whole[..200]);
    assert!(read(&text, 10_000, true) == whole);
}

#[test]
fn attributes_of_vertices_are_those_of_corners() {
    let count = 300;
    let lists: String =
        (0..count).map(|i| format!("v {i} {} 0\nvt {} 0.{i}\nvn 0 {i} 1\n", i % 7, f64::from(i) / 7.0)).collect();
    for form in ["a/a/a", "a/a", "a//a"] {
        // Not all vertices are used, and none in order.
        let corner = |i: u32| format!(" {}", form.replace('a', &(i * 7 % 250 + 1).to_string()));
        let face = |i: u32| format!("f{}\n", (i..i + 3 + i % 2).map(corner).collect::<String>());
        let faces: String = (0..400).map(face).collect();
        // One texture coordinate and one normal more than vertices, and they belong to corners.
        for more in ["", "vt 0 0\nvn 0 0 1\n"] {
            let resolved = |text: &str| {
                let raw = try_read(text, 500, true).unwrap().1;
                let corner = |v: &u32| {
                    let v = *v as usize;
                    (raw.positions[v], raw.uvs.get(v).copied(), raw.normals.get(v).copied())
                };
                let corners: Vec<_> = raw.triangles.iter().flatten().map(corner).collect();
                (format!("{corners:?}"), raw.positions.len())
            };
            let (given, vertices) = resolved(&format!("{lists}{more}{faces}"));
            let (expected, _) = resolved(&format!("{lists}vt nan 0\nvn 0 0 1\n{faces}"));
            assert!(given == expected, "{form}");
            assert_eq!(vertices, if more.is_empty() { count as usize } else { 250 }, "{form}");
        }
    }
}
