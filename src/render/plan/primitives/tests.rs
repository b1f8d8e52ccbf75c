//! Tests of the triangles that stand for lines and points: their memory is taken from the budget before
//! it is allocated, and the mesh stays as it is.

use super::geometry;
use crate::limits::{Budget, Deadline, Limits};
use crate::mesh::primitives::triangles;
use crate::mesh::{LineOrPoint, Mesh};
use crate::plan::SharedSlice;
use crate::plan::context::PlanContext;
use crate::request::{self, Rules};
use crate::scene::Scene;
use crate::spec::BackendChoice;

/// A triangle with a normal per corner, and so many points and lines.
fn mesh(primitive_count: usize) -> Mesh {
    let ends = |i: usize| if i.is_multiple_of(2) { [0, 0] } else { [0, 1] };
    Mesh {
        positions: vec![[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]],
        triangles: vec![[0, 1, 2]],
        face_normals: vec![[0.0, 0.0, 1.0]],
        edge_masks: vec![0b111],
        triangle_materials: vec![0],
        materials: vec![Default::default()],
        attribute_triangles: vec![[0, 1, 2]],
        normals: vec![[0.0, 0.0, 1.0]; 3],
        lines_and_points: (0..primitive_count).map(|i| LineOrPoint { ends: ends(i), material: 0 }).collect(),
        line_point_attributes: (0..primitive_count).map(ends).collect(),
        ..Mesh::default()
    }
}

#[test]
fn a_geometry_takes_no_more_than_it_spends() {
    let rules = Rules { limits: Limits::default(), backend: BackendChoice::Auto };
    let spec = request::read(None, &[("style".to_owned(), "flat".to_owned())], &rules).unwrap();
    for count in [0, 1, 1000] {
        let mesh = mesh(count);
        let (mut budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
        let scene = Scene::new(&mesh, &spec, &mut budget).unwrap();
        let before = budget.spent_bytes();
        let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
        let geometry = geometry(&scene, &mut cx).unwrap();
        let spent = cx.budget.spent_bytes() - before;
        assert_eq!(geometry.triangles.len(), 1 + triangles(&mesh.lines_and_points) as usize);
        assert_eq!(geometry.triangles[0], [0, 1, 2]);
        let taken = bytes(&geometry.positions)
            + bytes(&geometry.triangles)
            + bytes(&geometry.face_normals)
            + bytes(&geometry.triangle_materials)
            + bytes(&geometry.attribute_triangles)
            + bytes(&geometry.normals);
        assert!(taken <= spent, "{taken} bytes of {spent}");
        assert_eq!(taken == 0, count == 0, "without primitives everything is borrowed");
    }
}

fn bytes<T>(slice: &SharedSlice<'_, T>) -> u64 {
    match slice {
        SharedSlice::Borrowed(_) => 0,
        SharedSlice::Owned(list) => (list.capacity() * size_of::<T>()) as u64,
    }
}
