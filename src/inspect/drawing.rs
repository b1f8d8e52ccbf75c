//! Pictures of meshes that were judged by rules or compared: a mesh with marks where rules are broken; or one or both
//! of two meshes that were compared, seen by one camera, as they look or in the colours of their distance.

use crate::check::Place;
use crate::diff::{self, Compared};
use meshsnap_render::backend::Backends;
use meshsnap_render::caption::{Mark, Scale, draw_legend, draw_marks};
use meshsnap_render::encode;
use meshsnap_render::image::{Image, ImageFormat};
use meshsnap_render::import::MeshError;
use meshsnap_render::limits::{Budget, Deadline, LimitExceeded};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::pipeline::{
    Context, Drawn, Model, Output, PlanError, RenderError, Stage, Staged, View, draw_cells, draw_view, with_scene,
};
use meshsnap_render::plan::{self, PX, Prepared, Projection, Projector};
use meshsnap_render::scene::Scene;
use meshsnap_render::sheet::{self, Cell, Layout};
use meshsnap_render::spec::{CameraSpec, DebugView, Sheet, SheetViews, Spec};

/// Draws a mesh. If it is to be compared, the camera is fitted to what is `beside` it, too.
pub fn draw(
    model: &Model,
    beside: Option<&Model>,
    spec: &Spec,
    backends: &mut Backends,
    deadline: &Deadline,
) -> Result<Image, RenderError> {
    let mut budget = model.budget_beside(beside)?;
    let framing = framing_with(model, beside, &mut budget)?;
    let mut cx = Context { backends, budget, deadline, ended: &mut |_| () };
    Ok(draw_view(View { framing: framing.as_deref(), ..model.view() }, spec, None, &mut cx)?.image)
}

/// A request whose camera takes this mesh's word for what is up.
pub fn with_up(model: &Model, spec: &Spec) -> Spec {
    let up = Some(spec.camera.up.unwrap_or(model.mesh().up));
    Spec { camera: CameraSpec { up, ..spec.camera }, ..spec.clone() }
}

/// Marks places of faults in a picture of a mesh, drawn with the same mesh beside it. Those that are hidden are marked,
/// too.
pub fn mark(
    image: &mut Image,
    model: &Model,
    beside: Option<&Model>,
    spec: &Spec,
    places: &[Place],
    deadline: &Deadline,
) -> Result<(), RenderError> {
    let mut budget = model.budget_beside(beside)?;
    let framing = framing_with(model, beside, &mut budget)?;
    mark_in(image, View { framing: framing.as_deref(), ..model.view() }, spec, places, &mut budget, deadline)
}

/// The places to which a camera is fitted that shows this mesh and another. None: there is no other.
fn framing_with(
    model: &Model,
    beside: Option<&Model>,
    budget: &mut Budget,
) -> Result<Option<Vec<[f32; 3]>>, MeshError> {
    Ok(beside.map(|other| diff::framing(model.mesh(), other.mesh(), budget)).transpose()?)
}

/// Marks places in a picture of a view.
fn mark_in(
    image: &mut Image,
    view: View<'_>,
    spec: &Spec,
    places: &[Place],
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<(), RenderError> {
    // Places in space are nowhere in a layout of the texture.
    if spec.layers.surface.is_some_and(|surface| surface.debug == DebugView::UvLayout) {
        return Ok(());
    }
    with_scene(view, spec, false, budget, deadline, |Staged { scene, .. }, _| {
        mark_places(image, &scene, places);
        Ok(())
    })
}

/// Marks places in a picture of a scene.
fn mark_places(image: &mut Image, scene: &Scene<'_, '_>, places: &[Place]) {
    let projector = Projector::new(&Projection::new(&scene.camera, [image.width_px, image.height_px]));
    let middle = [f64::from(image.width_px) / 2.0, f64::from(image.height_px) / 2.0];
    // A fault that is too near to be drawn is marked all the same, if it lies before the eye.
    let near_w = scene.camera.near.min(1e-3);
    let on_image = |position: &[f64; 3]| -> Option<[f64; 2]> {
        let to_file = &scene.mesh.to_file;
        let at: [f64; 3] = std::array::from_fn(|k| (position[k] - to_file.centre[k]) / to_file.scale);
        let [x, y, _] = projector.on_screen(at, near_w)?;
        (x.is_finite() && y.is_finite()).then(|| [middle[0] + x / PX, middle[1] + y / PX])
    };
    let marks: Vec<Mark> = places.iter().filter_map(|place| marks_of(place, on_image)).flatten().collect();
    draw_marks(image, &marks);
}

/// The marks of a place. None if a part of it is beyond the eye.
fn marks_of(place: &Place, on_image: impl Fn(&[f64; 3]) -> Option<[f64; 2]>) -> Option<Vec<Mark>> {
    Some(match place {
        Place::Vertex(at) => vec![Mark::Dot(on_image(at)?)],
        Place::Edge([a, b]) => vec![Mark::Line([on_image(a)?, on_image(b)?])],
        Place::Face([a, b, c]) => {
            let [a, b, c] = [on_image(a)?, on_image(b)?, on_image(c)?];
            vec![Mark::Line([a, b]), Mark::Line([b, c]), Mark::Line([c, a])]
        }
    })
}

/// A picture of one of two meshes that were compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The older mesh as it looks.
    Before,
    /// The newer one as it looks.
    After,
    /// The older one in the colours of its distance from the newer one.
    HeatBefore,
    /// The newer one in the colours of its distance from the older one.
    HeatAfter,
}

impl Side {
    /// The number of the mesh.
    fn index(self) -> usize {
        usize::from(matches!(self, Self::After | Self::HeatAfter))
    }

    /// True if the colours are those of distances.
    fn has_colors(self) -> bool {
        matches!(self, Self::HeatBefore | Self::HeatAfter)
    }

    fn label(self) -> &'static str {
        ["before", "after"][self.index()]
    }
}

/// Draws pictures of two meshes that were compared beside each other, all through one camera that is fitted to both.
/// `spec` is the request of the pictures in colours of distances, `plain` that of the others, and says its size.
pub fn draw_difference(
    models: [&Model; 2],
    compared: &Compared,
    sides: &[Side],
    spec: &Spec,
    plain: &Spec,
    backends: &mut Backends,
    deadline: &Deadline,
) -> Result<Drawn, RenderError> {
    let budget = models[0].budget_beside(Some(models[1]))?;
    let meshes = models.map(Model::mesh);
    let all = compared.of_vertices.iter().flatten();
    let most = all.copied().filter(|distance| distance.is_finite()).fold(0.0, f64::max);
    // The newer mesh says what is up, so that the camera is one.
    let spec = with_up(models[1], spec);
    let camera = CameraSpec { up: spec.camera.up, ..plain.camera };
    let plain = Spec { image: spec.image, camera, ..plain.clone() };
    let views = SheetViews::Named(vec![spec.camera.view; sides.len()]);
    let sheet = Sheet { views, columns: Some(sides.len() as u32), labels: false };
    let draw_side = |cell: Option<&Cell>, cx: &mut Context<'_>| {
        let limit = |error| RenderError::from(PlanError::Limit(error));
        // A picture of one pixel has no room for several sides.
        let Some((cell, side)) = cell.and_then(|cell| Some((cell, sides[cell.view? as usize]))) else {
            return draw_view(models[1].view(), &plain, None, cx);
        };
        let index = side.index();
        let framing = diff::framing(meshes[index], meshes[1 - index], &mut cx.budget).map_err(limit)?;
        let view = View { framing: Some(&framing), ..models[index].view() };
        if !side.has_colors() {
            return draw_view(view, &sheet::cell_spec(&plain, &sheet, cell), None, cx);
        }
        let of_view = sheet::cell_spec(&spec, &sheet, cell);
        let mesh = heat(meshes[index], compared, index, most, &mut cx.budget).map_err(limit)?;
        let painted = View { mesh: &mesh, prepared: &Prepared::default(), framing: Some(&framing) };
        let mut drawn = draw_view(painted, &of_view, None, cx)?;
        if let Some(place) = compared.hidden_place(index) {
            mark_in(&mut drawn.image, view, &of_view, &[Place::Vertex(place)], &mut cx.budget, deadline)?;
        }
        Ok(drawn)
    };
    // One side in colours stands beside pictures of both.
    let label = |view: u32| match sides {
        [Side::HeatBefore] => Some("before: distance".to_owned()),
        [Side::HeatAfter] => Some("after: distance".to_owned()),
        _ => Some(sides[view as usize].label().to_owned()),
    };
    let mut cx = Context { backends, budget, deadline, ended: &mut |_| () };
    let mut all = draw_cells(Layout::new(&sheet, &spec.image, false), &mut cx, draw_side, label)?;
    // Where no vertex has a distance, there is one colour.
    if most > 0.0 && sides.iter().any(|side| side.has_colors()) {
        let plan::Legend { title, ends, colors } = diff::legend(most);
        draw_legend(&mut all.image, &[Scale { title, ends, colors: &colors }]);
    }
    Ok(all)
}

fn heat(mesh: &Mesh, compared: &Compared, side: usize, most: f64, budget: &mut Budget) -> Result<Mesh, LimitExceeded> {
    diff::painted(mesh, &compared.of_vertices[side], most, budget)
}

/// Both sides in the colours of their distance, as the bytes of a picture.
pub fn render_difference(
    models: [&Model; 2],
    compared: &Compared,
    spec: &Spec,
    backends: &mut Backends,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Output, RenderError> {
    let sides = [Side::HeatBefore, Side::HeatAfter];
    let drawn = draw_difference(models, compared, &sides, spec, spec, backends, deadline)?;
    ended(Stage::Render);
    let format = spec.image.format.unwrap_or(ImageFormat::Png);
    let bytes = encode::encode(&drawn.image, format, spec.image.effort, deadline)?;
    ended(Stage::Encode);
    Ok(Output { bytes, format, report: drawn.report })
}
