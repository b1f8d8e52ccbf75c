//! A form with several `mesh` parts: a job each, all accepted or none.

use serde_json::Value;

use super::durable::start;
use crate::http::answers::FORM;
use crate::support::files::bundle::zipped;
use crate::support::server::{Answer, CUBE_OBJ, Server};

/// A form with parts of these names, file names and contents.
fn form(parts: &[(&str, &str, &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, file, content) in parts {
        let file = if file.is_empty() { String::new() } else { format!("; filename=\"{file}\"") };
        body.extend(format!("--XX\r\nContent-Disposition: form-data; name=\"{name}\"{file}\r\n\r\n").bytes());
        body.extend(*content);
        body.extend(b"\r\n");
    }
    body.extend(b"--XX--\r\n");
    body
}

fn post(server: &Server, path: &str, headers: &[&str], parts: &[(&str, &str, &[u8])]) -> Answer {
    server.request("POST", path, &[&[FORM], headers].concat(), &form(parts))
}

#[track_caller]
fn jobs(answer: &Answer) -> Vec<Value> {
    assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
    assert_eq!(answer.header("location"), None, "there are several");
    answer.json()["jobs"].as_array().unwrap().clone()
}

#[track_caller]
fn urls(answer: &Answer) -> Vec<String> {
    jobs(answer).iter().map(|job| job["url"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn each_mesh_of_a_form_is_a_job_in_the_order_of_the_form() {
    let server = Server::start(&[]);
    let tall = String::from_utf8_lossy(CUBE_OBJ).replace("1 1 1\n", "1 5 1\n").into_bytes();
    let packed = zipped(&[("deep/cube.obj", CUBE_OBJ)]);
    let document = br#"{"style":"wire","size":24}"#;
    let parts: [(&str, &str, &[u8]); 5] = [
        ("mesh", "parts/a.obj", CUBE_OBJ),
        ("request", "r.json", document),
        ("mesh", "", &tall),
        ("mesh", "packed.zip", &packed),
        ("mesh", "parts/a.obj", b"no mesh"),
    ];
    let accepted = post(&server, "/v1/jobs?image.height=20", &[], &parts);
    let jobs = jobs(&accepted);
    let names: Vec<&str> = jobs.iter().map(|job| job["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["parts/a.obj", "mesh 2", "packed.zip", "parts/a.obj"]);
    let query = "style=wire&image.width=24&image.height=20";
    for (job, mesh) in jobs.iter().zip([CUBE_OBJ, &tall, &packed]) {
        let url = job["url"].as_str().unwrap();
        assert_eq!(url, format!("/v1/jobs/{}", job["job"]["id"].as_str().unwrap()));
        assert_eq!(server.request("GET", url, &["Prefer: wait=30"], b"").json()["state"], "done");
        let result = server.get(&format!("{url}/result"));
        result.picture(24, 20);
        assert_eq!(result.body, server.post(&format!("/v1/render?{query}"), mesh).body);
    }
    let failed = server.request("GET", jobs[3]["url"].as_str().unwrap(), &["Prefer: wait=30"], b"").json();
    assert_eq!((failed["state"].as_str(), failed["error"]["status"].as_u64()), (Some("failed"), Some(415)), "{failed}");

    // A list of one is a list, and `respond-async` is the same elsewhere.
    assert_eq!(urls(&post(&server, "/v1/jobs?size=16", &[], &parts[..1])).len(), 1);
    let answer = post(&server, "/v1/render?size=16", &["Prefer: respond-async"], &[parts[0], parts[2]]);
    assert_eq!((urls(&answer).len(), answer.header("preference-applied")), (2, Some("respond-async")));
    // Parts named `file` are one mesh, as ever.
    let bundle = post(&server, "/v1/jobs?size=16", &[], &[("file", "a.obj", CUBE_OBJ), ("file", "b.mtl", b"")]);
    assert!(bundle.status == 202 && bundle.header("location").is_some());
}

#[test]
fn all_meshes_of_a_form_are_accepted_or_none() {
    // Six places for one client, and its worker.
    let server = Server::start(&["--workers", "1", "--queue", "8"]);
    let cubes = |count: usize| vec![("mesh", "a.obj", CUBE_OBJ); count];
    let slow = "/v1/jobs?size=4096&samples=16";
    let too_many = post(&server, slow, &[], &cubes(8));
    let detail = too_many.problem(422, "too_many_meshes");
    assert!(too_many.json()["flag"] == "--queue" && detail.contains("more than 7 meshes"), "{detail}");
    server.wait_for_load(|load| load["queued"] == 0 && load["running"] == 0 && load["kept_results"] == 0);

    let first = urls(&post(&server, slow, &[], &cubes(7)));
    server.wait_for_load(|load| load["running"] == 1);
    let refused = post(&server, slow, &[], &cubes(3));
    refused.problem(429, "queue_full");
    assert!(refused.header("retry-after").is_some_and(|seconds| seconds.parse::<u64>().unwrap() >= 1));
    server.request("DELETE", &first[6], &[], b"");
    server.request("DELETE", &first[5], &[], b"");
    // Two places are not three, and what was refused holds none of them.
    for _ in 0..3 {
        let load = server.get("/v1/capabilities").json()["load"]["queued"].as_u64().unwrap();
        if load < 4 {
            break;
        }
        post(&server, slow, &[], &cubes(3)).problem(429, "queue_full");
    }
    assert_eq!(urls(&post(&server, slow, &[], &cubes(2))).len(), 2);
    server.wait_for_load(|load| load["queued"].as_u64().unwrap() <= 6);
}

#[test]
fn a_form_with_a_fault_makes_no_job() {
    let server = Server::start(&[]);
    let cube = ("mesh", "a.obj", CUBE_OBJ);
    let file = ("file", "b.obj", CUBE_OBJ);
    for parts in [[cube, file], [file, cube]] {
        let detail = post(&server, "/v1/jobs", &[], &parts).problem(400, "bad_form");
        assert!(detail.contains("a job each"), "{detail}");
    }
    post(&server, "/v1/jobs?size=0", &[], &[cube, cube]).problem(400, "out_of_range");
    post(&server, "/v1/jobs", &[], &[cube, ("mesh", "../b.obj", CUBE_OBJ)]).problem(400, "bad_form");
    post(&server, "/v1/jobs", &["Accept: text/html"], &[cube, cube]).problem(406, "not_acceptable");
    let detail = post(&server, "/v1/jobs", &[], &[cube, ("mesh", "none.obj", b"")]).problem(415, "mesh_unrecognised");
    assert!(detail.contains("none.obj"), "{detail}");
    let detail = post(&server, "/v1/render", &[], &[cube, cube]).problem(400, "bad_form");
    assert!(detail.contains("POST /v1/jobs"), "{detail}");
    post(&server, "/v1/meshes", &[], &[cube]).problem(400, "bad_form");
    server.wait_for_load(|load| load["queued"] == 0 && load["running"] == 0 && load["kept_results"] == 0);
    // The memory of the meshes is back.
    let metrics = server.get("/metrics");
    assert!(String::from_utf8_lossy(&metrics.body).contains("meshsnap_memory_bytes{account=\"uploads\"} 0"));
}

#[test]
fn a_form_that_is_sent_again_makes_no_second_jobs_also_after_a_crash() {
    let folder = tempfile::tempdir().unwrap();
    let key = ["Idempotency-Key: nightly"];
    let other = [CUBE_OBJ, b"# other\n"].concat();
    let parts: [(&str, &str, &[u8]); 3] = [("mesh", "a", CUBE_OBJ), ("mesh", "b", &other), ("mesh", "c", CUBE_OBJ)];
    let path = "/v1/jobs?size=16";
    let first;
    {
        let server = start(folder.path(), &["--workers", "1"]);
        first = urls(&post(&server, path, &key, &parts));
        assert_eq!(urls(&post(&server, path, &key, &parts)), first);
        server.kill_9();
    }
    let server = start(folder.path(), &["--workers", "1"]);
    assert_eq!(urls(&post(&server, path, &key, &parts)), first);
    for url in &first {
        assert_eq!(server.request("GET", url, &["Prefer: wait=30"], b"").json()["state"], "done");
        server.get(&format!("{url}/result")).picture(16, 16);
    }
    let swapped = [parts[1], parts[0], parts[2]];
    for parts in [&swapped[..], &parts[..2]] {
        post(&server, path, &key, parts).problem(422, "idempotency_key_reused");
    }
    server.request("POST", path, &key, CUBE_OBJ).problem(422, "idempotency_key_reused");
    // One that was forgotten is made again, and the others are not.
    server.request("DELETE", &first[1], &[], b"");
    let again = urls(&post(&server, path, &key, &parts));
    assert!(again[0] == first[0] && again[1] != first[1] && again[2] == first[2], "{again:?} {first:?}");
}
