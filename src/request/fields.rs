//! The table of keys: a line for each key of a request document, with what it allows and where it goes.

use std::sync::LazyLock;

use super::draft::Draft;
use super::value::{Kind, Value};
use super::words::{Words, words_of};

/// A key of the document.
pub struct Field {
    /// Dotted, such as `wire.color`.
    pub key: &'static str,
    /// What may be given.
    pub kind: Kind,
    /// Whether `null` may be given: it means "as if the key were missing".
    pub nullable: bool,
    set: Setter,
}

/// Puts a value in its place.
type Setter = Box<dyn Fn(&mut Draft, Value) + Send + Sync>;

/// A layer's name, and how it is turned on and off.
type Layer = (&'static str, fn(&mut Draft, bool));

impl Field {
    /// Puts a value that passed [`Field::kind`] into the draft.
    pub fn set(&self, draft: &mut Draft, value: Value) {
        (self.set)(draft, value);
    }

    fn nullable(mut self) -> Self {
        self.nullable = true;
        self
    }
}

/// Every key with a value. `style` is read before them, since presets come first.
pub static FIELDS: LazyLock<Vec<Field>> = LazyLock::new(|| {
    let mut fields = surface_fields();
    fields.extend(wire_fields());
    fields.extend(outline_fields());
    fields.extend(camera_fields());
    fields.extend(other_fields());
    fields
});

/// Layers: `null` turns one off, `{}` turns it on with its defaults.
pub const LAYERS: &[Layer] = &[
    ("surface", |d, on| {
        if on {
            d.surface();
        } else {
            d.spec.layers.surface = None
        }
    }),
    ("wire", |d, on| {
        if on {
            d.wire();
        } else {
            d.spec.layers.wire = None
        }
    }),
    ("outline", |d, on| {
        if on {
            d.outline();
        } else {
            d.spec.layers.outline = None
        }
    }),
];

/// Objects of the document that hold keys but are no layers.
pub const GROUPS: &[&str] = &["camera", "light", "image"];

/// Short names, and the keys they stand for.
pub const SHORT: &[(&str, &str)] = &[
    ("format", "image.format"),
    ("samples", "image.samples"),
    ("background", "image.background"),
    ("view", "camera.view"),
    ("up", "camera.up"),
];

/// Keys of the contract that this version does not draw yet.
pub const LATER: &[&str] = &[
    "surface.emissive",
    "surface.opacity",
    "surface.textures",
    "surface.debug",
    "wire.lit",
    "wire.feature_angle_deg",
    "materials",
    "camera.from_file",
    "light.direction",
    "image.max_error",
    "image.max_time_ms",
    "max_error",
    "max_time_ms",
];

fn surface_fields() -> Vec<Field> {
    vec![
        words("surface.shading", |d, v| d.surface().shading = v),
        words("surface.normals", |d, v| d.surface().normals = v),
        color("surface.color", |d, v| d.surface().color = v).nullable(),
        number("surface.metallic", 0.0, 1.0, |d, v| d.surface().metallic = Some(v)),
        number("surface.roughness", 0.0, 1.0, |d, v| d.surface().roughness = Some(v)),
        words("surface.cull", |d, v| d.surface().cull = v),
    ]
}

fn wire_fields() -> Vec<Field> {
    vec![
        words("wire.method", |d, v| d.wire().method = v),
        color("wire.color", |d, v| d.wire().color = v.unwrap_or(d.wire().color)),
        number("wire.thickness", 0.0, 100.0, |d, v| d.wire().thickness = v),
        number("wire.smoothing", 0.0, 10.0, |d, v| {
            d.wire();
            d.smoothing = Some(v);
        }),
        number("wire.opacity", 0.0, 1.0, |d, v| d.wire().opacity = v),
        words("wire.edges", |d, v| d.wire().edges = v),
        words("wire.hidden", |d, v| d.wire().hidden = v),
    ]
}

fn outline_fields() -> Vec<Field> {
    vec![
        words("outline.method", |d, v| d.outline().method = v),
        color("outline.color", |d, v| d.outline().color = v.unwrap_or(d.outline().color)),
        optional("outline.thickness", 0.0, 1e30, |d, v| d.outline().thickness = v.map(|t| t as f32)),
        words("outline.unit", |d, v| d.outline().unit = v),
    ]
}

fn camera_fields() -> Vec<Field> {
    vec![
        words("camera.view", |d, v| d.spec.camera.view = v),
        optional("camera.azimuth_deg", -3600.0, 3600.0, |d, v| d.spec.camera.azimuth_deg = v),
        optional("camera.elevation_deg", -90.0, 90.0, |d, v| d.spec.camera.elevation_deg = v),
        words("camera.projection", |d, v| d.spec.camera.projection = v),
        double("camera.fov_deg", 0.01, 179.0, |d, v| d.spec.camera.fov_deg = v),
        optional("camera.height", 1e-30, 1e30, |d, v| d.spec.camera.height = v),
        optional_words("camera.up", |d, v| d.spec.camera.up = v),
        double("camera.margin", 0.0, 0.45, |d, v| d.spec.camera.margin = v),
        point("camera.eye", |d, v| d.spec.camera.eye = v),
        point("camera.target", |d, v| d.spec.camera.target = v),
    ]
}

fn other_fields() -> Vec<Field> {
    vec![
        words("light.preset", |d, v| d.spec.light.preset = v),
        number("light.intensity", 0.0, 10.0, |d, v| d.spec.light.intensity = v),
        number("light.ambient", 0.0, 1.0, |d, v| d.ambient = Some(v)),
        pixels("image.width", |d, v| d.spec.image.width_px = v),
        pixels("image.height", |d, v| d.spec.image.height_px = v),
        size("size", |d, w, h| (d.spec.image.width_px, d.spec.image.height_px) = (w, h)),
        optional_words("image.format", |d, v| d.spec.image.format = v),
        one_of("image.samples", &[1, 4], |d, v| d.spec.image.samples = v),
        color("image.background", |d, v| d.spec.image.background = v.unwrap_or(d.spec.image.background)),
        words("backend", |d, v| d.spec.backend = v),
    ]
}

fn field(key: &'static str, kind: Kind, set: impl Fn(&mut Draft, Value) + Send + Sync + 'static) -> Field {
    Field { key, kind, nullable: false, set: Box::new(set) }
}

fn number(key: &'static str, min: f64, max: f64, set: fn(&mut Draft, f32)) -> Field {
    field(key, Kind::Number { min, max }, move |d, v| {
        if let Value::Number(v) = v {
            set(d, v as f32)
        }
    })
}

fn double(key: &'static str, min: f64, max: f64, set: fn(&mut Draft, f64)) -> Field {
    field(key, Kind::Number { min, max }, move |d, v| {
        if let Value::Number(v) = v {
            set(d, v)
        }
    })
}

fn optional(key: &'static str, min: f64, max: f64, set: fn(&mut Draft, Option<f64>)) -> Field {
    let set = move |d: &mut Draft, v| set(d, if let Value::Number(v) = v { Some(v) } else { None });
    field(key, Kind::Number { min, max }, set).nullable()
}

fn words<T: Words>(key: &'static str, set: fn(&mut Draft, T)) -> Field {
    let kind = Kind::Words { now: words_of::<T>(), later: T::LATER };
    field(key, kind, move |d, v| {
        if let Value::Word(place) = v {
            set(d, T::NOW[place].1)
        }
    })
}

fn optional_words<T: Words>(key: &'static str, set: fn(&mut Draft, Option<T>)) -> Field {
    let kind = Kind::Words { now: words_of::<T>(), later: T::LATER };
    field(key, kind, move |d, v| set(d, if let Value::Word(place) = v { Some(T::NOW[place].1) } else { None }))
        .nullable()
}

fn color(key: &'static str, set: fn(&mut Draft, Option<crate::scene::color::Rgba>)) -> Field {
    field(key, Kind::Color, move |d, v| set(d, if let Value::Color(v) = v { Some(v) } else { None }))
}

fn point(key: &'static str, set: fn(&mut Draft, Option<[f64; 3]>)) -> Field {
    field(key, Kind::Point, move |d, v| set(d, if let Value::Point(v) = v { Some(v) } else { None })).nullable()
}

fn pixels(key: &'static str, set: fn(&mut Draft, u32)) -> Field {
    field(key, Kind::Pixels, move |d, v| {
        if let Value::Whole(v) = v {
            set(d, v)
        }
    })
}

fn size(key: &'static str, set: fn(&mut Draft, u32, u32)) -> Field {
    field(key, Kind::Size, move |d, v| {
        if let Value::Size(w, h) = v {
            set(d, w, h)
        }
    })
}

fn one_of(key: &'static str, values: &'static [u32], set: fn(&mut Draft, u32)) -> Field {
    field(key, Kind::OneOf(values), move |d, v| {
        if let Value::Whole(v) = v {
            set(d, v)
        }
    })
}
