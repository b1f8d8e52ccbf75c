//! The worker threads. Each takes one job after the other and does it with its own renderer, the
//! function that draws, judges, compares or reports. A panic fails its job alone: the worker goes
//! on with a new renderer.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use tracing::Span;

use super::dispatch::Next;
use super::job::{Checking, Comparing, Failure, Finished, Job, JobState, Product, Task, Timings, Work};
use super::registry::JobRegistry;
use crate::priority;
use crate::residents::{FoundMesh, Residents};
use crate::telemetry::traces;
use meshsnap_inspect::check::{self, Verdict};
use meshsnap_inspect::report::{self, Extras};
use meshsnap_inspect::{diff, drawing, read};
use meshsnap_render::backend::cpu::DrawingThreads;
use meshsnap_render::backend::{Backends, GpuHost};
use meshsnap_render::encode::EncodeError;
use meshsnap_render::import::{self, Bundle, MeshError, bundle::UNNAMED};
use meshsnap_render::limits::{Budget, Deadline, Lend, Limits};
use meshsnap_render::pipeline::{self, Context, Model, Output, RenderError, Stage};

/// A worker's renderer, which does one job after the other.
pub type Renderer = Box<dyn FnMut(&Work, &Deadline, &mut dyn FnMut(Stage)) -> Result<Product, RenderError>>;

/// Makes the renderer of a worker, on the worker's own thread, because devices do not move between
/// threads.
pub type RendererFactory = Arc<dyn Fn() -> Renderer + Send + Sync>;

/// The threads that draw on the CPU.
#[derive(Clone)]
pub enum CpuThreads {
    /// This many for each worker.
    Each(usize),
    /// One pool for all workers.
    Shared(Arc<DrawingThreads>),
}

/// Renderers that run [`meshsnap_render::pipeline`].
pub fn pipeline_renderers(
    gpu: Arc<GpuHost>,
    threads: CpuThreads,
    limits: Limits,
    residents: Arc<Residents>,
) -> RendererFactory {
    Arc::new(move || {
        let mut backends = match &threads {
            CpuThreads::Each(count) => Backends::new(gpu.clone(), *count),
            CpuThreads::Shared(threads) => Backends::sharing(gpu.clone(), threads.clone()),
        };
        let (limits, residents) = (limits.clone(), residents.clone());
        Box::new(move |work, deadline, ended| {
            let Work { bundle, format_in, task, .. } = work;
            match task {
                Task::Draw(spec) => {
                    let job = pipeline::Job { bundle: bundle.clone(), format_in: *format_in, spec };
                    let (output, mesh_was_kept) = match &work.mesh_key {
                        Some(key) => {
                            let stored = Stored { key, job, lender: &work.lender };
                            render_stored(stored, &residents, &mut backends, &limits, deadline, ended)?
                        }
                        None => {
                            let budget = work.budget(&limits);
                            let context = Context { backends: &mut backends, budget, deadline, ended };
                            (pipeline::render(job, &limits, context)?, false)
                        }
                    };
                    Ok(Product::Picture { output: Box::new(output), mesh_was_kept })
                }
                Task::Inspect { time_s } => {
                    let options = import::Options { format: *format_in, time_s: *time_s, ..import::Options::default() };
                    let budget = &mut work.budget(&limits);
                    let report = report::inspect(bundle, options, Extras::default(), &limits, budget, deadline, ended)?;
                    Ok(Product::Report(written(report.json())?))
                }
                Task::Check(checking) => judge(work, checking, &limits, deadline, ended),
                Task::Diff(comparing) => compare(work, comparing, &mut backends, &limits, deadline, ended),
            }
        })
    })
}

/// A picture of a mesh that may be in memory.
struct Stored<'a> {
    /// The name of the mesh in memory.
    key: &'a str,
    job: pipeline::Job<'a>,
    /// The memory that the job borrows.
    lender: &'a Option<Arc<dyn Lend>>,
}

/// As [`pipeline::render`], of a mesh that may be in memory, or stays there. True if it was there.
fn render_stored(
    Stored { key, job, lender }: Stored<'_>,
    residents: &Residents,
    backends: &mut Backends,
    limits: &Limits,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<(Output, bool), RenderError> {
    let time_s = job.spec.time_s;
    // Exact, and different for 0 and -0.
    let key = time_s.map_or_else(|| key.to_owned(), |time_s| format!("{key} at {time_s:?} s"));
    let FoundMesh { resident, was_kept } = residents.find(&key, deadline, || {
        let budget = Budget::lent(limits, lender.clone());
        let options = import::Options { format: job.format_in, time_s, ..import::Options::default() };
        let model = Model::read(&job.bundle, options, limits, budget, deadline)?;
        // From here on it is the memory of a mesh that is kept, if there is room for it.
        if let Some(lender) = lender {
            lender.restart();
        }
        Ok(model)
    })?;
    ended(Stage::Parse);
    // A mesh that is kept has a share of its own.
    let spent = resident.model.budget();
    let counted = if resident.is_counted() { spent.spent_bytes() } else { 0 };
    let budget = spent.lent_by(lender.clone(), counted);
    let context = Context { backends, budget, deadline, ended };
    let output = pipeline::render_model(&resident.model, job.spec, context);
    residents.weigh(&key, &resident);
    Ok((output?, was_kept))
}

/// JSON that cannot be written is this program's fault, like a picture that cannot.
fn written(json: serde_json::Result<String>) -> Result<String, RenderError> {
    json.map_err(|error| EncodeError::Failed(error.to_string()).into())
}

/// Judges a mesh. One that cannot be read has a verdict, too.
fn judge(
    work: &Work,
    checking: &Checking,
    limits: &Limits,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Product, RenderError> {
    let Work { bundle, format_in, .. } = work;
    let model = read(bundle, *format_in, limits, work.budget(limits), deadline);
    ended(Stage::Parse);
    let file = bundle.files().first().filter(|_| bundle.files().len() == 1 && !bundle.is_zip());
    let named = bundle.entry().or(file.map(|file| file.path.as_str()));
    let path = model.as_ref().map_or(named.unwrap_or(UNNAMED), |model| &model.report().path).to_owned();
    let options = check::Options { all_places: checking.all_places, fails_at_limits: false };
    let checks = match model.and_then(|model| check::check(&model, &checking.rules, options, deadline)) {
        Ok(checks) => checks,
        Err(error) => vec![check::of_unreadable(&error).ok_or(error)?],
    };
    ended(Stage::Judge);
    let verdict = Verdict::new(path, Some(checking.digest.to_string()), checks);
    Ok(Product::Verdict { has_failed: checking.may_fail && !verdict.ok, json: written(verdict.json())? })
}

/// Compares two meshes, and draws the difference if that is the answer.
fn compare(
    work: &Work,
    comparing: &Comparing,
    backends: &mut Backends,
    limits: &Limits,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Product, RenderError> {
    let Comparing { newer, max_distance, picture, may_fail } = comparing;
    let open = |bundle: &Bundle, side: &str| {
        let about = |error: MeshError| MeshError { detail: format!("{side}: {}", error.detail), ..error };
        read(bundle, work.format_in, limits, work.budget(limits), deadline).map_err(about)
    };
    let (a, b) = (open(&work.bundle, "a")?, open(&newer.bundle, "b")?);
    ended(Stage::Parse);
    let compared = diff::compare(&a, &b, *max_distance, deadline)?;
    let Some(spec) = picture else {
        ended(Stage::Judge);
        let has_failed = *may_fail && !compared.difference.same;
        return Ok(Product::Verdict { has_failed, json: written(compared.difference.json())? });
    };
    // Comparing takes the place of planning.
    ended(Stage::Plan);
    let output = drawing::render_difference([&a, &b], &compared, spec, backends, deadline, ended)?;
    Ok(Product::Picture { output: Box::new(output), mesh_was_kept: false })
}

/// Does jobs until the registry is drained, or until one took so long that another worker has replaced this one.
pub fn run(registry: &Arc<JobRegistry>, renderers: &RendererFactory) {
    // It is made with the first job and dropped when there was none for long, so that an idle process holds
    // no renderer.
    let mut renderer: Option<Renderer> = None;
    priority::lower();
    loop {
        let (job, work, memory) = match registry.take(renderer.is_some().then_some(registry.settings.idle_time)) {
            Next::Job(job, work, memory) => (job, work, memory),
            Next::Idle => {
                drop_renderer(&mut renderer);
                continue;
            }
            Next::End => return,
        };
        let started = Instant::now();
        let span = tracing::info_span!("job", job = %job.id, request_id = &*job.request_id);
        job.trace.adopt(&span);
        traces::add_part(&span, "queue", job.accepted, started);
        let attempt = catch_unwind(AssertUnwindSafe(|| {
            let _entered = span.enter();
            let renderer = renderer.get_or_insert_with(|| renderers());
            run_job(renderer, &job, &work, started)
        }));
        registry.estimates.learn_memory(job.size, memory.peak());
        memory.release();
        let state = attempt.unwrap_or_else(|_| {
            tracing::error!(job = %job.id, "a job panicked; its worker goes on with a fresh renderer");
            drop_renderer(&mut renderer);
            JobState::Failed(Arc::new(Failure::Panicked))
        });
        traces::describe_end(&span, state.name(), matches!(state, JobState::Failed(_)));
        let work = match memory.was_refused() && matches!(state, JobState::Failed(_)) {
            true => match registry.again(&job, *work) {
                Some(work) => Box::new(work),
                None => continue,
            },
            false => work,
        };
        let state = match state {
            JobState::Done(finished) => match Arc::try_unwrap(finished) {
                Ok(finished) => JobState::Done(Arc::new(finished.counted(&registry.settings.memory))),
                Err(finished) => JobState::Done(finished),
            },
            state => state,
        };
        // The memory is freed before the end is announced, so that a client that waits for the end
        // can send the next mesh of the same size.
        drop(work);
        if !registry.finish(&job, state, started.elapsed()) {
            tracing::warn!(job = %job.id, "an overdue worker has ended its job after all");
            return;
        }
    }
}

/// Drops a renderer. After a panic it may be in an undefined state, and on a lost device dropping it may
/// panic as well.
fn drop_renderer(renderer: &mut Option<Renderer>) {
    let renderer = renderer.take();
    let _ = catch_unwind(AssertUnwindSafe(|| drop(renderer)));
}

fn run_job(renderer: &mut Renderer, job: &Job, work: &Work, started: Instant) -> JobState {
    let mut timings = Timings { queue: started.duration_since(job.accepted), ..Timings::default() };
    let mut stage_began = started;
    job.begin(&work.task);
    let result = renderer(work, &job.deadline, &mut |stage| {
        let now = Instant::now();
        timings.record(stage, now.duration_since(stage_began));
        traces::add_part(&Span::current(), stage.name(), stage_began, now);
        stage_began = now;
        job.progress.send_modify(|progress| *progress = progress.after(stage));
    });
    match result {
        Ok(Product::Picture { output, mesh_was_kept }) => {
            JobState::Done(Arc::new(Finished { mesh_was_kept, ..Finished::new(*output, timings) }))
        }
        Ok(Product::Report(json)) => JobState::Inspected(json.into()),
        Ok(Product::Verdict { json, has_failed }) => {
            JobState::Done(Arc::new(Finished::verdict(json, has_failed, timings)))
        }
        Err(error) => JobState::Failed(Arc::new(Failure::Render(error))),
    }
}
