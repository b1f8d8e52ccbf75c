//! The schema of requests within `api/openapi.json` is the generated one, and the served document has the server's
//! own limits.

use std::path::Path;

use meshsnap_render::limits::Limits;
use meshsnap_render::request::{self, Rules};
use meshsnap_render::spec::BackendChoice;
use serde_json::Value;

use super::document;
use crate::support::server::Server;

/// The line after the generated ones.
const AFTER: &str = "      \"Problem\": {";

/// The generated lines, in the file's own indentation.
fn generated() -> String {
    let rules = Rules { limits: Limits::default(), backend: BackendChoice::Auto };
    let components = format!("{:#}", Value::Object(request::components(&rules)));
    let inner = components.trim_start_matches("{\n").trim_end_matches("\n}");
    inner.lines().map(|line| format!("    {line}\n")).collect::<String>().trim_end().to_owned() + ",\n"
}

/// `MESHSNAP_GOLDEN=write` stores the components anew, and fails: a run that wrote its own truth has tested nothing.
#[test]
fn the_stored_schema_of_requests_is_the_generated_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("api/openapi.json");
    let stored = std::fs::read_to_string(&path).unwrap();
    let first = format!("      \"{}", request::COMPONENTS_PREFIX);
    let begin = stored.lines().take_while(|line| !line.starts_with(&first)).map(|line| line.len() + 1).sum::<usize>();
    // A response has the same name.
    let end = begin + stored[begin..].find(AFTER).unwrap();
    let made = generated();
    if std::env::var_os("MESHSNAP_GOLDEN").is_some_and(|v| v == "write") {
        std::fs::write(&path, format!("{}{made}{}", &stored[..begin], &stored[end..])).unwrap();
        panic!("{} was written: look at it, then run without MESHSNAP_GOLDEN", path.display());
    }
    assert!(stored[begin..end] == made, "{} differs; MESHSNAP_GOLDEN=write stores it anew", path.display());
}

#[test]
fn the_served_document_has_the_servers_own_limits() {
    let server = Server::start(&["--limit-image-px", "640"]);
    let served = server.get("/openapi.json").json();
    let mut expected = document();
    let of = |components: &str, key: &str| format!("/components/schemas/{components}/properties/{key}/maximum");
    let mut limits = 0;
    for place in [of("RequestImage", "width"), of("RequestImage", "height"), of("RequestKeys", "image.width")] {
        assert_eq!(served.pointer(&place).unwrap(), 640, "{place}");
        assert_eq!(expected.pointer(&place).unwrap(), 4096, "{place}");
        limits += 1;
    }
    assert_eq!(limits, 3);
    for name in request::components(&Rules { limits: Limits::default(), backend: BackendChoice::Auto }).keys() {
        expected["components"]["schemas"][name] = served["components"]["schemas"][name].clone();
    }
    assert_eq!(served, expected, "the rest is as stored");
}
