//! Quality targets: requests that give a largest error or a time instead of samples and techniques.
//! The program chooses these, and says what it chose.

use crate::support::server::{Answer, CUBE_OBJ, Server, meshsnap};

/// The choice, as an answer states it.
fn said(answer: &Answer) -> (f64, String) {
    let error = answer.header("x-expected-error").expect("X-Expected-Error").parse().unwrap();
    (error, answer.header("x-chosen").expect("X-Chosen").to_owned())
}

#[test]
fn an_answer_says_what_was_chosen_and_what_error_to_expect() {
    let server = Server::start_with(meshsnap().args(["serve", "--listen", "127.0.0.1:0", "--backend", "auto"]));
    let post = |query: &str| {
        let answer = server.post(&format!("/v1/render?size=32&{query}"), CUBE_OBJ);
        assert_eq!(answer.status, 200, "{query}");
        answer
    };
    let draw = |query: &str| post(query).body;

    // As it is expected, so it is drawn.
    let loose = post("style=wireframe&max_error=200&wire.method=exact&backend=cpu");
    let (loose_error, chosen) = said(&loose);
    assert_eq!(chosen, "image.samples=1, wire.method=exact, backend=cpu");
    assert_eq!(loose.body, draw("style=wireframe&samples=1&backend=cpu"));
    let flat = post("image.max_error=9&backend=cpu");
    let (flat_error, chosen) = said(&flat);
    assert!(flat_error > 0.0 && flat_error <= 9.0 && loose_error > 0.0, "{flat_error} {loose_error}");
    assert_eq!(chosen, "image.samples=4, backend=cpu");
    assert_eq!(flat.body, draw("samples=4&backend=cpu"));

    // What is given is kept, and the expectation tells the truth.
    let kept = post("style=wire&wire.method=threshold&samples=1&max_error=0.5&backend=cpu");
    let (error, chosen) = said(&kept);
    assert!(error > 100.0, "{error}");
    assert_eq!(chosen, "image.samples=1, wire.method=threshold, backend=cpu");
    assert_eq!(kept.body, draw("style=wire&wire.method=threshold&samples=1&backend=cpu"));

    // A time that cannot be kept is not refused.
    let (error, chosen) = said(&post("image.max_time_ms=0.000001"));
    assert!(error > flat_error, "{error}");
    assert_eq!(chosen, "image.samples=1, backend=cpu");
    let (error, chosen) = said(&post("image.max_time_ms=60000"));
    assert!(error < flat_error, "{error}");
    assert_eq!(chosen, "image.samples=adaptive, backend=cpu");

    let mut without = 0;
    for query in ["style=wire", "max_error=null", "samples=1"] {
        let answer = post(query);
        assert_eq!((answer.header("x-expected-error"), answer.header("x-chosen")), (None, None), "{query}");
        without += 1;
    }
    assert_eq!(without, 3);
}

#[test]
fn a_job_reports_its_choice_and_what_could_not_be_met() {
    let server = Server::start(&[]);
    let report = |query: &str| {
        let job = server.post(&format!("/v1/jobs?size=32&{query}"), CUBE_OBJ);
        assert_eq!(job.status, 202, "{query}");
        let location = job.header("location").unwrap().to_owned();
        let done = server.request("GET", &location, &["Prefer: wait=30"], b"").json();
        assert_eq!(done["state"], "done", "{done:#}");
        (done["result"].clone(), server.get(&format!("{location}/result")))
    };
    let (met, result) = report("style=wire&max_error=30");
    assert_eq!((&met["chosen"]["samples"], &met["chosen"]["wire_methods"]), (&1.into(), &serde_json::json!(["exact"])));
    let expected = met["chosen"]["expected_error"].as_f64().unwrap();
    assert!(expected > 0.0 && expected <= 30.0 && met["chosen"]["expected_time_ms"].as_f64().unwrap() > 0.0);
    assert_eq!(said(&result).0, expected);
    assert_eq!(met["warnings"].as_array().unwrap().len(), 0, "{met:#}");

    let (unmet, _) = report("style=wire&max_error=0.01");
    assert_eq!((&unmet["chosen"]["samples"], &unmet["warnings"][0]["code"]), (&16.into(), &"max_error_unmet".into()));
    assert!(unmet["chosen"]["expected_error"].as_f64().unwrap() > 0.01);
    let (adaptive, _) = report("style=flat&samples=adaptive&max_error=99");
    assert_eq!(adaptive["chosen"]["samples"], "adaptive", "{adaptive:#}");
    let (late, _) = report("image.max_time_ms=0.000001");
    assert_eq!(late["warnings"][0]["code"], "max_time_ms_unmet", "{late:#}");
    let (plain, _) = report("style=wire");
    assert!(plain.get("chosen").is_none(), "{plain:#}");
}

#[test]
fn the_command_line_explains_its_choice() {
    let run = |keys: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let mesh = folder.path().join("cube.obj");
        std::fs::write(&mesh, CUBE_OBJ).unwrap();
        let mut command = meshsnap();
        // Where there is a GPU, it would be chosen.
        command.env("VK_DRIVER_FILES", "/dev/null").env("VK_ICD_FILENAMES", "/dev/null");
        command.arg("render").arg(&mesh).args(["-o", "-", "--size", "16", "--explain"]).args(keys);
        let done = command.output().unwrap();
        assert!(done.status.success());
        String::from_utf8(done.stderr).unwrap()
    };
    let said = run(&["--style", "wire", "--set", "max_error=0.01"]);
    assert!(said.contains("chosen: image.samples=16, wire.method=exact, backend=cpu; expected error "), "{said}");
    assert!(said.contains("warning: an error of at most 0.01/255 is asked for"), "{said}");
    let said = run(&["--style", "wire", "--backend", "cpu"]);
    assert!(said.contains("drawn by cpu") && !said.contains("chosen"), "{said}");
}
