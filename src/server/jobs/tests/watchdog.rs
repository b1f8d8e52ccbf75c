//! Tests of workers that do not end their jobs when the time is up.

use super::*;
use crate::jobs::job::{Comparing, Newer};

const TIME: Duration = Duration::from_millis(20);

/// Waits until the load is as wanted.
fn wait_for(jobs: &Jobs, wanted: impl Fn(&JobLoad) -> bool) {
    let began = Instant::now();
    while !wanted(&jobs.load()) {
        assert!(began.elapsed() < SOON, "still {:?}", jobs.load());
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn an_overdue_worker_is_replaced_and_its_mesh_refused_after_the_second() {
    let fixture = fixture(JobSettings { job_time: TIME, overdue_grace: TIME, ..settings() });
    for overdue in 1..=2 {
        // It listens to nothing but the gate.
        let job = fixture.submit(b"wait", false).unwrap();
        assert!(matches!(wait(&job), JobState::Failed(failure) if matches!(*failure, Failure::TimeUp { .. })));
        wait_for(&fixture.jobs, |load| load.overdue == overdue && load.running == 0);
        // Another worker does what comes next.
        assert!(matches!(wait(&fixture.submit(b"12", false).unwrap()), JobState::Done(_)));
    }
    let refusal = fixture.submit(b"wait", false).unwrap_err();
    assert!(matches!(refusal, Refusal::Quarantined { mesh } if mesh == Digest::of(b"wait")), "{refusal:?}");
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let refusal = runtime.block_on(fixture.jobs.accept(work(&fixture.budget, b"wait"))).unwrap_err();
    assert!(matches!(refusal, Refusal::Quarantined { .. }));
    assert_eq!(fixture.jobs.load().quarantined, 1);
    // Others of its size are drawn.
    assert!(matches!(wait(&fixture.submit(b"wai_", false).unwrap()), JobState::Done(_)));
    // Once they end their jobs, they end themselves: there is one worker, as before.
    let threads = || fixture.jobs.workers.lock().unwrap().iter().filter(|thread| !thread.is_finished()).count();
    assert_eq!(threads(), 3);
    for _ in 0..2 {
        fixture.open.send(()).unwrap();
    }
    wait_for(&fixture.jobs, |load| load.overdue == 0);
    let began = Instant::now();
    while threads() != 1 {
        assert!(began.elapsed() < SOON, "{} threads", threads());
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(matches!(wait(&fixture.submit(b"12", false).unwrap()), JobState::Done(_)));
}

#[test]
fn comparisons_are_refused_where_two_with_the_same_mesh_were_stuck() {
    let fixture = fixture(JobSettings { job_time: TIME, overdue_grace: TIME, ..settings() });
    let budget = &fixture.budget;
    let comparison = |newer: &'static [u8]| {
        let memory = Arc::new(budget.share(Account::Uploads));
        let newer = Newer { bundle: Bundle::of_one(Bytes::from_static(newer)), memory, holds: [].into(), mesh: None };
        let comparing = Comparing { newer, max_distance: None, picture: None, may_fail: false };
        Work { task: Task::Diff(Box::new(comparing)), ..work(budget, b"wait") }
    };
    for (overdue, newer) in (1..).zip([b"one", b"two"]) {
        let job = fixture.jobs.submit(comparison(newer), false).unwrap();
        assert!(matches!(wait(&job), JobState::Failed(failure) if matches!(*failure, Failure::TimeUp { .. })));
        wait_for(&fixture.jobs, |load| load.overdue == overdue && load.running == 0);
    }
    wait_for(&fixture.jobs, |load| load.quarantined == 1);
    let refusal = fixture.jobs.submit(comparison(b"three"), false).unwrap_err();
    assert!(matches!(refusal, Refusal::Quarantined { mesh } if mesh == Digest::of(b"wait")), "{refusal:?}");
    for mesh in [b"wait", b"one "] {
        assert!(fixture.jobs.check_mesh(&work(budget, mesh)).is_ok());
    }
    for _ in 0..2 {
        fixture.open.send(()).unwrap();
    }
}

#[test]
fn there_are_no_more_replacements_than_a_machine_can_bear() {
    let fixture = fixture(JobSettings { job_time: TIME, overdue_grace: TIME, queue: 100, ..settings() });
    let budget = &fixture.budget;
    // Meshes of many names, so that none is refused.
    let stuck = |name: u8| {
        let bundle = Bundle::of_one(Bytes::from([b"stuck".as_slice(), &[name]].concat()));
        fixture.jobs.submit(Work { bundle, ..work(budget, b"wait") }, false).unwrap()
    };
    for name in 0..3 {
        wait(&stuck(name));
        wait_for(&fixture.jobs, |load| load.overdue == usize::from(name) + 1);
    }
    // One worker and two in its place; the third is missing.
    assert_eq!(fixture.jobs.load().missing, 1);
    let waiting = fixture.submit(b"1", false).unwrap();
    // The first that ends its job goes on in the place of the missing one.
    fixture.open.send(()).unwrap();
    assert!(matches!(wait(&waiting), JobState::Done(_)));
    wait_for(&fixture.jobs, |load| (load.overdue, load.missing) == (2, 0));
    for _ in 0..2 {
        fixture.open.send(()).unwrap();
    }
}
