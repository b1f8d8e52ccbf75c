//! Keys of the layers.

use super::super::draft::Draft;
use super::{SHARE, number};
use crate::request::layer_draft::Look;
use crate::request::table::fields::{Field, optional, value, words};
use crate::request::table::value::Kind;

/// In the order of the document.
pub fn fields() -> Vec<Field> {
    [surface(), wire(), outline(), topology()].into_iter().flatten().collect()
}

fn surface() -> Vec<Field> {
    vec![
        words(
            "surface.shading",
            |l: &mut Look, v| l.surface().shading = v,
            "How it takes light; by default as the style has it, else flat.",
        ),
        words(
            "surface.normals",
            |l: &mut Look, v| l.surface().normals = v,
            "Normals of flat shading: the triangle's own, or screen-space derivatives in blocks of 2 \
             x 2 pixels, as a GPU's dFdx gives them.",
        )
        .default("face"),
        optional(
            "surface.color",
            Kind::Color,
            |l: &mut Look, v| l.surface().color = v,
            "Overrides the file's base colours and their textures; null keeps them. By default as the \
             style has it, else null.",
        ),
        optional(
            "surface.metallic",
            SHARE,
            |l: &mut Look, v| l.surface().metallic = v,
            "0: paint, 1: bare metal; null: the file's, or 0.",
        )
        .default(()),
        optional(
            "surface.roughness",
            SHARE,
            |l: &mut Look, v| l.surface().roughness = v,
            "0: a mirror's highlights, 1: none; null: the file's, or 0.6.",
        )
        .default(()),
        optional(
            "surface.emissive",
            Kind::Color,
            |l: &mut Look, v| l.surface().emissive = v,
            "Light that it gives off; null: the file's, or none.",
        )
        .default(()),
        value(
            "surface.opacity",
            SHARE,
            |l: &mut Look, v| l.surface().opacity = v,
            "Multiplies the file's own opacity.",
        )
        .default(1),
        value(
            "surface.textures",
            Kind::Flag,
            |l: &mut Look, v| l.surface().textures = v,
            "Whether the file's textures are shown.",
        )
        .default(true),
        words(
            "surface.debug",
            |l: &mut Look, v| l.surface().debug = v,
            "A view of the mesh's data, shown instead of the surface's colour.",
        )
        .default("none"),
        words("surface.cull", |l: &mut Look, v| l.surface().cull = v, "Which faces are left out.").default("none"),
    ]
}

fn wire() -> Vec<Field> {
    vec![
        words(
            "wire.method",
            |l: &mut Look, v| l.set_method(v),
            "exact: true width by coverage; the others follow barycentric coordinates b: fwidth \
             (smoothstep in multiples of |db/dx| + |db/dy|, a coordinate at a time), fwidth-min (of \
             the least one), barycentric (a share of the triangle), threshold (no smoothing).",
        )
        .default("exact"),
        value("wire.color", Kind::Color, |l: &mut Look, v| l.wire().color = v, "The lines' colour.").default("#000"),
        value(
            "wire.thickness",
            number(0.0, 100.0),
            |l: &mut Look, v| l.wire().thickness = v,
            "exact: full width in pixels; other methods: in multiples of what they measure in, at \
             most 10.",
        )
        .default(1),
        value(
            "wire.smoothing",
            number(0.0, 10.0),
            |l: &mut Look, v| l.set_smoothing(v),
            "exact: a ramp of so many pixels beyond the box filter, by default 0; fwidth and \
             fwidth-min: the smoothstep's width in multiples, by default 1.",
        ),
        value("wire.opacity", SHARE, |l: &mut Look, v| l.wire().opacity = v, "Multiplies the colour's own opacity.")
            .default(1),
        value(
            "wire.lit",
            Kind::Flag,
            |l: &mut Look, v| l.wire().lit = v,
            "Mixes the lines into the base colour before lighting, instead of drawing them over the \
             lit surface.",
        )
        .default(false),
        words(
            "wire.edges",
            |l: &mut Look, v| l.wire().edges = v,
            "Every triangle's edges; those of the file's polygons; those where the surface bends by \
             more than feature_angle_deg or ends; those with one face.",
        )
        .default("triangles"),
        value(
            "wire.feature_angle_deg",
            number(0.0, 180.0),
            |l: &mut Look, v| l.wire().feature_angle_deg = v,
            "For edges=feature: the smallest angle between two faces' normals that makes an edge.",
        )
        .default(30),
        words(
            "wire.hidden",
            |l: &mut Look, v| l.wire().hidden = v,
            "What becomes of edges behind a surface; by default hide, and fade in the style wireframe. By barycentrics: \
             the same for all parts, and beside transparent parts what an opaque fill hides stays hidden.",
        ),
    ]
}

fn outline() -> Vec<Field> {
    vec![
        words(
            "outline.method",
            |l: &mut Look, v| l.outline().method = v,
            "hull: a border in one colour around what ends, its corners round; contour: silhouette \
             and boundary edges, as lines of exact width.",
        )
        .default("hull"),
        value("outline.color", Kind::Color, |l: &mut Look, v| l.outline().color = v, "The outline's colour.")
            .default("#000"),
        optional(
            "outline.thickness",
            number(0.0, 1e30),
            |l: &mut Look, v| l.outline().thickness = v,
            "In `unit`, at most 100 px; null: 3 px, or in model units 0.03 for a model whose longest \
             side is 2, and in proportion for others.",
        )
        .default(()),
        words(
            "outline.unit",
            |l: &mut Look, v| l.outline().unit = v,
            "Model units, or pixels on screen. All hulls of one picture have the same.",
        )
        .default("object"),
    ]
}

fn topology() -> Vec<Field> {
    vec![
        optional(
            "topology.polygon",
            Kind::Color,
            |d: &mut Draft, v| d.topology().polygon = v,
            "Colour of polygons' edges.",
        )
        .default("#333a4499"),
        optional(
            "topology.crease",
            Kind::Color,
            |d: &mut Draft, v| d.topology().crease = v,
            "Colour of edges whose faces meet at more than crease_angle_deg; #1f6feb goes well with \
             the others.",
        )
        .default(()),
        optional(
            "topology.open",
            Kind::Color,
            |d: &mut Draft, v| d.topology().open = v,
            "Colour of edges with one face.",
        )
        .default("#f05a1e"),
        optional(
            "topology.nonmanifold",
            Kind::Color,
            |d: &mut Draft, v| d.topology().nonmanifold = v,
            "Colour of edges with more than two faces, or with two that disagree which side is out.",
        )
        .default("#d01c9b"),
        value(
            "topology.crease_angle_deg",
            number(0.0, 180.0),
            |d: &mut Draft, v| d.topology().crease_angle_deg = v,
            "The smallest angle between two faces' normals that makes a crease.",
        )
        .default(30),
        value(
            "topology.thickness",
            number(0.0, 20.0),
            |d: &mut Draft, v| d.topology().thickness = v,
            "Full width of polygons' edges in pixels; the others are drawn wider.",
        )
        .default(1),
    ]
}
