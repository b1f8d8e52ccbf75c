//! A worker thread: takes jobs, draws them, survives them.

use crate::import;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use super::job::{Failure, Finished, Job, Product, State, Task, Timings, Work};
use crate::backend::{Backends, GpuHost};
use crate::limits::{Deadline, Limits};
use crate::pipeline::{self, RenderError, Stage};
use crate::service::jobs::registry::Registry;

/// What does one job after the other on one thread.
pub type Renderer = Box<dyn FnMut(&Work, &Deadline, &mut dyn FnMut(Stage)) -> Result<Product, RenderError>>;

/// Makes a worker's renderer, on the worker's own thread: devices do not move between threads.
pub type Engine = Arc<dyn Fn() -> Renderer + Send + Sync>;

/// The real engine. Each worker's CPU path uses up to `threads` threads.
pub fn pipeline_engine(gpu: Arc<GpuHost>, threads: usize, limits: Limits) -> Engine {
    Arc::new(move || {
        let mut backends = Backends::new(gpu.clone(), threads);
        let limits = limits.clone();
        Box::new(move |work, deadline, ended| {
            let Work { bundle, format_in, task, .. } = work;
            match task {
                Task::Draw(spec) => {
                    let job = pipeline::Job { bundle, format_in: *format_in, spec };
                    pipeline::render(job, &mut backends, &limits, deadline, ended).map(Product::Picture)
                }
                Task::Inspect { time_s } => {
                    let options = import::Options { format: *format_in, time_s: *time_s };
                    let report = pipeline::inspect(bundle, options, &limits, deadline, ended)?;
                    Ok(Product::Report(report.json()?))
                }
            }
        })
    })
}

/// Works until the board is drained.
pub fn run(board: &Registry, engine: &Engine) {
    // Made with the first job: an idle process holds no renderer.
    let mut renderer: Option<Renderer> = None;
    while let Some((job, work)) = board.take() {
        let started = Instant::now();
        let attempt = catch_unwind(AssertUnwindSafe(|| {
            let renderer = renderer.get_or_insert_with(|| engine());
            draw(renderer, &job, &work, started)
        }));
        let state = attempt.unwrap_or_else(|_| {
            tracing::error!(job = %job.id, "a job panicked; its worker goes on with a fresh renderer");
            // What it left behind may be half done. Dropping it may panic as well.
            let broken = renderer.take();
            let _ = catch_unwind(AssertUnwindSafe(|| drop(broken)));
            State::Failed(Arc::new(Failure::Panicked))
        });
        // Memory first, then the news: whoever hears of the end can send the next mesh of the same size.
        drop(work);
        board.finish(&job, state, started.elapsed());
    }
}

fn draw(renderer: &mut Renderer, job: &Job, work: &Work, started: Instant) -> State {
    let mut timings = Timings { queue: started.duration_since(job.accepted), ..Timings::default() };
    let mut stage_began = started;
    let result = renderer(work, &job.deadline, &mut |stage| {
        let now = Instant::now();
        timings.note(stage, now.duration_since(stage_began));
        stage_began = now;
    });
    match result {
        Ok(Product::Picture(output)) => State::Done(Arc::new(Finished::new(output, timings))),
        Ok(Product::Report(json)) => State::Inspected(json.into()),
        Err(error) => State::Failed(Arc::new(Failure::Render(error))),
    }
}
