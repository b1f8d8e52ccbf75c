//! Keys of the scene, the camera, the light and the picture.

use super::super::draft::Draft;
use super::{SHARE, number};
use crate::limits::JOB_MS_MAX;
use crate::request::table::fields::{Field, optional, optional_words, value, words};
use crate::request::table::value::Kind;

/// In the order of the document.
pub fn fields() -> Vec<Field> {
    [scene(), camera(), light(), image()].into_iter().flatten().collect()
}

fn scene() -> Vec<Field> {
    vec![
        optional(
            "scene.time_s",
            number(0.0, TIME_S_MAX),
            |d: &mut Draft, v| d.time_s = v,
            "Moment of the file's first animation, in seconds; null: the file without its animations.",
        )
        .default(()),
    ]
}

/// Later than any animation ends.
const TIME_S_MAX: f64 = 1e9;

fn camera() -> Vec<Field> {
    vec![
        words(
            "camera.view",
            |d: &mut Draft, v| d.camera.view = v,
            "Named directions; azimuth_deg and elevation_deg override its angles.",
        )
        .default("iso"),
        optional(
            "camera.azimuth_deg",
            number(-3600.0, 3600.0),
            |d: &mut Draft, v| d.camera.azimuth_deg = v,
            "Angle around the up axis: 0 is the front, 90 the right; null: the view's.",
        )
        .default(()),
        optional(
            "camera.elevation_deg",
            number(-90.0, 90.0),
            |d: &mut Draft, v| d.camera.elevation_deg = v,
            "Angle above the horizon; null: the view's.",
        )
        .default(()),
        words("camera.projection", |d: &mut Draft, v| d.camera.projection = v, "How depth becomes size.")
            .default("perspective"),
        value(
            "camera.fov_deg",
            number(0.01, 179.0),
            |d: &mut Draft, v| d.camera.fov_deg = v,
            "Vertical field of view.",
        )
        .default(35),
        optional(
            "camera.height",
            number(1e-30, 1e30),
            |d: &mut Draft, v| d.camera.height = v,
            "Height of an orthographic view in model units; null fits.",
        )
        .default(()),
        optional_words(
            "camera.up",
            |d: &mut Draft, v| d.camera.up = v,
            "The file's axis that points up; null: z for STL, y for the others.",
        )
        .default(()),
        value(
            "camera.margin",
            number(0.0, 0.45),
            |d: &mut Draft, v| d.camera.margin = v,
            "Free border on each side, as a share of the picture.",
        )
        .default(0.05),
        optional(
            "camera.eye",
            Kind::Point,
            |d: &mut Draft, v| d.camera.eye = v,
            "Position in the file's coordinates; given together with target, and then nothing is fitted.",
        )
        .default(()),
        optional(
            "camera.target",
            Kind::Point,
            |d: &mut Draft, v| d.camera.target = v,
            "The point at the picture's centre; not the same as eye.",
        )
        .default(()),
        value(
            "camera.from_file",
            Kind::Flag,
            |d: &mut Draft, v| d.camera.from_file = v,
            "Looks through the file's own first camera; nothing is fitted.",
        )
        .default(false),
    ]
}

fn light() -> Vec<Field> {
    vec![
        words(
            "light.preset",
            |d: &mut Draft, v| d.light.preset = v,
            "headlight: over the viewer's shoulder; three-point: key, fill and rim, which turn with \
             the camera; none: ambient light alone.",
        )
        .default("headlight"),
        optional(
            "light.direction",
            Kind::Direction,
            |d: &mut Draft, v| d.light.direction = v,
            "Where the key light shines, in the file's coordinates; null: as the preset has it.",
        )
        .default(()),
        value("light.intensity", number(0.0, 10.0), |d: &mut Draft, v| d.light.intensity = v, "Strength of the lamps.")
            .default(1),
        value(
            "light.ambient",
            SHARE,
            |d: &mut Draft, v| d.ambient = Some(v),
            "Share of light that comes from everywhere; by default 0.3, and 1 without lamps.",
        ),
    ]
}

fn image() -> Vec<Field> {
    vec![
        value(
            "image.width",
            Kind::Pixels,
            |d: &mut Draft, v| d.image.width_px = v,
            "Columns; by default 512, or the largest size that is allowed.",
        ),
        value(
            "image.height",
            Kind::Pixels,
            |d: &mut Draft, v| d.image.height_px = v,
            "Rows; by default 512, or the largest size that is allowed.",
        ),
        value(
            "size",
            Kind::Size,
            |d: &mut Draft, [width, height]: [u32; 2]| (d.image.width_px, d.image.height_px) = (width, height),
            "Short for image.width and image.height: N or WxH.",
        ),
        optional_words(
            "image.format",
            |d: &mut Draft, v| d.image.format = v,
            "null: the file extension, then the Accept header, then PNG.",
        )
        .default(()),
        value(
            "image.samples",
            Kind::OneOf(&[1, 4, 8, 16]),
            |d: &mut Draft, v| (d.image.samples, d.open.samples) = (v, false),
            "Visibility samples a pixel.",
        )
        .default(4),
        optional(
            "image.max_error",
            Kind::Above0 { max: 255.0 },
            |d: &mut Draft, v| d.max_error = v,
            "Largest expected error, RMSE in /255: the cheapest samples, wire.method and backend that meet it are chosen, \
             but for those that are given.",
        )
        .default(()),
        optional(
            "image.max_time_ms",
            Kind::Above0 { max: JOB_MS_MAX as f64 },
            |d: &mut Draft, v| d.max_time_ms = v,
            "Longest expected time to draw, by a table of one machine: the most accurate that is within it is chosen.",
        )
        .default(()),
        value("image.background", Kind::Color, |d: &mut Draft, v| d.image.background = v, "What is behind the mesh.")
            .default("#fff"),
        words(
            "backend",
            |d: &mut Draft, v| (d.backend, d.open.backend) = (v, false),
            "Who draws; by default the server's choice.",
        ),
    ]
}
