use super::*;
use crate::mesh::UpAxis;
use crate::scene::{Hidden, Outline, OutlineUnit, Shading, View, WireEdges, WireMethod};

fn rules() -> Rules {
    Rules { limits: Limits::default(), backend: BackendChoice::Auto }
}

fn query(pairs: &[(&str, &str)]) -> Result<Spec, RequestError> {
    let pairs: Vec<_> = pairs.iter().map(|&(k, v)| (k.to_owned(), v.to_owned())).collect();
    read(None, &pairs, &rules())
}

fn json(text: &str) -> Result<Spec, RequestError> {
    read(Some(text.as_bytes()), &[], &rules())
}

#[test]
fn every_style_has_its_layers() {
    let cases = [
        ("flat", Some(Shading::Flat), None, false),
        ("smooth", Some(Shading::Smooth), None, false),
        ("unlit", Some(Shading::Unlit), None, false),
        ("wire", Some(Shading::Flat), Some(Hidden::Hide), false),
        ("wireframe", None, Some(Hidden::Show), false),
        ("outline", Some(Shading::Smooth), None, true),
        ("hidden-line", Some(Shading::Unlit), Some(Hidden::Hide), false),
    ];
    assert_eq!(cases.len(), Style::NOW.len());
    for (style, shading, hidden, outline) in cases {
        let spec = query(&[("style", style)]).unwrap();
        assert_eq!(spec.layers.surface.map(|s| s.shading), shading, "{style}");
        assert_eq!(spec.layers.wire.map(|w| w.hidden), hidden, "{style}");
        assert_eq!(spec.layers.outline.is_some(), outline, "{style}");
        if let Some(wire) = spec.layers.wire {
            assert_eq!((wire.method, wire.thickness, wire.smoothing), (WireMethod::Exact, 1.0, 0.0));
        }
    }
    assert_eq!(query(&[]).unwrap(), query(&[("style", "flat")]).unwrap());
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
        "surface": {"shading":"smooth","normals":"face","color":"#fff","metallic":1,"roughness":0.25,"cull":"back"},
        "wire": {"method":"fwidth","color":"#000","thickness":2,"opacity":0.5,"edges":"polygons","hidden":"show"},
        "outline": {"method":"hull","color":"#fff","thickness":3,"unit":"px"},
        "camera": {"view":"top","azimuth_deg":10,"elevation_deg":-20,"projection":"orthographic","fov_deg":50,
                   "height":2.5,"up":"-z","margin":0.1,"eye":[1,2,3],"target":[0,0,0.5]},
        "light": {"preset":"headlight","intensity":2,"ambient":0.1},
        "image": {"width":640,"height":480,"format":"webp","samples":1,"background":"transparent"},
        "backend": "cpu"
    }"##;
    let spec = json(document).unwrap();
    let surface = spec.layers.surface.unwrap();
    assert_eq!((surface.shading, surface.metallic, surface.roughness), (Shading::Smooth, Some(1.0), Some(0.25)));
    let wire = spec.layers.wire.unwrap();
    assert_eq!((wire.method, wire.thickness, wire.smoothing), (WireMethod::Fwidth, 2.0, 1.0));
    assert_eq!((wire.edges, wire.hidden, wire.opacity), (WireEdges::Polygons, Hidden::Show, 0.5));
    assert_eq!(
        spec.layers.outline,
        Some(Outline {
            method: crate::scene::OutlineMethod::Hull,
            color: Rgba::WHITE,
            thickness: Some(3.0),
            unit: OutlineUnit::Px
        })
    );
    let camera = spec.camera;
    assert_eq!((camera.view, camera.up, camera.height), (View::Top, Some(UpAxis::NegZ), Some(2.5)));
    assert_eq!((camera.azimuth_deg, camera.elevation_deg), (Some(10.0), Some(-20.0)));
    assert_eq!((camera.eye, camera.target), (Some([1.0, 2.0, 3.0]), Some([0.0, 0.0, 0.5])));
    assert_eq!((spec.light.intensity, spec.light.ambient), (2.0, 0.1));
    assert_eq!((spec.image.width_px, spec.image.height_px, spec.image.samples), (640, 480, 1));
    assert_eq!((spec.image.format, spec.image.background), (Some(ImageFormat::Webp), Rgba::TRANSPARENT));
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
    assert_eq!((light.intensity, light.ambient), (0.0, 1.0));
}

#[test]
fn nullable_keys_take_null() {
    let document = r#"{"camera":{"height":null,"up":null,"eye":null,"target":null,"azimuth_deg":null},
                       "surface":{"color":null},"outline":{"thickness":null},"image":{"format":null}}"#;
    let spec = json(document).unwrap();
    assert_eq!((spec.camera.height, spec.camera.up, spec.image.format), (None, None, None));
}

/// Each bad request, its fault, the key that the error must name, and a part of what it must say.
#[test]
fn every_bad_value_is_refused_by_name() {
    use RequestFault::{Conflict, NotYet, OutOfRange, UnknownKey, WrongType};
    type Case = (&'static [(&'static str, &'static str)], RequestFault, &'static str, &'static str);
    let cases: &[Case] = &[
        (&[("wire.colour", "#f00")], UnknownKey, "wire.colour", "wire.color"),
        (&[("nonsense", "1")], UnknownKey, "nonsense", "the keys are"),
        (&[("", "")], UnknownKey, "", "the keys are"),
        (&[("camera.zoomfactor", "1")], UnknownKey, "camera.zoomfactor", "camera.view"),
        (&[("style", "toon")], OutOfRange, "style", "hidden-line"),
        (&[("style", "topology")], NotYet, "style", "flat"),
        (&[("style", "")], OutOfRange, "style", "flat"),
        (&[("surface.normals", "derivative")], NotYet, "surface.normals", "face"),
        (&[("surface.opacity", "0.5")], NotYet, "surface.opacity", "leave it out"),
        (&[("materials.Glass.surface", "null")], NotYet, "materials.Glass.surface", "leave it out"),
        (&[("light.preset", "three-point")], NotYet, "light.preset", "headlight"),
        (&[("wire.method", "threshold")], NotYet, "wire.method", "exact, fwidth"),
        (&[("wire.edges", "feature")], NotYet, "wire.edges", "polygons"),
        (&[("outline.method", "contour")], NotYet, "outline.method", "hull"),
        (&[("max_error", "1")], NotYet, "max_error", "leave it out"),
        (&[("size", "0")], OutOfRange, "size", "from 1 to 4096"),
        (&[("size", "1e9")], OutOfRange, "size", "from 1 to 4096"),
        (&[("size", "4097")], OutOfRange, "size", "from 1 to 4096"),
        (&[("size", "-1")], OutOfRange, "size", "from 1"),
        (&[("size", "1.5")], OutOfRange, "size", "whole"),
        (&[("size", "NaN")], OutOfRange, "size", "whole"),
        (&[("size", "big")], WrongType, "size", "N or WxH"),
        (&[("size", "640x")], WrongType, "size", "N or WxH"),
        (&[("size", "640x0")], OutOfRange, "size", "N or WxH"),
        (&[("size", "99999999999999999999999")], OutOfRange, "size", "from 1"),
        (&[("image.width", "0")], OutOfRange, "image.width", "from 1"),
        (&[("samples", "2")], OutOfRange, "samples", "1 or 4"),
        (&[("format", "bmp")], OutOfRange, "format", "png"),
        (&[("background", "white")], OutOfRange, "background", "#rgb"),
        (&[("background", "")], OutOfRange, "background", "%23"),
        (&[("wire.thickness", "101")], OutOfRange, "wire.thickness", "from 0 to 100"),
        (&[("wire.method", "fwidth"), ("wire.thickness", "11")], OutOfRange, "wire.thickness", "from 0 to 10 where"),
        (&[("wire.thickness", "inf")], OutOfRange, "wire.thickness", "from 0 to 10"),
        (&[("wire.thickness", "nan")], OutOfRange, "wire.thickness", "from 0 to 10"),
        (&[("wire.smoothing", "-0.1")], OutOfRange, "wire.smoothing", "from 0 to 10"),
        (&[("wire.opacity", "two")], WrongType, "wire.opacity", "a number"),
        (&[("wire.opacity", "null")], WrongType, "wire.opacity", "a number"),
        (&[("camera.fov_deg", "180")], OutOfRange, "camera.fov_deg", "179"),
        (&[("camera.elevation_deg", "91")], OutOfRange, "camera.elevation_deg", "90"),
        (&[("camera.margin", "0.5")], OutOfRange, "camera.margin", "0.45"),
        (&[("camera.height", "0")], OutOfRange, "camera.height", "number"),
        (&[("camera.eye", "1,2")], WrongType, "camera.eye", "three"),
        (&[("camera.eye", "1,2,inf"), ("camera.target", "0,0,0")], WrongType, "camera.eye", "finite"),
        (&[("camera.eye", "1,2,1e31"), ("camera.target", "0,0,0")], OutOfRange, "camera.eye", "1e30"),
        (&[("camera.eye", "1,2,3")], Conflict, "camera.eye", "camera.target"),
        (&[("camera.target", "1,2,3")], Conflict, "camera.target", "camera.eye"),
        (&[("camera.target", "1,2,3"), ("camera.eye", "1,2,3")], Conflict, "camera.target", "differ"),
        (&[("outline.thickness", "-1")], OutOfRange, "outline.thickness", "from 0 to 1e30"),
        (&[("outline.thickness", "101"), ("outline.unit", "px")], OutOfRange, "outline.thickness", "100"),
        (&[("wire", "on")], WrongType, "wire", "null"),
        (&[("camera", "null")], WrongType, "camera", "an object"),
        (&[("backend", "cuda")], OutOfRange, "backend", "gpu"),
    ];
    for (pairs, fault, key, part) in cases {
        let error = query(pairs).expect_err(&format!("{pairs:?} must be refused"));
        assert_eq!((error.fault, error.key.as_str()), (*fault, *key), "{pairs:?}: {error}");
        let sentence = error.to_string();
        assert!(sentence.contains(part) && sentence.contains(&format!("`{key}`")), "{pairs:?}: {sentence}");
    }
    assert_eq!(cases.len(), 52);
}

#[test]
fn every_bad_document_is_refused_by_name() {
    use RequestFault::{NotJson, OutOfRange, UnknownKey, WrongType};
    let cases = [
        ("", NotJson, "request"),
        ("{", NotJson, "request"),
        ("[]", NotJson, "request"),
        ("null", NotJson, "request"),
        ("\"style\"", NotJson, "request"),
        ("{\"style\":\"\u{0}\"}", NotJson, "request"),
        (r#"{"image":{"width":1e999}}"#, NotJson, "request"),
        (r#"{"style":3}"#, WrongType, "style"),
        (r#"{"style":null}"#, WrongType, "style"),
        (r#"{"wire":true}"#, WrongType, "wire"),
        (r#"{"wire":{"thickness":"2"}}"#, WrongType, "wire.thickness"),
        (r#"{"wire":{"color":255}}"#, WrongType, "wire.color"),
        (r#"{"wire":{"color":{"r":1}}}"#, WrongType, "wire.color"),
        (r#"{"camera":[]}"#, WrongType, "camera"),
        (r#"{"camera":{"eye":[1,2,"3"],"target":[0,0,0]}}"#, WrongType, "camera.eye"),
        (r#"{"image":{"width":512.5}}"#, OutOfRange, "image.width"),
        (r#"{"image":{"width":-512}}"#, OutOfRange, "image.width"),
        (r#"{"image":{"size":512}}"#, UnknownKey, "image.size"),
        (r#"{"wire.color":"f00"}"#, UnknownKey, "wire.color"),
        (r#"{"surface":{"metalic":1}}"#, UnknownKey, "surface.metalic"),
    ];
    for (document, fault, key) in cases {
        let error = json(document).expect_err(&format!("{document} must be refused"));
        assert_eq!((error.fault, error.key.as_str()), (fault, key), "{document}: {error}");
    }
    assert_eq!(cases.len(), 20);
    assert!(read(Some(&[0xff, 0xfe]), &[], &rules()).is_err(), "not UTF-8");
    assert!(read(Some(&vec![b' '; 2 << 20]), &[], &rules()).is_err(), "too long");
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
    assert_eq!(spec.image.background, Rgba::WHITE);
    let mut spec = query(&[("background", "transparent")]).unwrap();
    set_format(&mut spec, ImageFormat::Png);
    assert_eq!(spec.image.background, Rgba::TRANSPARENT);
}

/// Neither a query nor a document can do more than be refused, whatever is in it.
#[test]
fn noise_is_refused_without_a_panic() {
    let mut state = 7_u64;
    let mut random = move |bound: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % bound
    };
    let known = keys();
    let values = [
        "", "0", "1", "4", "#f00", "iso", "png", "-1", "1e308", "NaN", "inf", "null", "{}", "[]", "#", "#é", "x", "1x",
        "x1", "1,2,3", "é", "\u{0}",
    ];
    let seed = br##"{"style":"wire","wire":{"color":"#f00","thickness":1},"camera":{"eye":[1,2,3],"target":[0,0,0]}}"##;
    let (mut read_well, mut refused) = (0, 0);
    for round in 0..20_000 {
        let mut document = seed.to_vec();
        for _ in 0..random(4) {
            let place = random(document.len());
            document[place] = b"{}[]\",:0e.\\\xff #fn"[random(16)];
        }
        let mut key = known[random(known.len())].to_owned();
        if round % 5 == 0 {
            key.insert(random(key.len() + 1), ['.', 'é', 'x'][random(3)]);
        }
        let pairs = [(key, values[random(values.len())].to_owned())];
        match read(Some(&document).filter(|_| round % 2 == 0).map(Vec::as_slice), &pairs, &rules()) {
            Ok(_) => read_well += 1,
            Err(error) => {
                assert!(error.to_string().len() < 2_000, "{error}");
                refused += 1;
            }
        }
    }
    assert!(read_well > 500 && refused > 5_000, "{read_well} read, {refused} refused");
}
