//! Tests of the outline mesh (hull): its memory is taken from the budget before it is allocated, and the
//! work ends when the job does.

use super::*;
use crate::import::{Bundle, import};
use crate::limits::{Budget, Deadline, Limits, Stopped};
use crate::mesh::Mesh;
use crate::request::{self, Rules};
use crate::spec::BackendChoice;
use crate::spec::Spec;

/// A mesh of so many triangles that touch nothing.
fn triangles(count: usize) -> Mesh {
    use std::fmt::Write;
    let mut obj = String::new();
    for i in 0..count {
        let (x, y, z) = ((i % 300) as f64, (i / 300) as f64, (i * 7919 % 1000) as f64);
        writeln!(obj, "v {x} {y} {z}\nv {} {y} {z}\nv {x} {} {z}", x + 0.8, y + 0.7).unwrap();
        writeln!(obj, "f -3 -2 -1").unwrap();
    }
    let limits = Limits::default();
    let bundle = Bundle::of_one(obj.into_bytes());
    import(&bundle, None, &limits, &mut Budget::new(&limits), &Deadline::default()).unwrap().0
}

fn canvas(scene: &Scene<'_, '_>) -> Canvas {
    Canvas { size_px: scene.size_px(), first_vertex: scene.mesh.positions.len() as u32 }
}

/// Hulls, with a surface that hides some of them or without.
fn spec(surface: &str) -> Spec {
    let keys = [("style", "outline"), ("outline.method", "hull"), ("size", "200x160"), ("surface", surface)];
    let keys: Vec<(String, String)> = keys.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
    let rules = Rules { limits: Limits::default(), backend: BackendChoice::Auto };
    request::read(None, &keys, &rules).unwrap()
}

#[test]
fn a_hull_takes_no_more_than_it_spends() {
    for count in [1, 10, 20_000] {
        let (mesh, spec) = (triangles(count), spec("null"));
        let (mut budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
        let scene = Scene::new(&mesh, &spec, &mut budget).unwrap();
        let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
        let (list, silhouettes) = cx.silhouettes(&scene).unwrap();
        let before = cx.budget.spent_bytes();
        let view = ScreenMesh::new(&scene, &mut cx).unwrap();
        let thicknesses = [Some(Thickness::Px(3.0))];
        let edges = view.silhouette_edges(&thicknesses, &list, &silhouettes, &mut cx).unwrap();
        let outlines = OutlineView::new(&view, &thicknesses, scene.size_px(), 0);
        let parts = OutlineParts::of(&scene, &outlines, edges, OutlineMethod::Hull, &mut cx).unwrap();
        let edges = &parts.edges;
        let hull = OutlineMesh::draw(&outlines, canvas(&scene), &parts, &mut cx).unwrap();
        assert_eq!((edges.len(), edges.capacity()), (3 * count, 3 * count));
        assert!(hull.triangles.len() >= 9 * count, "{} triangles", hull.triangles.len());
        let taken = size_of::<SilhouetteEdge>() * edges.capacity()
            + size_of::<ScreenEdge>() * parts.places.capacity()
            + size_of::<VisiblePart>() * parts.drawn.capacity()
            + 2 * size_of::<EdgeEnd>() * edges.len()
            + mesh.triangles.len()
            + size_of::<ScreenVertex>() * hull.vertices.capacity()
            + 12 * hull.triangles.capacity()
            + 4 * hull.triangle_materials.capacity();
        let spent = cx.budget.spent_bytes() - before;
        assert!((taken as u64) <= spent, "{taken} bytes of {spent}");
    }
}

#[test]
fn a_budget_that_is_too_small_is_refused_at_every_step() {
    let (mesh, spec) = (triangles(500), spec("{}"));
    let plan = |memory_bytes| {
        let mut budget = Budget::new(&Limits { memory_bytes, ..Limits::default() });
        let result = Scene::new(&mesh, &spec, &mut budget)
            .map_err(PlanError::from)
            .and_then(|scene| crate::plan::build(&scene, &mut budget, &Deadline::default()).map(|_| ()));
        result.map(|()| budget.spent_bytes()).map_err(|error| error.to_string())
    };
    let enough = plan(1 << 30).unwrap();
    assert_eq!(plan(enough), Ok(enough));
    let refused: std::collections::BTreeSet<String> = (0..enough).step_by(1000).filter_map(|b| plan(b).err()).collect();
    let words = |what: &str| refused.iter().any(|error| error.contains(what));
    for what in [
        "outline's edges",
        "outline's strips",
        "outline's corners",
        "outline's triangles",
        "faces near an outline",
        "outline's chains",
        "the edges",
    ] {
        assert!(words(what), "nothing of {what}: {refused:?}");
    }
}

#[test]
fn every_step_ends_when_the_job_does() {
    let (mesh, spec) = (triangles(100), spec("{}"));
    let (mut budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    let scene = Scene::new(&mesh, &spec, &mut budget).unwrap();
    let stopped = Deadline::default();
    stopped.stop();
    let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
    let (list, silhouettes) = cx.silhouettes(&scene).unwrap();
    let view = ScreenMesh::new(&scene, &mut cx).unwrap();
    let thicknesses = [Some(Thickness::Px(3.0))];
    let edges = view.silhouette_edges(&thicknesses, &list, &silhouettes, &mut cx).unwrap();
    let outlines = OutlineView::new(&view, &thicknesses, scene.size_px(), 0);
    let parts = OutlineParts::of(&scene, &outlines, edges.clone(), OutlineMethod::Hull, &mut cx).unwrap();
    let mut late = PlanContext::new(&mut budget, &stopped, &[]);
    let results = [
        ScreenMesh::new(&scene, &mut late).err(),
        view.silhouette_edges(&thicknesses, &list, &silhouettes, &mut late).err(),
        OutlineParts::of(&scene, &outlines, edges.clone(), OutlineMethod::Hull, &mut late).err(),
        OutlineMesh::draw(&outlines, canvas(&scene), &parts, &mut late).err(),
    ];
    assert_eq!(results, [const { Some(PlanError::Stopped(Stopped)) }; 4]);
}
