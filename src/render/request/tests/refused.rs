//! Tests of requests that are refused, and of the key that each error names.

use crate::request::tests::{json, query, rules};
use crate::request::*;

/// Each bad request, its fault, the key that the error must name, and a part of what it must say.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn every_bad_value_is_refused_by_name() {
    use RequestFault::{Conflict, OutOfRange, UnknownKey, WrongType};
    type Case = (&'static [(&'static str, &'static str)], RequestFault, &'static str, &'static str);
    let cases: &[Case] = &[
        (&[("wire.colour", "#f00")], UnknownKey, "wire.colour", "wire.color"),
        (&[("nonsense", "1")], UnknownKey, "nonsense", "the keys are"),
        (&[("", "")], UnknownKey, "", "the keys are"),
        (&[("camera.zoomfactor", "1")], UnknownKey, "camera.zoomfactor", "the keys of camera are azimuth_deg"),
        (&[("style", "toon")], OutOfRange, "style", "hidden-line"),
        (&[("style", "")], OutOfRange, "style", "flat"),
        (&[("surface.normals", "split")], OutOfRange, "surface.normals", "face, derivative"),
        (&[("surface.opacity", "1.5")], OutOfRange, "surface.opacity", "from 0 to 1"),
        (&[("surface.textures", "maybe")], WrongType, "surface.textures", "true or false"),
        (&[("surface.debug", "depth")], OutOfRange, "surface.debug", "min-barycentric"),
        (&[("surface.emissive", "red")], OutOfRange, "surface.emissive", "or null"),
        (&[("surface.metallic", "2")], OutOfRange, "surface.metallic", "from 0 to 1, or null"),
        (&[("surface", "off")], WrongType, "surface", "{} for its defaults"),
        (&[("light.preset", "disco")], OutOfRange, "light.preset", "three-point"),
        (&[("light.direction", "0,0,-0")], OutOfRange, "light.direction", "not all zero"),
        (&[("light.direction", "0,1")], WrongType, "light.direction", "three"),
        (&[("light.direction", "0,1,2e30")], OutOfRange, "light.direction", "1e30"),
        (&[("wire.method", "geometry")], OutOfRange, "wire.method", "exact, fwidth"),
        (&[("wire.edges", "sharp")], OutOfRange, "wire.edges", "feature"),
        (&[("wire.lit", "yes")], WrongType, "wire.lit", "true or false"),
        (&[("wire.feature_angle_deg", "181")], OutOfRange, "wire.feature_angle_deg", "from 0 to 180"),
        (&[("wire.min_length", "10001")], OutOfRange, "wire.min_length", "from 0 to 10000"),
        (&[("wire.hidden", "dash")], OutOfRange, "wire.hidden", "fade"),
        (&[("outline.method", "glow")], OutOfRange, "outline.method", "hull, contour"),
        (&[("topology.open", "7")], OutOfRange, "topology.open", "or null"),
        (&[("topology.thickness", "21")], OutOfRange, "topology.thickness", "from 0 to 20"),
        (&[("topology.boundary", "f00")], UnknownKey, "topology.boundary", "nonmanifold, open"),
        (&[("topology", "1")], WrongType, "topology", "null"),
        (&[("camera.from_file", "2")], WrongType, "camera.from_file", "true or false"),
        (
            &[("camera.from_file", "1"), ("camera.eye", "1,2,3"), ("camera.target", "0,0,0")],
            Conflict,
            "camera.from_file",
            "camera.eye",
        ),
        (&[("max_error", "0")], OutOfRange, "max_error", "above 0, at most 255"),
        (&[("max_error", "NaN")], OutOfRange, "max_error", "or null"),
        (&[("image.max_error", "255.1")], OutOfRange, "image.max_error", "at most 255"),
        (&[("image.max_error", "low")], WrongType, "image.max_error", "a number"),
        (&[("image.max_time_ms", "-1")], OutOfRange, "image.max_time_ms", "above 0, at most 86400000"),
        (&[("image.max_time_ms", "inf")], OutOfRange, "image.max_time_ms", "86400000"),
        (&[("max_time_ms", "1")], UnknownKey, "max_time_ms", "image.max_time_ms"),
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
        (&[("samples", "2")], OutOfRange, "samples", "adaptive or 1 or 4"),
        (&[("format", "bmp")], OutOfRange, "format", "png"),
        (&[("background", "white")], OutOfRange, "background", "#rgb"),
        (&[("background", "")], OutOfRange, "background", "or without #"),
        (&[("background", "#fff..")], OutOfRange, "background", "such as #fff..#dde"),
        (&[("background", "#fff..#dde..#ccc")], OutOfRange, "background", "two of them from top to bottom"),
        (&[("background", "#fff, #dde")], OutOfRange, "background", "did you mean #fff..#dde?"),
        (
            &[("image.background", "#FFF...transparent")],
            OutOfRange,
            "image.background",
            "did you mean #FFF..transparent?",
        ),
        (&[("wire.color", "#fff..#dde")], OutOfRange, "wire.color", "a colour"),
        (&[("scene.ground", "grass")], OutOfRange, "scene.ground", "one of none, shadow"),
        (&[("scene.ground", "true")], OutOfRange, "scene.ground", "shadow"),
        (&[("surface.facing_opacity", "1.5")], OutOfRange, "surface.facing_opacity", "from 0 to 1"),
        (&[("surface.facing_opacity", "clear")], WrongType, "surface.facing_opacity", "a number"),
        (&[("wire.thickness", "101")], OutOfRange, "wire.thickness", "from 0 to 100"),
        (&[("wire.method", "fwidth"), ("wire.thickness", "11")], OutOfRange, "wire.thickness", "from 0 to 10 where"),
        (&[("wire.method", "threshold"), ("wire.thickness", "10.5")], OutOfRange, "wire.thickness", "is not exact"),
        (&[("wire.smoothing", "10.5")], OutOfRange, "wire.smoothing", "from 0 to 10"),
        (&[("wire.thickness", "inf")], OutOfRange, "wire.thickness", "from 0 to 10"),
        (&[("wire.thickness", "nan")], OutOfRange, "wire.thickness", "from 0 to 10"),
        (&[("wire.smoothing", "-0.1")], OutOfRange, "wire.smoothing", "from 0 to 10"),
        (&[("wire.opacity", "two")], WrongType, "wire.opacity", "a number"),
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
        (&[("camera", "0")], WrongType, "camera", "an object"),
        (&[("$schema", "x")], UnknownKey, "$schema", "the keys are"),
        (&[("backend", "cuda")], OutOfRange, "backend", "gpu"),
    ];
    for (pairs, fault, key, part) in cases {
        let error = query(pairs).expect_err(&format!("{pairs:?} must be refused"));
        assert_eq!((error.fault, error.key.as_str()), (*fault, *key), "{pairs:?}: {error}");
        let sentence = error.to_string();
        assert!(sentence.contains(part) && sentence.contains(&format!("`{key}`")), "{pairs:?}: {sentence}");
    }
    assert_eq!(cases.len(), 85);
}

#[test]
fn every_bad_document_is_refused_by_name() {
    use RequestFault::{Conflict, NotJson, OutOfRange, UnknownKey, WrongType};
    let cases = [
        ("", NotJson, "request"),
        (r#"{"wire":{"lit":1}}"#, WrongType, "wire.lit"),
        (r#"{"camera":{"from_file":"true"}}"#, WrongType, "camera.from_file"),
        (r#"{"light":{"direction":[0,0,0]}}"#, OutOfRange, "light.direction"),
        (r#"{"light":{"direction":"0,1,0"}}"#, WrongType, "light.direction"),
        (r#"{"topology":{"wire":{}}}"#, UnknownKey, "topology.wire"),
        (r#"{"surface":[]}"#, WrongType, "surface"),
        (r#"{"materials":0}"#, WrongType, "materials"),
        (r#"{"materials":[]}"#, WrongType, "materials"),
        (r#"{"materials":{"A":0}}"#, WrongType, "materials.A"),
        (r#"{"materials":{"A.b":7}}"#, WrongType, "materials.A.b"),
        (r#"{"materials":{"A":{"surface":true}}}"#, WrongType, "materials.A.surface"),
        (r#"{"materials":{"A":{"topology":{}}}}"#, UnknownKey, "materials.A.topology"),
        (r#"{"materials":{"A":{"camera":{"view":"top"}}}}"#, UnknownKey, "materials.A.camera.view"),
        (r#"{"materials":{"A":{"style":"wire"}}}"#, UnknownKey, "materials.A.style"),
        (r#"{"materials":{"A":{"size":7}}}"#, UnknownKey, "materials.A.size"),
        (r#"{"materials":{"A":{"opacity":0.3}}}"#, UnknownKey, "materials.A.opacity"),
        (r#"{"materials":{"A":{"surface.opacity":0.3}}}"#, UnknownKey, "materials.A.surface.opacity"),
        (r#"{"materials":{"A":{"surface":{"opacity":3}}}}"#, OutOfRange, "materials.A.surface.opacity"),
        (r#"{"materials":{"A":{"wire":{"lit":[null]}}}}"#, WrongType, "materials.A.wire.lit"),
        (r#"{"materials":{"A":{"wire":{"lit":true,"lit":true}}}}"#, Conflict, "materials.A.wire.lit"),
        (r#"{"style":"wire","size":64,"style":"flat"}"#, Conflict, "style"),
        (r#"{"$schema":{}}"#, WrongType, "$schema"),
        (r#"{"wire":{"$schema":"x"}}"#, UnknownKey, "wire.$schema"),
        ("{", NotJson, "request"),
        ("[]", NotJson, "request"),
        ("null", NotJson, "request"),
        ("\"style\"", NotJson, "request"),
        ("{\"style\":\"\u{0}\"}", NotJson, "request"),
        (r#"{"image":{"width":1e999}}"#, NotJson, "request"),
        (r#"{"style":3}"#, WrongType, "style"),
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
    assert_eq!(cases.len(), 42);
    assert!(read(Some(&[0xff, 0xfe]), &[], &rules()).is_err(), "not UTF-8");
    assert!(read(Some(&vec![b' '; 2 << 20]), &[], &rules()).is_err(), "too long");
}

/// The error of a bad request: its kind, its key and its sentence.
fn refused(pairs: &[(&str, &str)]) -> (RequestFault, String, String) {
    let error = query(pairs).expect_err(&format!("{pairs:?} must be refused"));
    (error.fault, error.key.clone(), error.to_string())
}

#[test]
fn bad_keys_of_materials_are_named_in_full() {
    use RequestFault::{Conflict, OutOfRange, UnknownKey, WrongType};
    type Case = (&'static [(&'static str, &'static str)], RequestFault, &'static str, &'static str);
    const GLASS_PX: (&str, &str) = ("materials.Glass.outline.unit", "px");
    let cases: &[Case] = &[
        (&[("materials", "0")], WrongType, "materials", "materials by their names"),
        (&[("materials.Glass", "0")], WrongType, "materials.Glass", "surface, wire and outline"),
        (
            &[("materials.Glass.opacity", "0")],
            UnknownKey,
            "materials.Glass.opacity",
            "materials.Glass.surface.opacity or materials.Glass.wire.opacity",
        ),
        (&[("materials.A.B.surfac.opacity", "0")], UnknownKey, "materials.A.B.surfac.opacity", "surface.opacity"),
        (&[("materials.A.B.surface.opacty", "0")], UnknownKey, "materials.A.B.surface.opacty", "surface.opacity"),
        (
            &[("materials.A.wire.zzzzzzzzz", "0")],
            UnknownKey,
            "materials.A.wire.zzzzzzzzz",
            "the keys of materials.A.wire are method",
        ),
        (&[("materials.A.topology.open", "f00")], UnknownKey, "materials.A.topology.open", "surface, wire, outline"),
        (&[("materials.A.topology", "{}")], UnknownKey, "materials.A.topology", "surface, wire, outline"),
        (&[("materials.A.wire", "on")], WrongType, "materials.A.wire", "null"),
        (&[("materials.A.wire.color", "red")], OutOfRange, "materials.A.wire.color", "#rgb"),
        (
            &[("wire.thickness", "50"), ("materials.A.wire.method", "fwidth")],
            OutOfRange,
            "materials.A.wire.thickness",
            "from 0 to 10 where `materials.A.wire.method` is not exact",
        ),
        (
            &[GLASS_PX, ("materials.Glass.outline.thickness", "101")],
            OutOfRange,
            "materials.Glass.outline.thickness",
            "px",
        ),
        (&[("outline", "{}"), GLASS_PX], Conflict, "materials.Glass.outline.unit", "`outline.unit` is object"),
        (
            &[GLASS_PX, ("materials.A.outline.unit", "object")],
            Conflict,
            "materials.Glass.outline.unit",
            "`materials.A.outline.unit` is object",
        ),
    ];
    for (pairs, fault, key, part) in cases {
        let (of_fault, of_key, sentence) = refused(pairs);
        assert_eq!((of_fault, of_key.as_str()), (*fault, *key), "{pairs:?}: {sentence}");
        assert!(sentence.contains(part) && sentence.contains(&format!("`{key}`")), "{pairs:?}: {sentence}");
    }
    assert_eq!(cases.len(), 14);
    assert!(query(&[("outline.unit", "px"), GLASS_PX]).is_ok());
}

#[test]
fn materials_are_bounded_in_number_and_name() {
    let document = |count: usize| {
        let all = (0..count).map(|i| format!("\"m{i}\":{{}}")).collect::<Vec<_>>();
        format!("{{\"materials\":{{{}}}}}", all.join(","))
    };
    assert_eq!(json(&document(MATERIALS_MAX)).unwrap().materials.len(), MATERIALS_MAX);
    let error = json(&document(MATERIALS_MAX + 1)).unwrap_err();
    assert_eq!((error.fault, error.key.as_str()), (RequestFault::OutOfRange, "materials"));
    assert!(error.to_string().contains("at most 1000 materials"), "{error}");

    let key = |chars: usize| format!("materials.{}.surface.opacity", "\u{e9}".repeat(chars));
    assert!(query(&[(&key(MATERIAL_NAME_CHARS_MAX), "0.5")]).is_ok());
    let (fault, named, sentence) = refused(&[(&key(MATERIAL_NAME_CHARS_MAX + 1), "0.5")]);
    assert_eq!(fault, RequestFault::OutOfRange);
    assert!(named.starts_with("materials.\u{e9}") && named.ends_with(".surface.opacity"), "{named}");
    assert!(sentence.contains("257 characters long") && sentence.contains("at most 256"), "{sentence}");
    // A long name is shortened; the layer and the key stay.
    let (_, named, _) = refused(&[(&key(200), "2")]);
    assert!(named.starts_with("materials.\u{e9}") && named.ends_with(".surface.opacity"), "{named}");
}

/// Random queries and documents are read or refused, and never panic.
#[test]
fn noise_is_refused_without_a_panic() {
    let mut state = 7_u64;
    let mut random = move |bound: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % bound
    };
    let mut known = keys();
    known.extend(["materials.A.surface", "materials.A.b.wire.color", "materials.A", "materials.A.outline.unit"]);
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
