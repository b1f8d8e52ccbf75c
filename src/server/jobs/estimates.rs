//! Estimates of the time and the memory that jobs take, learnt from earlier jobs.
//!
//! An estimate is a formula of the job's size (bytes that are to be read, views, and samples that are to be drawn),
//! times a factor. There is a factor for each kind of job: its task, its back-end, and whether its mesh is known. A
//! stored mesh is known after a job of the same task, back-end and number of views. Its time then has a factor of its
//! own in place of the kind's: such a mesh is asked for again and again, and its size in bytes says little about what
//! it takes.

use std::hash::{BuildHasher as _, RandomState};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use quick_cache::sync::Cache;

use super::job::{Size, Task, Work};
use meshsnap_render::image::ImageFormat;
use meshsnap_render::spec::{BackendChoice, Spec};

/// Nanoseconds of the formula: for any view, for each byte that is to be read, for each sample of all
/// pictures. They give the factors a sensible start, and weigh bytes against samples.
const JOB_NS: f64 = 500_000.0;
const BYTE_NS: f64 = 5.0;
const SAMPLE_NS: f64 = 5.0;

/// Bytes of memory of the formula: for any job, for each byte that is to be read, for each sample of a picture.
const JOB_BYTES: f64 = 4_194_304.0;
const BYTE_BYTES: f64 = 8.0;
const SAMPLE_BYTES: f64 = 16.0;

/// Part of the way that a factor of memory goes down towards what the last job held. It goes up at once, but at most
/// doubles: a job that was made to be large says little about the next.
const MEMORY_STEP: f64 = 0.05;

/// The largest factor of memory, and the inverse of the smallest.
const MEMORY_FACTOR_MAX: f64 = 64.0;

/// Time of a further view of a mesh, as a share of the time of reading it.
const VIEW_SHARE: f64 = 0.25;

/// Part of the way that a factor goes towards what the last job took.
const STEP: f64 = 0.125;

/// The same for a mesh, of which few jobs are known.
const MESH_STEP: f64 = 0.5;

/// Farthest that one job may seem to lie from a kind's factor, as a power of two: one that waited for a
/// driver, or that was made to be slow, says little about the next.
const SURPRISE_MAX: f64 = 3.0;

/// The largest factor, and the inverse of the smallest, as a power of two.
const POWER_MAX: f64 = 14.0;

/// Pairs of a stored mesh and a kind of job whose factors are kept. The least used go first.
const MESHES: usize = 4096;

/// Numbers of kinds of tasks, and of kinds of jobs: each task on the CPU or on any back-end, of a mesh that
/// is to be read or of one that was drawn before.
const TASKS: usize = 6;
const KINDS: usize = 4 * TASKS;

/// Factors between the durations of jobs and the formula.
#[derive(Debug)]
pub struct Estimates {
    /// Powers of two of the factors, by kind.
    kinds: Mutex<[f64; KINDS]>,
    /// Factors between the memory of jobs and its formula, by kind.
    memory: Mutex<[f64; KINDS]>,
    /// Powers of two of the factors of single meshes, by [`Size::mesh`].
    meshes: Cache<u64, f64>,
    hasher: RandomState,
}

impl Estimates {
    /// Nothing is known yet.
    pub fn new() -> Self {
        Self {
            kinds: Mutex::new([0.0; KINDS]),
            memory: Mutex::new([1.0; KINDS]),
            meshes: Cache::new(MESHES),
            hasher: RandomState::new(),
        }
    }

    /// The size of a job.
    pub fn size(&self, work: &Work) -> Size {
        let (samples, views) = match &work.task {
            Task::Draw(spec) => drawn(spec),
            Task::Inspect { .. } | Task::Check(_) => (0.0, 1),
            Task::Diff(comparing) => (comparing.picture.as_ref().map_or(0.0, |spec| drawn(spec).0), 2),
        };
        let kind = kind(&work.task);
        // What a mesh takes in one view says little about its sheets.
        let mesh = work.mesh_key.as_ref().map(|key| self.hasher.hash_one((kind, key, views)));
        let is_known = mesh.is_some_and(|mesh| self.meshes.get(&mesh).is_some());
        let newer = if let Task::Diff(comparing) = &work.task { comparing.newer.bundle.bytes_len() } else { 0 };
        let bytes = if is_known { 0 } else { work.bundle.bytes_len() + newer };
        let formula_ns = f64::from(views) * JOB_NS
            + BYTE_NS * bytes as f64 * (1.0 + VIEW_SHARE * f64::from(views - 1))
            + SAMPLE_NS * samples;
        let formula_bytes = JOB_BYTES + BYTE_BYTES * bytes as f64 + SAMPLE_BYTES * samples;
        let kind = kind + if is_known { 2 * TASKS } else { 0 };
        Size { formula_s: formula_ns * 1e-9, kind, mesh, is_known, formula_bytes }
    }

    /// The time for which a job of this size is likely to occupy a worker.
    pub fn estimate(&self, size: Size) -> Duration {
        let of_mesh = size.mesh.filter(|_| size.is_known).and_then(|mesh| self.meshes.get(&mesh));
        let power = of_mesh.unwrap_or_else(|| self.locked()[size.kind]);
        Duration::from_secs_f64(size.formula_s * power.exp2())
    }

    /// Learns from a job that occupied a worker for this long.
    pub fn learn(&self, size: Size, took: Duration) {
        let seen = (took.as_secs_f64().max(1e-9) / size.formula_s).log2().clamp(-POWER_MAX, POWER_MAX);
        let mut kinds = self.locked();
        let power = &mut kinds[size.kind];
        *power += STEP * (seen - *power).clamp(-SURPRISE_MAX, SURPRISE_MAX);
        // The factor of a mesh that was drawn before, if nothing else is known of it.
        let usual = if size.is_known { *power } else { kinds[size.kind + 2 * TASKS] };
        drop(kinds);
        if let Some(mesh) = size.mesh {
            let power = self.meshes.get(&mesh).unwrap_or(usual);
            let step = if size.is_known { MESH_STEP * (seen - power) } else { 0.0 };
            self.meshes.insert(mesh, power + step);
        }
    }

    /// The memory that a job of this size is likely to hold, bytes.
    pub fn memory(&self, size: Size) -> u64 {
        (size.formula_bytes * self.memory.lock().unwrap_or_else(PoisonError::into_inner)[size.kind]) as u64
    }

    /// Learns from a job that held so much.
    pub fn learn_memory(&self, size: Size, bytes: u64) {
        let seen = bytes as f64 / size.formula_bytes.max(1.0);
        let factor = &mut self.memory.lock().unwrap_or_else(PoisonError::into_inner)[size.kind];
        let learnt = if seen > *factor { seen.min(2.0 * *factor) } else { *factor + MEMORY_STEP * (seen - *factor) };
        *factor = learnt.clamp(1.0 / MEMORY_FACTOR_MAX, MEMORY_FACTOR_MAX);
    }

    fn locked(&self) -> std::sync::MutexGuard<'_, [f64; KINDS]> {
        self.kinds.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Samples of all views of a request, and the number of the views. The cells of a grid share the picture,
/// and the frames of an animation have the whole size each.
fn drawn(spec: &Spec) -> (f64, u32) {
    let Spec { image, sheet, .. } = spec;
    let samples = f64::from(image.width_px) * f64::from(image.height_px) * f64::from(spec.samples_per_pixel());
    let Some(sheet) = sheet else { return (samples, 1) };
    let is_animated = sheet.is_animated(image.format.unwrap_or(ImageFormat::Png));
    let frames = if is_animated { sheet.count() } else { 1 };
    (samples * f64::from(frames), sheet.count())
}

/// The number of the kind of a task.
fn kind(task: &Task) -> usize {
    let spec = match task {
        Task::Inspect { .. } => return 0,
        Task::Check(_) => return 4,
        Task::Diff(_) => return 5,
        Task::Draw(spec) => spec,
    };
    let Spec { layers, materials, topology, .. } = &**spec;
    let mut all = materials.iter().map(|(_, layers)| layers).chain([layers]);
    let task = if all.clone().any(|layers| layers.wire.is_some()) || topology.is_some() {
        1
    } else if all.any(|layers| layers.outline.is_some()) {
        2
    } else {
        3
    };
    if spec.backend == BackendChoice::Cpu { task } else { TASKS + task }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plain job that takes so many milliseconds by the formula, perhaps on a mesh that was drawn before.
    fn size(formula_ms: f64, mesh: Option<u64>) -> Size {
        let is_known = mesh.is_some();
        let kind = 1 + if is_known { 2 * TASKS } else { 0 };
        Size { formula_s: formula_ms * 1e-3, kind, mesh, is_known, formula_bytes: 1e6 }
    }

    fn ms(estimates: &Estimates, size: Size) -> f64 {
        estimates.estimate(size).as_secs_f64() * 1e3
    }

    #[test]
    fn estimates_come_near_to_what_jobs_take_and_grow_with_their_size() {
        let estimates = Estimates::new();
        assert!((ms(&estimates, size(2.0, None)) - 2.0).abs() < 1e-6);
        for _ in 0..80 {
            estimates.learn(size(2.0, None), Duration::from_millis(20));
        }
        assert!((ms(&estimates, size(2.0, None)) - 20.0).abs() < 0.1);
        assert!((ms(&estimates, size(4.0, None)) - 40.0).abs() < 0.2);
        let other = Size { kind: 2, ..size(2.0, None) };
        assert!((ms(&estimates, other) - 2.0).abs() < 1e-6, "other kinds of jobs");
        assert!((ms(&estimates, size(2.0, Some(7))) - 2.0).abs() < 1e-6, "nothing is read of a mesh in memory");
    }

    #[test]
    fn memory_is_learnt_upwards_soon_and_downwards_slowly() {
        let estimates = Estimates::new();
        assert_eq!(estimates.memory(size(1.0, None)), 1_000_000);
        estimates.learn_memory(size(1.0, None), 1 << 40);
        assert_eq!(estimates.memory(size(1.0, None)), 2_000_000, "one job says little");
        for _ in 0..20 {
            estimates.learn_memory(size(1.0, None), 1 << 40);
        }
        assert_eq!(estimates.memory(size(1.0, None)), 64_000_000);
        assert_eq!(estimates.memory(size(1.0, Some(7))), 1_000_000, "another kind");
        estimates.learn_memory(size(1.0, None), 1_000_000);
        assert!((60_000_000..62_000_000).contains(&estimates.memory(size(1.0, None))));
        for _ in 0..1000 {
            estimates.learn_memory(size(1.0, None), 0);
        }
        assert_eq!(estimates.memory(size(1.0, None)), 15_625);
    }

    #[test]
    fn a_slow_mesh_is_soon_known_and_says_little_about_others() {
        let estimates = Estimates::new();
        let slow = size(1.0, Some(7));
        estimates.learn(slow, Duration::from_secs(4));
        assert!(ms(&estimates, slow) < 100.0, "it may have waited for a driver");
        for _ in 0..6 {
            estimates.learn(slow, Duration::from_secs(4));
        }
        let (slow, other) = (ms(&estimates, slow), ms(&estimates, size(1.0, Some(8))));
        assert!((2000.0..4000.0).contains(&slow), "{slow}");
        assert!(other < 10.0, "{other}");
    }

    #[test]
    fn a_mesh_that_is_read_first_is_thought_to_be_quick_then() {
        let estimates = Estimates::new();
        let first = Size { mesh: Some(7), ..size(1.0, None) };
        estimates.learn(first, Duration::from_secs(4));
        assert!(ms(&estimates, size(1.0, Some(7))) < 1.1);
    }

    #[test]
    fn no_job_makes_an_estimate_absurd() {
        let estimates = Estimates::new();
        for took in [Duration::ZERO, Duration::MAX] {
            for _ in 0..1000 {
                estimates.learn(size(1.0, Some(1)), took);
            }
            let estimate = ms(&estimates, size(1.0, Some(1)));
            assert!((1.0 / 20_000.0..20_000.0).contains(&estimate), "{estimate}");
        }
        for mesh in 0..20_000 {
            estimates.learn(size(1.0, Some(mesh)), Duration::from_millis(1));
        }
        assert!(estimates.meshes.len() <= 2 * MESHES, "{}", estimates.meshes.len());
    }
}
