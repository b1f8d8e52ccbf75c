//! Tests that triangles without indices (as in STL) become the same mesh as the same triangles with
//! indices, on any number of threads, and that unused vertices change nothing.

use super::normalise;
use crate::import::bundle::{Bundle, entry};
use crate::import::context::Context;
use crate::import::polygon::ALL_EDGES;
use crate::import::raw::{RawMesh, Soup};
use crate::import::{Format, ImportReport};
use crate::limits::{Budget, Deadline, Limits};
use crate::mesh::Mesh;
use bytes::Bytes;

/// Bytes of a record, of which 36 are corners.
const RECORD_BYTES: usize = 41;

/// A bumpy open surface of `side` by `side` squares; some of its triangles have a NaN, no area, or only
/// one that rounding takes away. Bad ones are left out if `odd` is 0.
fn corners(side: u32, odd: u32) -> Vec<[f32; 9]> {
    let at = |x: u32, y: u32| [x as f32, y as f32, (x * y % 5) as f32 - 0.0];
    let mut all = Vec::new();
    for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        for [p, q, r] in [[a, b, c], [a, c, d]] {
            let mut triangle = [p[0], p[1], p[2], q[0], q[1], q[2], r[0], r[1], r[2]];
            match (all.len() as u32 * 7 + y) % 50 {
                1 if odd > 0 => triangle[4] = f32::NAN,
                2 if odd > 0 => triangle[8] = f32::INFINITY,
                3 if odd > 0 => triangle.copy_within(0..3, 3),
                4 if odd > 1 => triangle[3..].copy_from_slice(&[p[0], p[1], p[2] + 1e-7, p[0], p[1] + 1e-7, p[2]]),
                5 => triangle[2] = -0.0,
                _ => {}
            }
            all.push(triangle);
        }
    }
    all
}

fn raw(corners: &[[f32; 9]], is_soup: bool) -> RawMesh {
    let count = corners.len();
    let mut raw = RawMesh { is_f32: true, edge_masks: vec![ALL_EDGES; count], ..RawMesh::default() };
    raw.triangle_materials = (0..count as u32).map(|i| i % 3).collect();
    raw.colors = (0..3 * count).map(|i| [i as f32 / (3 * count) as f32, 0.0, 0.0, 1.0]).collect();
    if is_soup {
        let record = |c: &[f32; 9]| [&[7; 5][..], &c.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>()].concat();
        let records: Vec<u8> = corners.iter().flat_map(record).collect();
        raw.soup = Some(Soup::new(Bytes::from(records), RECORD_BYTES, 5));
    } else {
        let positions = corners.iter().flat_map(|c| [[c[0], c[1], c[2]], [c[3], c[4], c[5]], [c[6], c[7], c[8]]]);
        raw.positions = positions.map(|p| p.map(f64::from)).collect();
        raw.triangles = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    }
    raw
}

fn finish(raw: RawMesh) -> (Mesh, ImportReport) {
    let limits = Limits::default();
    let (mut budget, deadline) = (Budget::new(&limits), Deadline::default());
    let (folder, _) =
        entry::choose(Bundle::of_one("x").into_files(), &Bundle::default(), Some(Format::Obj), &deadline).unwrap();
    let mut cx = Context {
        limits: &limits,
        budget: &mut budget,
        deadline: &deadline,
        bundle: &folder,
        time_s: None,
        counts_loose: false,
    };
    normalise(raw, &mut cx).unwrap()
}

#[test]
fn soups_and_indices_agree_on_any_number_of_threads() {
    let mut dropped = Vec::new();
    for (side, odd) in [(3, 0), (150, 0), (150, 1), (150, 2)] {
        let corners = corners(side, odd);
        let mut first: Option<String> = None;
        for threads in [1, 4] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for is_soup in [false, true] {
                let (mesh, report) = pool.install(|| finish(raw(&corners, is_soup)));
                let all = format!("{mesh:?} {report:?}");
                assert!(all == *first.get_or_insert(all.clone()), "{side} {odd}: {threads} threads, soup: {is_soup}");
                let left = mesh.triangles.len() as u64;
                let [nonfinite, degenerate] = [report.dropped_nonfinite_faces, report.dropped_degenerate_faces];
                dropped = vec![nonfinite, degenerate, report.dropped_collapsed_faces];
                assert_eq!(left + dropped.iter().sum::<u64>(), corners.len() as u64);
            }
        }
        assert_eq!(dropped.iter().filter(|count| **count > 0).count() as u32, [0, 2, 3][odd as usize], "{dropped:?}");
    }
    assert!(dropped[0] > 100 && dropped[1] > 100, "{dropped:?}");
}

#[test]
fn what_no_face_uses_changes_nothing() {
    let mesh = |unused: &[[f64; 3]]| {
        let corners = corners(20, 0);
        let mut raw = raw(&corners, false);
        raw.positions.iter_mut().flatten().for_each(|c| *c *= 0.1);
        raw.colors.clear();
        raw.positions.extend(unused);
        let (mesh, report) = finish(raw);
        format!("{mesh:?} {report:?}")
    };
    let plain = mesh(&[]);
    // The first decides at what scale faces are picked first.
    for unused in [[1e30 + 0.1, 0.1, 0.1], [0.1, f64::INFINITY, 0.1], [f64::NAN; 3], [1e-30; 3]] {
        assert!(mesh(&[unused]) == plain, "{unused:?}");
    }
}
