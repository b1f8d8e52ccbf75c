//! Compares two meshes in everything that must not depend on the format of their files.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use meshsnap_render::limits::{Budget, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::edges::EdgeList;

/// The edge list, with default limits.
pub fn edges(mesh: &Mesh) -> EdgeList {
    let limits = Limits::default();
    EdgeList::of(mesh, &mut Budget::new(&limits)).unwrap()
}

/// Fails where two meshes differ in a part that must not depend on the format.
pub fn assert_same_shape(a: &Mesh, b: &Mesh, what: &str) {
    assert_eq!(a.positions, b.positions, "{what}");
    assert_eq!(a.triangles, b.triangles, "{what}");
    assert_eq!(a.face_normals, b.face_normals, "{what}");
    assert_eq!(a.bounds, b.bounds, "{what}");
    assert_eq!(a.to_file, b.to_file, "{what}");
}
