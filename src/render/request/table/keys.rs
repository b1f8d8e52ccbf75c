//! The list of all keys of a request that hold values, except `style`, `mesh` and `$schema`. The entry
//! of a key has its name, the place in the draft that it sets, the values that are allowed (if they are
//! not those of its type), its short name and its default (if it has them), and a line on what it does.

use serde_json::Value::Null;
use serde_json::json;

use super::field::{Field, fields};
use super::value::Kind;
use crate::image::DEFAULT_EFFORT;
use crate::limits::JOB_MS_MAX;
use crate::spec::{SHEET_VIEWS_MAX, TURNTABLE_STEPS, WIRE_METHODS, WireMethod};

/// A share, such as an opacity.
const SHARE: Kind = number(0.0, 1.0);

/// An angle between two faces.
const ANGLE: Kind = number(0.0, 180.0);

/// Later than any animation ends.
const TIME_S_MAX: f64 = 1e9;

const fn number(min: f64, max: f64) -> Kind {
    Kind::Number { min, max }
}

/// Every key that holds a value.
pub fn all() -> Vec<Field> {
    [layers(), topology(), scene_and_camera(), sheet(), light(), image()].into_iter().flatten().collect()
}

fn layers() -> Vec<Field> {
    fields![
        "surface.shading" |d| d.surface().shading;
            "Lighting; by default the style's, or flat.";
        "surface.normals" |d| d.surface().normals, default "face";
            "Normals of flat shading: the triangle's own, or screen-space derivatives in blocks of 2 x 2 pixels, like a GPU's dFdx.";
        "surface.crease_angle_deg" |d| d.surface().crease_angle_deg, in ANGLE, default 30;
            "Smooth shading of a mesh without vertex normals: an edge is a crease, where smoothness ends, if its faces' \
             normals differ by more than this. 180: no creases.";
        "surface.color" |d| d.surface().color;
            "Overrides the file's base colours and their textures; null keeps them. By default the style's, or null.";
        "surface.metallic" |d| d.surface().metallic, in SHARE, default Null;
            "0: paint, 1: bare metal; null: the file's, or 0.";
        "surface.roughness" |d| d.surface().roughness, in SHARE, default Null;
            "0: a mirror's highlights, 1: none; null: the file's, or 0.6.";
        "surface.emissive" |d| d.surface().emissive, default Null;
            "Light that the surface emits; null: the file's, or none.";
        "surface.opacity" |d| d.surface().opacity, in SHARE, default 1;
            "Multiplies the file's own opacity.";
        "surface.facing_opacity" |d| d.surface().facing_opacity, in SHARE;
            "Share of the opacity that is left where the surface faces the viewer; it rises to all of it at grazing angles. By \
             default the style's, or 1.";
        "surface.textures" |d| d.surface().textures, default true;
            "Shows the file's textures.";
        "surface.debug" |d| d.surface().debug, default "none";
            "A view of the mesh's data, shown instead of the surface's colour.";
        "surface.cull" |d| d.surface().cull, default "none";
            "Faces that are left out.";

        "wire.method" |d| d.wire_draft().method, default "exact";
            wire_methods();
        "wire.color" |d| d.wire().color, default "#000";
            "The lines' colour.";
        "wire.thickness" |d| d.wire().thickness, default "auto";
            "exact: full width in pixels; auto: 1, thinner where lines would cover more than about a third of the surface, \
             and fainter over its dense parts. Other methods: multiples of the method's own unit, at most 10; auto: 1.";
        "wire.smoothing" |d| d.wire_draft().smoothing, in number(0.0, 10.0);
            "exact: pixels of a ramp beyond the box filter, by default 0; fwidth and fwidth-min: width of the smoothstep in \
             multiples, by default 1.";
        "wire.opacity" |d| d.wire().opacity, in SHARE, default 1;
            "Multiplies the colour's own opacity.";
        "wire.lit" |d| d.wire().lit, default false;
            "Mixes the lines into the base colour before lighting, instead of drawing them over the lit surface.";
        "wire.edges" |d| d.wire().edges, default "polygons";
            "polygons: edges of the file's polygons; triangles: also the diagonals between them; feature: edges where the surface bends by more than \
             feature_angle_deg or ends; boundary: edges with one face.";
        "wire.feature_angle_deg" |d| d.wire().feature_angle_deg, in ANGLE, default 30;
            "For edges=feature: the smallest angle between two faces' normals that makes an edge.";
        "wire.min_length" |d| d.wire().min_length, in number(0.0, 10_000.0);
            "For edges=feature: edges that are joined at vertices and shorter in all, in pixels on screen, are not drawn; by \
             default 20 in the style technical, and 0 in others.";
        "wire.hidden" |d| d.wire_draft().hidden;
            "Edges behind a surface; by default hide, and fade in the style wireframe. Methods other than exact: the same for all \
             materials, and beside transparent materials an opaque fill still hides them.";

        "outline.method" |d| d.outline().method, default "hull";
            "hull: a border in one colour around the surface, with round corners; contour: silhouette and boundary edges as lines \
             of exact width.";
        "outline.color" |d| d.outline().color, default "#000";
            "The outline's colour.";
        "outline.thickness" |d| d.outline().thickness, in number(0.0, 1e30), default Null;
            "In `unit`, at most 100 px; null: 3 px, or in model units 0.03 for a model whose longest side is 2, and in \
             proportion for others.";
        "outline.unit" |d| d.outline().unit, default "object";
            "Model units, or pixels on screen. All hulls of one picture have the same.";
        "outline.min_length" |d| d.outline().min_length, in number(0.0, 10_000.0), default Null;
            "Lines of the outline that are shorter, in pixels, are not drawn, unless they border the background; null: in \
             proportion to the thickness.";
    ]
}

/// The description of `wire.method`, from the table of wire methods.
fn wire_methods() -> String {
    let exact = WireMethod::Exact.info();
    let others = WIRE_METHODS.iter().filter(|row| row.method != exact.method);
    let others: Vec<String> = others.map(|row| format!("{} ({})", row.name, row.about)).collect();
    let others = others.join(", ");
    format!("{}: {}; the others follow barycentric coordinates b: {others}.", exact.name, exact.about)
}

fn topology() -> Vec<Field> {
    fields![
        "topology.polygon" |d| d.topology().polygon, default "#333a4499";
            "Colour of polygons' edges.";
        "topology.crease" |d| d.topology().crease, default Null;
            "Colour of edges whose faces meet at more than crease_angle_deg; #1f6feb goes well with the others.";
        "topology.open" |d| d.topology().open, default "#f05a1e";
            "Colour of edges with one face.";
        "topology.nonmanifold" |d| d.topology().nonmanifold, default "#d01c9b";
            "Colour of edges with more than two faces, or with two faces that disagree which side is out.";
        "topology.crease_angle_deg" |d| d.topology().crease_angle_deg, in ANGLE, default 30;
            "The smallest angle between two faces' normals that makes a crease.";
        "topology.thickness" |d| d.topology().thickness, in number(0.0, 20.0), default 1;
            "Full width of polygons' edges in pixels; the others are drawn wider.";
    ]
}

fn scene_and_camera() -> Vec<Field> {
    fields![
        "points.size_px" |d| d.points.size_px, in number(0.5, 64.0), default 3;
            "Diameter of the file's points in pixels; without a surface, they are wider than the wire's lines in the proportion \
             of this to 1.5.";

        "scene.time_s" |d| d.time_s, in number(0.0, TIME_S_MAX), default Null;
            "Moment of the file's first animation, in seconds; null: the rest pose.";
        "scene.ground" |d| d.ground, default "none";
            "shadow: a soft contact shadow on a plane at the lowest point, if the picture has a filled surface; from below the \
             plane nothing shows.";

        "camera.view" |d| d.camera.view, short "view", default "auto";
            "Named directions, auto being azimuth 30, elevation 20, and iso 45, 30; azimuth_deg and elevation_deg override its angles.";
        "camera.azimuth_deg" |d| d.camera.azimuth_deg, in number(-3600.0, 3600.0), default Null;
            "Angle around the up axis: 0 is the front, 90 the right; null: the view's.";
        "camera.elevation_deg" |d| d.camera.elevation_deg, in number(-90.0, 90.0), default Null;
            "Angle above the horizon; null: the view's.";
        "camera.projection" |d| d.camera.projection, default "perspective";
            "perspective: distant objects are smaller; orthographic: they are not.";
        "camera.fov_deg" |d| d.camera.fov_deg, in number(0.01, 179.0), default 35;
            "Vertical field of view.";
        "camera.height" |d| d.camera.height, in number(1e-30, 1e30), default Null;
            "Height of an orthographic view in model units; null fits the mesh.";
        "camera.up" |d| d.camera.up, short "up", default Null;
            "The file's axis that points up; null: z for STL, y for the others.";
        "camera.margin" |d| d.camera.margin, in number(0.0, 0.45), default 0.05;
            "Free border on each side, as a share of the picture.";
        "camera.eye" |d| d.camera.eye, default Null;
            "Position in the file's coordinates; given together with target, and the mesh is then not fitted.";
        "camera.target" |d| d.camera.target, default Null;
            "The point at the picture's centre; not the same as eye.";
        "camera.from_file" |d| d.camera.from_file, default false;
            "Uses the file's own first camera; the mesh is then not fitted.";
    ]
}

fn sheet() -> Vec<Field> {
    let [steps_min, steps_max] = TURNTABLE_STEPS;
    fields![
        "sheet.views" |d| d.sheet().views, default json!(["front", "left", "top", "iso"]);
            "Named directions, a cell each. Excludes turntable, and angles and an eye of the camera.";
        "sheet.turntable" |d| d.sheet().turntable, in Kind::Count { min: steps_min, max: steps_max }, default Null;
            "Views from so many directions around the up axis, beginning with the camera's; without columns, PNG and WebP \
             show them one after the other, in three seconds, and width and height are those of each.";
        "sheet.columns" |d| d.sheet().columns, in Kind::Count { min: 1, max: SHEET_VIEWS_MAX as u32 }, default Null;
            "Columns of the grid; null: as many as rows, or one more.";
        "sheet.labels" |d| d.sheet().labels, default false;
            "Writes the name of each view into its lower left corner.";
    ]
}

fn light() -> Vec<Field> {
    fields![
        "light.preset" |d| d.light.preset, default "headlight";
            "headlight: over the viewer's shoulder; three-point: key, fill and rim lamps; studio: soft light from \
             three sides; all turn with the camera; none: ambient light alone.";
        "light.direction" |d| d.light.direction, in Kind::Direction, default Null;
            "Direction in which the key light shines, in the file's coordinates; null: the preset's.";
        "light.intensity" |d| d.light.intensity, in number(0.0, 10.0), default 1;
            "Strength of the lamps.";
        "light.ambient" |d| d.ambient, in SHARE;
            "Share of light that comes from everywhere; by default 0.18 in the styles auto, outline, technical and clay, 0.3 in the others, and 1 \
             without lamps.";
        "light.ambient_occlusion" |d| d.light.ambient_occlusion, in SHARE;
            "Darkens hollows, folds and places where parts meet: the share of light that a place goes without which is wholly \
             shut in. By default 0.6 in the styles auto, outline and technical, 1 in clay, and 0 in the others.";
    ]
}

fn image() -> Vec<Field> {
    fields![
        "image.width" |d| d.size_px[0];
            "Columns; by default 512, or the largest size that is allowed.";
        "image.height" |d| d.size_px[1];
            "Rows; by default 512, or the largest size that is allowed.";
        "size" |d| d.size_px;
            "Short for image.width and image.height: N or WxH.";
        "image.format" |d| d.image.format, short "format", default Null;
            "null: the file extension, then the Accept header, then PNG.";
        "image.samples" |d| d.samples, short "samples";
            "Visibility samples per pixel; by default 4, and 16 in pictures of at most 65,536 pixels (256 x 256) without wires. \
             adaptive: 4, and 64 or 256 points in each pixel near which faces meet that differ in \
             colour. Pictures with something transparent have 16, and points in pixels that show neither that nor an outline. \
             Pictures without opaque faces, or with barycentric wires that show through faces, have 16 alone, and a warning.";
        "image.max_error" |d| d.max_error, in Kind::Above0 { max: 255.0 }, short "max_error", default Null;
            "Largest expected error, RMSE in /255: the cheapest samples, wire.method and backend that reach it are chosen, \
             except those that are given.";
        "image.max_time_ms" |d| d.max_time_ms, in Kind::Above0 { max: JOB_MS_MAX as f64 }, default Null;
            "Longest expected time to draw, as measured on one machine: the most accurate choice within it is taken.";
        "image.background" |d| d.image.background, short "background", default "#fff";
            "Behind the mesh: a colour, or two from the upper to the lower edge, as #fff..#dde, blended in linear light. Each cell \
             of a sheet has them.";
        "image.effort" |d| d.image.effort, in Kind::OneOf(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]), default DEFAULT_EFFORT;
            "PNG: 0 to 3 encode quickly; 4 to 9 make smaller files in 5 to 100 times the time, for pictures that are stored.";
        "image.legend" |d| d.image.legend, default false;
            "For surface.debug=aspect, edge-length, curvature and uv-stretch: writes the scale of the colours into the lower right \
             corner, if the picture has room for it.";
        "backend" |d| d.backend;
            "Back-end that draws; by default the server's choice.";
    ]
}
