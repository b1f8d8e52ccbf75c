//! The JSON Schema of the request document: the stored one is the generated one, it accepts the
//! documents that the reader of requests accepts, and the server serves it with its own limits.

use std::path::Path;

use jsonschema::Validator;
use meshsnap_render::limits::Limits;
use meshsnap_render::request;
use meshsnap_render::request::Rules;
use meshsnap_render::spec::BackendChoice;

use crate::support::server::Server;

fn rules() -> Rules {
    Rules { limits: Limits::default(), backend: BackendChoice::Auto }
}

/// `MESHSNAP_GOLDEN=write` stores the schema anew, and fails: a run that wrote its own truth has
/// tested nothing.
#[test]
fn the_stored_schema_is_the_generated_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("api/material.schema.json");
    let made = format!("{:#}\n", request::schema(&rules()));
    if std::env::var_os("MESHSNAP_GOLDEN").is_some_and(|v| v == "write") {
        std::fs::write(&path, &made).unwrap();
        panic!("{} was written: look at it, then run without MESHSNAP_GOLDEN", path.display());
    }
    let stored = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    assert!(stored == made, "{} differs; MESHSNAP_GOLDEN=write stores it anew", path.display());
}

#[test]
fn the_schema_is_valid_and_describes_every_key() {
    let schema = request::schema(&rules());
    assert!(jsonschema::meta::is_valid(&schema), "not a schema");
    let mut described = 0;
    for key in request::keys() {
        let property = match key.split_once('.') {
            None => &schema["properties"][key],
            Some((home, key)) if schema["$defs"][home].is_object() => &schema["$defs"][home]["properties"][key],
            Some((home, key)) => &schema["properties"][home]["properties"][key],
        };
        let property = match property["$ref"].as_str() {
            Some(at) => &schema["$defs"][at.rsplit('/').next().unwrap()],
            None => property,
        };
        assert!(property["description"].as_str().is_some_and(|text| text.ends_with('.')), "{key}: {property}");
        described += 1;
    }
    assert_eq!(described, 86);
}

/// Documents that are understood.
const GOOD: &[&str] = &[
    "{}",
    r#"{"max_error":0.001}"#,
    r#"{"image":{"max_error":255,"max_time_ms":86400000}}"#,
    r#"{"scene":{"time_s":0}}"#,
    r#"{"scene":{"time_s":null}}"#,
    r#"{"surface":{"debug":"aspect"},"image":{"legend":true}}"#,
    r#"{"style":"topology"}"#,
    r##"{"surface":{"shading":"smooth","normals":"derivative","crease_angle_deg":180,"color":"#c8ccd2","metallic":0,"roughness":0.6,
        "emissive":"#000","opacity":1,"facing_opacity":0.5,"textures":true,"cull":"back","debug":"edge-distance"}}"##,
    r#"{"surface":null,"wire":{},"outline":null,"topology":{}}"#,
    r#"{"surface":{"color":null,"metallic":null,"roughness":null,"emissive":null}}"#,
    r##"{"wire":{"method":"exact","color":"#000","thickness":100,"smoothing":10,"opacity":0,"lit":false,
        "edges":"feature","feature_angle_deg":180,"min_length":10000,"hidden":"fade"}}"##,
    r#"{"wire":{"method":"fwidth","thickness":10}}"#,
    r#"{"wire":{"thickness":1.0,"smoothing":0}}"#,
    r#"{"wire":{"color":"ABC"}}"#,
    r#"{"wire":{"color":"transparent"}}"#,
    r##"{"wire":{"color":"#12345678"}}"##,
    r##"{"outline":{"method":"contour","color":"#000f","thickness":0.03,"unit":"object"}}"##,
    r#"{"outline":{"thickness":null,"unit":"px"}}"#,
    r#"{"outline":{"thickness":1e30}}"#,
    r##"{"topology":{"polygon":null,"crease":"#00f","open":"#f00","nonmanifold":"#f0f","crease_angle_deg":0,"thickness":20}}"##,
    r#"{"materials":{}}"#,
    r#"{"materials":{"Glass":{},"":{"surface":null},"a.b":{"wire":{"color":"f00"},"outline":{}}}}"#,
    r#"{"materials":{"Glass":{"surface":{"opacity":0.3,"color":null},"outline":null}}}"#,
    r#"{"camera":{"view":"top","azimuth_deg":45,"elevation_deg":30,"projection":"orthographic","fov_deg":35,
        "height":null,"up":"-x","margin":0.05,"eye":null,"target":null,"from_file":true}}"#,
    r#"{"camera":{"eye":[1,2,3],"target":[0,0,0.5],"from_file":false}}"#,
    r#"{"camera":{"eye":null}}"#,
    r#"{"camera":{"up":null,"azimuth_deg":null,"elevation_deg":null,"height":1e-30}}"#,
    r#"{"light":{"preset":"three-point","direction":[0,-1,0],"intensity":10,"ambient":0}}"#,
    r#"{"light":{"direction":null}}"#,
    r#"{"light":{"direction":[0,0,1e-300]}}"#,
    r##"{"image":{"width":1,"height":4096,"format":"jpg","samples":1,"background":"#fff"}}"##,
    r##"{"image":{"background":"#fff..#dde"},"style":"flat","scene":{"ground":"shadow"}}"##,
    r#"{"background":"abc8..transparent"}"#,
    r#"{"image":{"width":512.0,"samples":4.0,"format":null}}"#,
    r#"{"sheet":{"views":["front","auto"],"columns":2,"labels":true},"points":{"size_px":64}}"#,
    r#"{"sheet":{"turntable":64,"views":null},"surface":{"debug":"uv-layout"}}"#,
    r#"{"size":256,"format":"webp","samples":4,"background":"transparent","view":"iso","up":"z"}"#,
    r#"{"size":"640x480"}"#,
    r#"{"size":"640","backend":"cpu"}"#,
    r#"{"style":null}"#,
    r#"{"surface":{"shading":null}}"#,
    r#"{"surface":{"textures":null}}"#,
    r#"{"wire":{"color":null}}"#,
    r#"{"materials":null}"#,
    r#"{"materials":{"A":null}}"#,
    r#"{"camera":null}"#,
    r#"{"camera":{"from_file":null}}"#,
    r#"{"image":{"samples":null}}"#,
    r#"{"$schema":"x","size":null,"light":null}"#,
    r#"{"wire":{"method":null,"thickness":100}}"#,
    r#"{"camera":{"eye":[1,2,3],"target":[0,0,0],"from_file":null}}"#,
];

/// Documents that are refused.
const BAD: &[&str] = &[
    "[]",
    "null",
    "7",
    r#"{"style":"toon"}"#,
    r#"{"sytle":"wire"}"#,
    r#"{"wire.color":"f00"}"#,
    r#"{"max_error":0}"#,
    r#"{"surface":{"facing_opacity":1.1}}"#,
    r##"{"background":"#fff.#dde"}"##,
    r##"{"background":"#fff..#dde..#ccc"}"##,
    r##"{"surface":{"color":"#fff..#dde"}}"##,
    r#"{"image":{"max_error":256}}"#,
    r#"{"image":{"max_time_ms":-1}}"#,
    r#"{"max_time_ms":1}"#,
    r#"{"scene":{"time_s":-1}}"#,
    r#"{"scene":{"time":1}}"#,
    r#"{"surface":true}"#,
    r#"{"surface":[]}"#,
    r#"{"surface":{"metalic":1}}"#,
    r#"{"surface":{"opacity":1.01}}"#,
    r#"{"surface":{"opacity":"1"}}"#,
    r#"{"surface":{"textures":1}}"#,
    r#"{"surface":{"color":"red"}}"#,
    r#"{"surface":{"color":255}}"#,
    r##"{"surface":{"emissive":"#12345"}}"##,
    r#"{"wire":{"thickness":100.1}}"#,
    r#"{"wire":{"method":"threshold","thickness":10.1}}"#,
    r#"{"wire":{"smoothing":-0.1}}"#,
    r#"{"wire":{"lit":"false"}}"#,
    r#"{"wire":{"feature_angle_deg":181}}"#,
    r#"{"wire":{"min_length":-1}}"#,
    r#"{"outline":{"unit":"px","thickness":101}}"#,
    r#"{"outline":{"thickness":-1}}"#,
    r#"{"topology":{"thickness":20.5}}"#,
    r#"{"topology":{"surface":{}}}"#,
    r#"{"materials":{"A":{"topology":{}}}}"#,
    r#"{"materials":{"A":{"opacity":0.3}}}"#,
    r#"{"materials":{"A":{"surface.opacity":0.3}}}"#,
    r#"{"materials":{"A":{"surface":{"opacity":3}}}}"#,
    r#"{"materials":{"A":{"style":"wire"}}}"#,
    r#"{"camera":{"eye":[1,2,3]}}"#,
    r#"{"camera":{"target":[1,2,3],"eye":null}}"#,
    r#"{"camera":{"eye":[1,2],"target":[0,0,0]}}"#,
    r#"{"camera":{"eye":[1,2,"3"],"target":[0,0,0]}}"#,
    r#"{"camera":{"eye":[1,2,2e30],"target":[0,0,0]}}"#,
    r#"{"camera":{"eye":[1,2,3],"target":[0,0,0],"from_file":true}}"#,
    r#"{"camera":{"elevation_deg":91}}"#,
    r#"{"light":{"direction":[0,0,0]}}"#,
    r#"{"light":{"direction":[0,-0.0,0.0]}}"#,
    r#"{"light":{"direction":"0,1,0"}}"#,
    r#"{"light":{"preset":"none","intensity":11}}"#,
    r#"{"image":{"width":0}}"#,
    r#"{"image":{"width":4097}}"#,
    r#"{"image":{"width":1.5}}"#,
    r#"{"image":{"samples":2}}"#,
    r#"{"image":{"size":512}}"#,
    r#"{"size":0}"#,
    r#"{"size":"640x"}"#,
    r#"{"size":"0x640"}"#,
    r#"{"size":[640,480]}"#,
    r#"{"backend":"cuda"}"#,
    r#"{"$schema":7}"#,
];

#[test]
fn the_schema_and_the_reader_are_of_one_mind() {
    let validator = jsonschema::draft202012::new(&request::schema(&rules())).unwrap();
    for document in GOOD {
        let read = request::read(Some(document.as_bytes()), &[], &rules());
        assert!(read.is_ok(), "the reader refuses {document}: {}", read.unwrap_err());
        assert!(complaints(&validator, document).is_empty(), "{document}: {}", complaints(&validator, document));
    }
    for document in BAD {
        assert!(request::read(Some(document.as_bytes()), &[], &rules()).is_err(), "the reader takes {document}");
        assert!(!complaints(&validator, document).is_empty(), "the schema takes {document}");
    }
    assert_eq!((GOOD.len(), BAD.len()), (51, 62));
}

/// Documents made at random from pieces of both kinds: as many as both refuse or take; none where
/// they differ.
#[test]
fn the_schema_and_the_reader_agree_on_documents_made_at_random() {
    let validator = jsonschema::draft202012::new(&request::schema(&rules())).unwrap();
    let mut state = 11_u64;
    let mut random = move |bound: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % bound
    };
    let values = [
        "null",
        "{}",
        "[]",
        "true",
        "0",
        "1",
        "-1",
        "10",
        "30",
        "101",
        "4096",
        "1e30",
        "0.25",
        "\"none\"",
        "\"flat\"",
        "\"exact\"",
        "\"px\"",
        "\"#f00\"",
        "\"transparent\"",
        "[0,0,0]",
        "[0,-1,2]",
        "\"y\"",
        "\"32x16\"",
    ];
    let keys: Vec<&str> = request::keys();
    let (mut taken, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let (key, value) = (keys[random(keys.len())], values[random(values.len())]);
        let inner = match key.split_once('.') {
            Some((home, key)) => format!("\"{home}\":{{\"{key}\":{value}}}"),
            None => format!("\"{key}\":{value}"),
        };
        let document = match random(4) {
            0 => format!("{{\"materials\":{{\"A\":{{{inner}}}}}}}"),
            _ => format!("{{{inner}}}"),
        };
        let read = request::read(Some(document.as_bytes()), &[], &rules());
        let said = complaints(&validator, &document);
        assert_eq!(read.is_ok(), said.is_empty(), "{document}: {said}; {:?}", read.err());
        *if said.is_empty() { &mut taken } else { &mut refused } += 1;
    }
    assert!(taken > 2_000 && refused > 5_000, "{taken} taken, {refused} refused");
}

fn complaints(validator: &Validator, document: &str) -> String {
    let document: serde_json::Value = serde_json::from_str(document).unwrap();
    let all = validator.iter_errors(&document).map(|e| format!("{}: {e}", e.instance_path()));
    all.collect::<Vec<_>>().join("; ")
}

#[test]
fn the_schema_is_served_with_the_servers_own_limits() {
    let server = Server::start(&["--limit-image-px", "640"]);
    let answer = server.get("/v1/schema");
    assert_eq!((answer.status, answer.header("content-type")), (200, Some("application/schema+json")));
    assert_eq!(answer.header("cache-control"), Some("no-cache"));
    let schema = answer.json();
    assert_eq!(schema["properties"]["image"]["properties"]["width"]["maximum"], 640);
    let capabilities = server.get("/v1/capabilities").json();
    assert_eq!(capabilities["schema"], "/v1/schema");
    // Every key that stands in a document by itself is in both lists.
    let listed = capabilities["request_keys"].as_array().unwrap();
    let top = schema["properties"].as_object().unwrap().keys().filter(|key| *key != "$schema");
    let mut keys = 0;
    for key in top {
        assert!(listed.contains(&key.as_str().into()), "{key}");
        keys += 1;
    }
    assert_eq!(keys, 21);
    assert_eq!(schema["properties"]["mesh"]["pattern"], "^[0-9a-f]{64}$");

    let etag = answer.header("etag").unwrap().to_owned();
    let mut cases = 0;
    for (tags, status) in [
        (etag.clone(), 304),
        (format!("\"x\", W/{etag}"), 304),
        ("*".to_owned(), 304),
        ("\"x\"".to_owned(), 200),
        (String::new(), 200),
    ] {
        let again = server.request("GET", "/v1/schema", &[&format!("If-None-Match: {tags}")], b"");
        assert_eq!((again.status, again.header("etag")), (status, Some(etag.as_str())), "{tags}");
        assert_eq!(again.body.is_empty(), status == 304, "{tags}");
        cases += 1;
    }
    assert_eq!(cases, 5);
    server.request("POST", "/v1/schema", &[], b"").problem(405, "method_not_allowed");
}
