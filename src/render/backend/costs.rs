//! Estimates of the time that the CPU and the GPU need to draw a plan (what one picture shows). While the GPU is
//! busy, a job whose back-end is `auto` goes to the CPU if the CPU would draw it sooner.
//!
//! An estimate is a formula of the plan's size (triangles, samples and edges), times a factor for the back-end and
//! the kind of plan: with lines or without, with transparent layers or without. The factors are learnt from the time
//! that earlier pictures took. Under load they contain how long jobs have to wait for each other. While one back-end
//! draws, the factors of the other return to 1, so that it is tried again.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use super::BackendKind;
use crate::plan::DrawPlan;

/// Part of the way that a factor goes towards what the last picture took.
const STEP: f64 = 0.125;

/// Farthest that one picture may seem to lie from the factor, as a power of two: one that waited for pipelines
/// says little about the next.
const SURPRISE_MAX: f64 = 1.0;

/// The largest factor, and the inverse of the smallest, as a power of two.
const POWER_MAX: f64 = 6.0;

/// Part of the way that a back-end's factor goes back to 1 with each picture that the other one draws: a
/// back-end that draws nothing is tried again some time.
const FORGET: f64 = 1.0 / 64.0;

/// Kinds of plans: with lines or without, with transparent layers or without.
const KINDS: usize = 4;

/// Nanoseconds on one core of a CPU, and on an NVIDIA H200 with its driver (`cargo bench --bench gpu`):
/// for any plan, and for each triangle, sample and edge.
const CPU_NS: [f64; 4] = [100_000.0, 40.0, 2.5, 300.0];
const GPU_NS: [f64; 4] = [300_000.0, 0.15, 0.1, 10.0];

/// The costs of drawing on either back-end, and the load of the GPU.
#[derive(Debug)]
pub struct CostModel {
    /// False for a model whose factors stay as they are.
    learns: bool,
    /// Bits of the factors' powers of two, by back-end and kind.
    powers: [[AtomicU64; KINDS]; 2],
    /// Plans that the GPU is drawing.
    on_gpu: AtomicU32,
}

/// The size of a plan, on which its cost depends.
#[derive(Clone, Copy, Debug)]
pub struct PlanSize {
    /// 1, triangles, samples, edges.
    counts: [f64; 4],
    kind: usize,
}

/// A plan that the GPU is drawing, until this is dropped.
struct OnGpu<'a>(&'a CostModel);

impl CostModel {
    /// A model that learns from what plans take.
    pub fn learning() -> Self {
        Self { learns: true, ..Self::fixed() }
    }

    /// A model of which each answer follows from the plan and the number of jobs on the GPU, for tests.
    pub fn fixed() -> Self {
        Self { learns: false, powers: Default::default(), on_gpu: AtomicU32::new(0) }
    }

    /// True while the GPU draws something and the CPU would have drawn this plan sooner.
    pub fn prefers_cpu(&self, size: PlanSize) -> bool {
        self.on_gpu.load(Ordering::Relaxed) > 0
            && self.seconds(BackendKind::Cpu, size) < self.seconds(BackendKind::Gpu, size)
    }

    /// Draws a plan, and learns from the time that it takes if it succeeds. `draw` says how much of it was no
    /// drawing.
    pub fn timed<T, E>(
        &self,
        backend: BackendKind,
        size: PlanSize,
        draw: impl FnOnce() -> Result<(T, Duration), E>,
    ) -> Result<T, E> {
        let began = Instant::now();
        let on_gpu = (backend == BackendKind::Gpu).then(|| self.begin_on_gpu());
        let (drawn, other) = draw()?;
        drop(on_gpu);
        self.learn(backend, size, began.elapsed().saturating_sub(other));
        Ok(drawn)
    }

    fn begin_on_gpu(&self) -> OnGpu<'_> {
        self.on_gpu.fetch_add(1, Ordering::Relaxed);
        OnGpu(self)
    }

    fn learn(&self, backend: BackendKind, size: PlanSize, took: Duration) {
        if !self.learns {
            return;
        }
        let seen = (took.as_secs_f64().max(1e-9) / formula_s(backend, size)).log2();
        // Where two pictures end at once, one of them may be forgotten.
        for (of, powers) in self.powers.iter().enumerate() {
            let power = &powers[size.kind];
            let before = f64::from_bits(power.load(Ordering::Relaxed));
            let step = match of == backend as usize {
                true => STEP * (seen - before).clamp(-SURPRISE_MAX, SURPRISE_MAX),
                false => -FORGET * before,
            };
            power.store((before + step).clamp(-POWER_MAX, POWER_MAX).to_bits(), Ordering::Relaxed);
        }
    }

    fn seconds(&self, backend: BackendKind, size: PlanSize) -> f64 {
        let power = f64::from_bits(self.powers[backend as usize][size.kind].load(Ordering::Relaxed));
        formula_s(backend, size) * power.exp2()
    }
}

impl PlanSize {
    /// The size of a plan.
    pub fn of(plan: &DrawPlan<'_>) -> Self {
        let hull = plan.hull.as_ref().map_or(0, |hull| hull.triangles.len());
        let triangles = (plan.triangles.len() + hull) as f64;
        let samples = f64::from(plan.width_px) * f64::from(plan.height_px) * f64::from(plan.samples);
        let edges = plan.lines.iter().map(|lines| lines.edges.len()).sum::<usize>() as f64;
        let kind = usize::from(!plan.lines.is_empty()) + 2 * usize::from(plan.peeling.is_some());
        Self { counts: [1.0, triangles, samples, edges], kind }
    }
}

impl Drop for OnGpu<'_> {
    fn drop(&mut self) {
        self.0.on_gpu.fetch_sub(1, Ordering::Relaxed);
    }
}

fn formula_s(backend: BackendKind, size: PlanSize) -> f64 {
    let costs_ns = match backend {
        BackendKind::Cpu => CPU_NS,
        BackendKind::Gpu => GPU_NS,
    };
    size.counts.iter().zip(costs_ns).map(|(count, ns)| count * ns).sum::<f64>() * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: PlanSize = PlanSize { counts: [1.0, 12.0, 4096.0, 0.0], kind: 0 };
    const LARGE: PlanSize = PlanSize { counts: [1.0, 70_000.0, 1_048_576.0, 0.0], kind: 0 };

    #[test]
    fn the_cpu_draws_what_is_small_while_the_gpu_is_busy() {
        let costs = CostModel::fixed();
        assert!(!costs.prefers_cpu(SMALL), "the GPU is idle");
        let busy = costs.begin_on_gpu();
        assert!(costs.prefers_cpu(SMALL) && !costs.prefers_cpu(LARGE));
        let busier = costs.begin_on_gpu();
        drop(busy);
        assert!(costs.prefers_cpu(SMALL));
        drop(busier);
        assert!(!costs.prefers_cpu(SMALL));
    }

    #[test]
    fn a_gpu_that_keeps_jobs_waiting_loses_them_until_it_is_quick_again() {
        let costs = CostModel::learning();
        let _busy = costs.begin_on_gpu();
        let learn = |ms| (0..80).for_each(|_| costs.learn(BackendKind::Gpu, LARGE, Duration::from_millis(ms)));
        learn(20);
        assert!(costs.prefers_cpu(LARGE));
        learn(1);
        assert!(!costs.prefers_cpu(LARGE));
        // The fixed model learns nothing.
        let fixed = CostModel::fixed();
        let _busy = fixed.begin_on_gpu();
        (0..40).for_each(|_| fixed.learn(BackendKind::Gpu, LARGE, Duration::from_secs(1)));
        assert!(!fixed.prefers_cpu(LARGE));
    }

    #[test]
    fn a_back_end_that_draws_nothing_is_tried_again() {
        let costs = CostModel::learning();
        let first = costs.seconds(BackendKind::Cpu, SMALL);
        (0..40).for_each(|_| costs.learn(BackendKind::Cpu, SMALL, Duration::from_secs(1)));
        let slow = costs.seconds(BackendKind::Cpu, SMALL);
        (0..400).for_each(|_| costs.learn(BackendKind::Gpu, SMALL, Duration::from_micros(400)));
        let again = costs.seconds(BackendKind::Cpu, SMALL);
        assert!(slow > 10.0 * first && again < 1.1 * first, "{first} {slow} {again}");
    }

    #[test]
    fn one_picture_that_waited_for_long_changes_little() {
        let costs = CostModel::learning();
        let before = costs.seconds(BackendKind::Gpu, LARGE);
        costs.learn(BackendKind::Gpu, LARGE, Duration::from_secs(100));
        let after = costs.seconds(BackendKind::Gpu, LARGE);
        assert!(after > before && after < 1.1 * before, "{before} {after}");
    }
}
