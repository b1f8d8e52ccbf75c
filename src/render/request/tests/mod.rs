//! Tests of the reader of requests: documents and dotted keys, and the specs that they become.

mod materials;
mod refused;

use super::*;
use crate::mesh::UpAxis;
use crate::spec::color::Rgba;
use crate::spec::{
    Background, DebugView, FlatNormals, Hidden, LightPreset, NamedView, Outline, OutlineMethod, OutlineUnit, Samples,
    Shading, Sheet, SheetViews, WireEdges, WireMethod, WireThickness,
};

pub fn rules() -> Rules {
    Rules { limits: Limits::default(), backend: BackendChoice::Auto }
}

pub fn query(pairs: &[(&str, &str)]) -> Result<Spec, RequestError> {
    let pairs: Vec<_> = pairs.iter().map(|&(k, v)| (k.to_owned(), v.to_owned())).collect();
    read(None, &pairs, &rules())
}

pub fn json(text: &str) -> Result<Spec, RequestError> {
    read(Some(text.as_bytes()), &[], &rules())
}

fn is_layer(name: &str) -> bool {
    table::section(name).is_some_and(|section| section.turn.is_some())
}

#[test]
fn every_style_has_its_layers() {
    let cases = [
        ("auto", Some(Shading::Smooth), None, false),
        ("flat", Some(Shading::Flat), None, false),
        ("smooth", Some(Shading::Smooth), None, false),
        ("unlit", Some(Shading::Unlit), None, false),
        ("wire", Some(Shading::Flat), Some(Hidden::Hide), false),
        ("wireframe", None, Some(Hidden::Fade), false),
        ("outline", Some(Shading::Smooth), None, true),
        ("hidden-line", Some(Shading::Unlit), Some(Hidden::Hide), false),
        ("topology", Some(Shading::Flat), None, false),
        ("technical", Some(Shading::Smooth), Some(Hidden::Hide), true),
        ("clay", Some(Shading::Smooth), None, false),
        ("xray", Some(Shading::Unlit), None, false),
    ];
    assert_eq!(cases.len(), Style::ALL.len());
    for (style, shading, hidden, outline) in cases {
        let spec = query(&[("style", style)]).unwrap();
        assert_eq!(spec.layers.surface.map(|s| s.shading), shading, "{style}");
        assert_eq!(spec.layers.wire.map(|w| w.hidden), hidden, "{style}");
        assert_eq!(spec.layers.outline.is_some(), outline, "{style}");
        assert_eq!(spec.topology.is_some(), style == "topology");
        if let Some(wire) = spec.layers.wire {
            assert_eq!((wire.method, wire.thickness, wire.smoothing), (WireMethod::Exact, WireThickness::Auto, 0.0));
        }
    }
    assert_eq!(query(&[]).unwrap(), query(&[("style", "auto")]).unwrap());
}

#[test]
fn the_default_size_keeps_to_the_limit() {
    let limits = Limits { image_px: 100, ..Limits::default() };
    let image = |pairs: &Overrides| {
        let spec = read(None, pairs, &Rules { limits: limits.clone(), backend: BackendChoice::Auto }).unwrap();
        (spec.image.width_px, spec.image.height_px)
    };
    assert_eq!(image(&[]), (100, 100));
    assert_eq!(image(&[("image.width".to_owned(), "50".to_owned())]), (50, 100));
    let spec = query(&[]).unwrap();
    assert_eq!((spec.image.width_px, spec.image.height_px), (512, 512));
}

#[test]
fn null_turns_a_layer_off_and_presence_turns_it_on() {
    assert!(json(r#"{"style":"wire","surface":null}"#).unwrap().layers.surface.is_none());
    assert!(json(r#"{"style":"flat","wire":{}}"#).unwrap().layers.wire.is_some());
    assert!(json(r#"{"wire":{"opacity":0.5}}"#).unwrap().layers.wire.is_some());
    assert!(query(&[("style", "outline"), ("outline", "null")]).unwrap().layers.outline.is_none());
    assert!(query(&[("outline", "{}")]).unwrap().layers.outline.is_some());
    assert!(query(&[("topology", "{}")]).unwrap().topology.is_some());
    assert!(json(r#"{"style":"topology","topology":null}"#).unwrap().topology.is_none());
    assert!(json(r#"{"topology":{"open":null}}"#).unwrap().topology.is_some_and(|t| t.open.is_none()));
    assert!(json(r#"{"camera":{},"light":{},"image":{},"materials":{}}"#).is_ok());
    // A layer that is turned off forgets its values.
    let pairs = [("wire.smoothing", "3"), ("wire.hidden", "show"), ("wire", "null"), ("wire", "{}")];
    let wire = query(&pairs).unwrap().layers.wire.unwrap();
    assert_eq!((wire.smoothing, wire.hidden), (0.0, Hidden::Hide));
    let wire = query(&[("style", "wireframe"), ("wire", "null"), ("wire", "{}")]).unwrap().layers.wire.unwrap();
    assert_eq!(wire.hidden, Hidden::Fade);
    let over = [("wire.color".to_owned(), "#f00".to_owned())];
    let spec = read(Some(br#"{"style":"wire","wire":null}"#), &over, &rules()).unwrap();
    assert_eq!(spec.layers.wire.unwrap().color, Rgba::parse("#f00").unwrap());
}

#[test]
fn the_query_overrides_the_document_and_the_document_the_style() {
    let document = br##"{"style":"outline","surface":{"color":"#0f0"},"image":{"width":100,"height":50}}"##;
    let over = [("surface.color".to_owned(), "f00".to_owned()), ("size".to_owned(), "64".to_owned())];
    let spec = read(Some(document), &over, &rules()).unwrap();
    assert_eq!(spec.layers.surface.unwrap().color, Rgba::parse("#ff0000"));
    assert_eq!(spec.layers.surface.unwrap().shading, Shading::Smooth);
    assert_eq!((spec.image.width_px, spec.image.height_px), (64, 64));
    let over = [("style".to_owned(), "unlit".to_owned())];
    assert_eq!(read(Some(document), &over, &rules()).unwrap().layers.surface.unwrap().shading, Shading::Unlit);
}

#[test]
fn every_key_reaches_its_field() {
    let document = r##"{
        "style": "wire",
        "surface": {"shading":"smooth","normals":"derivative","color":"#fff","metallic":1,"roughness":0.25,
                    "emissive":"#100","opacity":0.5,"textures":false,"debug":"edge-distance","cull":"back"},
        "wire": {"method":"fwidth","color":"#000","thickness":2,"opacity":0.5,"lit":true,"edges":"feature",
                 "feature_angle_deg":45,"min_length":7,"hidden":"show"},
        "outline": {"method":"contour","color":"#fff","thickness":3,"unit":"px","min_length":12},
        "topology": {"polygon":null,"crease":"#00f","open":"#0f0","nonmanifold":null,"crease_angle_deg":60,"thickness":2},
        "points": {"size_px":7.5},
        "scene": {"time_s":1.25},
        "camera": {"view":"top","azimuth_deg":10,"elevation_deg":-20,"projection":"orthographic","fov_deg":50,
                   "height":2.5,"up":"-z","margin":0.1,"eye":[1,2,3],"target":[0,0,0.5]},
        "light": {"preset":"three-point","direction":[0,-1,0.5],"intensity":2,"ambient":0.1},
        "image": {"width":640,"height":480,"format":"webp","samples":1,"background":"transparent","effort":9,"legend":true},
        "backend": "cpu"
    }"##;
    let spec = json(document).unwrap();
    let surface = spec.layers.surface.unwrap();
    assert_eq!((surface.shading, surface.metallic, surface.roughness), (Shading::Smooth, Some(1.0), Some(0.25)));
    assert_eq!((surface.normals, surface.debug), (FlatNormals::Derivative, DebugView::EdgeDistance));
    assert_eq!((surface.emissive, surface.opacity, surface.textures), (Rgba::parse("#100"), 0.5, false));
    let wire = spec.layers.wire.unwrap();
    assert_eq!((wire.method, wire.thickness, wire.smoothing), (WireMethod::Fwidth, WireThickness::Given(2.0), 1.0));
    assert_eq!((wire.edges, wire.hidden, wire.opacity), (WireEdges::Feature, Hidden::Show, 0.5));
    assert_eq!((wire.lit, wire.feature_angle_deg, wire.min_length), (true, 45.0, 7.0));
    assert_eq!(
        spec.layers.outline,
        Some(Outline {
            method: OutlineMethod::Contour,
            color: Rgba::WHITE,
            thickness: Some(3.0),
            unit: OutlineUnit::Px,
            min_length: Some(12.0),
        })
    );
    let topology = spec.topology.unwrap();
    assert_eq!((topology.polygon, topology.nonmanifold), (None, None));
    assert_eq!((topology.crease, topology.open), (Rgba::parse("#00f"), Rgba::parse("#0f0")));
    assert_eq!((topology.crease_angle_deg, topology.thickness), (60.0, 2.0));
    assert_eq!((spec.light.preset, spec.light.direction), (LightPreset::ThreePoint, Some([0.0, -1.0, 0.5])));
    assert_eq!((spec.time_s, spec.points.size_px), (Some(1.25), 7.5));
    let sheet = json(r#"{"sheet":{"views":["top","auto"],"columns":1,"labels":true}}"#).unwrap().sheet.unwrap();
    assert_eq!(sheet.views, SheetViews::Named(vec![NamedView::Top, NamedView::Auto]));
    assert_eq!((sheet.columns, sheet.labels), (Some(1), true));
    let turntable = query(&[("sheet.turntable", "24")]).unwrap().sheet.unwrap();
    assert_eq!(turntable, Sheet { views: SheetViews::Turntable(24), columns: None, labels: false });
    let camera = spec.camera;
    assert_eq!((camera.view, camera.up, camera.height), (NamedView::Top, Some(UpAxis::NegZ), Some(2.5)));
    assert_eq!((camera.azimuth_deg, camera.elevation_deg), (Some(10.0), Some(-20.0)));
    assert_eq!((camera.eye, camera.target), (Some([1.0, 2.0, 3.0]), Some([0.0, 0.0, 0.5])));
    assert_eq!((spec.light.intensity, spec.light.ambient), (2.0, 0.1));
    assert_eq!((spec.image.width_px, spec.image.height_px, spec.image.samples), (640, 480, Samples::Fixed(1)));
    assert_eq!((spec.image.format, spec.image.background), (Some(ImageFormat::Webp), Rgba::TRANSPARENT.into()));
    assert_eq!((spec.image.effort, spec.image.legend), (9, true));
    assert_eq!(spec.backend, BackendChoice::Cpu);
}

#[test]
fn text_and_json_mean_the_same() {
    let text = query(&[
        ("size", "640x480"),
        ("samples", "1"),
        ("background", "fff8"),
        ("view", "left"),
        ("up", "z"),
        ("format", "jpg"),
        ("camera.eye", "1,2,3"),
        ("camera.target", "[0, 0, 1e-3]"),
    ]);
    let document = json(
        r##"{"size":"640x480","samples":1,"background":"#fff8","view":"left","up":"z","format":"jpeg",
             "camera":{"eye":[1,2,3],"target":[0,0,0.001]}}"##,
    );
    assert_eq!(text.unwrap(), document.unwrap());
}

#[test]
fn defaults_depend_on_other_keys_where_the_contract_says_so() {
    let smoothing = |pairs: &[(&str, &str)]| query(pairs).unwrap().layers.wire.unwrap().smoothing;
    assert_eq!(smoothing(&[("wire.method", "exact")]), 0.0);
    assert_eq!(smoothing(&[("wire.method", "fwidth")]), 1.0);
    assert_eq!(smoothing(&[("wire.smoothing", "0"), ("wire.method", "fwidth")]), 0.0);
    let light = query(&[("light.preset", "none")]).unwrap().light;
    assert_eq!((light.intensity, light.ambient), (1.0, 1.0));
    let light = query(&[("light.preset", "three-point")]).unwrap().light;
    assert_eq!((light.intensity, light.ambient), (1.0, 0.18));
    let light = query(&[("style", "flat"), ("light.preset", "three-point")]).unwrap().light;
    assert_eq!((light.intensity, light.ambient), (1.0, 0.3));
    for method in ["fwidth-min", "barycentric", "threshold"] {
        assert_eq!(smoothing(&[("wire.method", method)]), 1.0, "{method}");
    }
    let largest = |method| query(&[("wire.method", method), ("wire.thickness", "10")]).unwrap().layers.wire;
    assert!(["fwidth", "fwidth-min", "barycentric", "threshold", "exact"].iter().all(|m| largest(m).is_some()));
    assert!(query(&[("wire.thickness", "100")]).is_ok());
}

/// Small pictures have more samples: there, steps along edges are seen most.
#[test]
fn small_pictures_without_wires_have_16_samples() {
    let samples = |pairs: &[(&str, &str)]| query(pairs).unwrap().image.samples;
    let cases: &[(&[(&str, &str)], u32)] = &[
        (&[], 4),
        (&[("size", "256")], 16),
        (&[("size", "257x256")], 4),
        (&[("size", "4096x16")], 16),
        (&[("size", "64"), ("style", "outline")], 16),
        (&[("size", "64"), ("style", "topology")], 16),
        (&[("size", "64"), ("style", "wire")], 4),
        (&[("size", "64"), ("style", "wireframe")], 4),
        (&[("size", "64"), ("samples", "4")], 4),
        (&[("size", "512"), ("samples", "16")], 16),
    ];
    for (pairs, expected) in cases {
        assert_eq!(samples(pairs), Samples::Fixed(*expected), "{pairs:?}");
    }
    let of_materials = r#"{"size":64,"style":"flat","materials":{"steel":{"wire":{}}}}"#;
    assert_eq!(json(of_materials).unwrap().image.samples, Samples::Fixed(4));
    let target = query(&[("size", "64"), ("max_error", "2")]).unwrap().quality_target.unwrap();
    assert!(target.open.samples, "a target still chooses");
}

#[test]
fn null_is_the_default_or_as_if_the_key_were_not_there() {
    let keys: Vec<_> = FIELDS.iter().flat_map(|field| [Some(field.key), field.short]).flatten().collect();
    for key in &keys {
        let home = key.split_once('.').map(|(home, _)| home).filter(|home| is_layer(home));
        let (inner, without) = match key.split_once('.') {
            Some((home, key)) => (format!(r#"{{"{home}":{{"{key}":null}}}}"#), format!(r#"{{"{home}":{{}}}}"#)),
            None => (format!(r#"{{"{key}":null}}"#), "{}".to_owned()),
        };
        let spec = json(&inner).unwrap_or_else(|error| panic!("{error}"));
        // Here null is a value: this kind of edge is not drawn.
        if home != Some("topology") || key.ends_with("_deg") || key.ends_with("thickness") {
            assert_eq!(spec, json(&without).unwrap(), "{key}");
        }
        query(&[(key, "null")]).unwrap_or_else(|error| panic!("{error}"));
    }
    assert_eq!(keys.len(), 73);
    for document in [r#"{"style":null}"#, r#"{"camera":null,"light":null,"image":null}"#, r#"{"materials":null}"#] {
        assert_eq!(json(document).unwrap(), json("{}").unwrap(), "{document}");
    }
    assert_eq!(json(r#"{"materials":{"A":null}}"#).unwrap(), json("{}").unwrap());
    assert!(json(r#"{"materials":{"A":{"wire":{"lit":null}}}}"#).unwrap().materials[0].1.wire.is_some());
    // An override that is null changes nothing.
    let spec = read(Some(br#"{"wire":{"opacity":0.5}}"#), &[("wire.opacity".into(), "null".into())], &rules()).unwrap();
    assert_eq!(spec.layers.wire.unwrap().opacity, 0.5);
}

#[test]
fn a_document_may_say_where_its_schema_is() {
    let with = json(r#"{"$schema":"http://127.0.0.1:8080/v1/schema","style":"wire"}"#).unwrap();
    assert_eq!(with, json(r#"{"style":"wire"}"#).unwrap());
}

#[test]
fn nullable_keys_take_null() {
    let document = r#"{"camera":{"height":null,"up":null,"eye":null,"target":null,"azimuth_deg":null},
                       "surface":{"color":null,"metallic":null,"roughness":null,"emissive":null},"outline":{"thickness":null},
                       "topology":{"polygon":null},"light":{"direction":null},"image":{"format":null}}"#;
    let spec = json(document).unwrap();
    assert_eq!((spec.camera.height, spec.camera.up, spec.image.format), (None, None, None));
}

#[test]
fn errors_stay_short_and_printable_whatever_was_sent() {
    let key = "\u{1b}[31m".to_owned() + &"k".repeat(10_000);
    let error = query(&[(key.as_str(), &"\n".repeat(10_000))]).unwrap_err();
    let sentence = error.to_string();
    assert!(sentence.len() < 2_000 && !sentence.chars().any(char::is_control), "{sentence}");
}

#[test]
fn an_image_limit_below_the_largest_names_its_flag() {
    let rules = Rules { limits: Limits { image_px: 100, ..Limits::default() }, ..rules() };
    let error = read(None, &[("size".into(), "101".into())], &rules).unwrap_err();
    assert!(error.to_string().ends_with("(raise it with --limit-image-px)"), "{error}");
    assert_eq!(query(&[("size", "5000")]).unwrap_err().flag, None);
}

#[test]
fn jpeg_lays_its_background_over_white_in_linear_light() {
    let mut spec = query(&[("background", "transparent")]).unwrap();
    set_format(&mut spec, ImageFormat::Jpeg);
    assert_eq!(spec.image.background, Rgba::WHITE.into());
    let mut spec = query(&[("background", "#000..transparent")]).unwrap();
    set_format(&mut spec, ImageFormat::Jpeg);
    assert_eq!(spec.image.background, Background { top: Rgba::BLACK, bottom: Rgba::WHITE });
    let mut spec = query(&[("background", "transparent")]).unwrap();
    set_format(&mut spec, ImageFormat::Png);
    assert_eq!(spec.image.background, Rgba::TRANSPARENT.into());
}

#[test]
fn flags_are_words_or_digits_in_text_and_booleans_in_json() {
    for (text, expected) in [("true", true), ("1", true), ("false", false), ("0", false)] {
        assert_eq!(query(&[("camera.from_file", text)]).unwrap().camera.from_file, expected, "{text}");
    }
    assert!(json(r#"{"wire":{"lit":true}}"#).unwrap().layers.wire.unwrap().lit);
    assert!(json(r#"{"surface":{"textures":false}}"#).unwrap().layers.surface.is_some_and(|s| !s.textures));
}

/// Even a tiny vector has a direction.
#[test]
fn tiny_directions_are_scaled() {
    let direction = |text| query(&[("light.direction", text)]).unwrap().light.direction.unwrap();
    assert_eq!(direction("5e-324,0,0"), [1.0, 0.0, 0.0]);
    assert_eq!(direction("0,-3e-200,1.5e-200"), [0.0, -1.0, 0.5]);
    assert_eq!(direction("0,-2,0"), [0.0, -2.0, 0.0]);
}

/// The defaults that the table states are those that the reader uses.
#[test]
fn stated_defaults_are_the_defaults() {
    let mut checked = 0;
    for field in FIELDS.iter() {
        let Some(default) = &field.default else { continue };
        let layer = field.key.split_once('.').map_or("", |(layer, _)| layer);
        let (mut with, mut without) = (serde_json::json!({}), serde_json::json!({}));
        if is_layer(layer) {
            without[layer] = serde_json::json!({});
        }
        match field.key.split_once('.') {
            Some((layer, key)) => with[layer][key] = default.clone(),
            None => with[field.key] = default.clone(),
        }
        assert_eq!(json(&with.to_string()).unwrap(), json(&without.to_string()).unwrap(), "{}", field.key);
        checked += 1;
    }
    assert_eq!(checked, 54);
}

#[test]
fn the_vocabulary_has_every_word() {
    let vocabulary = vocabulary();
    assert_eq!(vocabulary["style"].len(), 12);
    assert_eq!(vocabulary["surface.debug"].len(), 13);
    assert_eq!(vocabulary["wire.method"], words_of::<WireMethod>());
    assert_eq!(vocabulary["sheet.views"], vocabulary["camera.view"]);
    assert_eq!(vocabulary.len(), 18);
}
